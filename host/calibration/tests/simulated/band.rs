//! The band of a mean NEES.

/// Where the mean of `draws` χ² variables of `freedom` degrees lies in 99 % of all cases (E. Wilson and M. Hilferty, "The
/// distribution of chi-square", PNAS 17, 1931).
pub fn nees_band(freedom: f64, draws: f64) -> std::ops::Range<f64> {
    let all = freedom * draws;
    let quantile = |z: f64| {
        let spread = 2.0 / (9.0 * all);
        freedom * (1.0 - spread + z * spread.sqrt()).powi(3)
    };
    quantile(-2.576)..quantile(2.576)
}

/// Whether standard deviations that are stated `times` as large as they are would be noticed: whether `mean`, a mean NEES inside
/// `band`, leaves it both where they are stated too large and where they are stated too small by this factor.
pub fn notices(mean: f64, band: &std::ops::Range<f64>, times: f64) -> bool {
    let square = times * times;
    band.contains(&mean) && mean / square < band.start && mean * square > band.end
}
