//! Robust losses.

/// Loss function of a residual. `scale` is in the residual's unit; s is the squared norm of one residual (both
/// components of a pixel together).
///
/// P. Huber, "Robust estimation of a location parameter", 1964; the redescending losses as in F. Hampel et al.,
/// "Robust Statistics", 1986, and S. Geman and D. McClure, 1987.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Loss {
    /// ρ(s) = s: plain least squares.
    Squares,
    /// ρ(s) = s up to scale², then 2·scale·√s − scale²: bounded influence, still one minimum for a linear model.
    Huber(f64),
    /// ρ(s) = scale² ln(1 + s/scale²): the influence of a far outlier falls to zero.
    Cauchy(f64),
    /// ρ(s) = s / (1 + s/scale²): the cost of an outlier is bounded by scale².
    GemanMcClure(f64),
}

impl Loss {
    /// ρ(s), in the square of the residual's unit.
    #[must_use]
    pub fn cost(self, s: f64) -> f64 {
        match self {
            Self::Squares => s,
            Self::Huber(scale) if s <= scale * scale => s,
            Self::Huber(scale) => 2.0 * scale * s.sqrt() - scale * scale,
            Self::Cauchy(scale) => scale * scale * (s / (scale * scale)).ln_1p(),
            Self::GemanMcClure(scale) => s / (1.0 + s / (scale * scale)),
        }
    }

    /// ρ'(s): the weight of the squared residual in iteratively reweighted least squares, from 0 to 1.
    #[must_use]
    pub fn weight(self, s: f64) -> f64 {
        match self {
            Self::Squares => 1.0,
            Self::Huber(scale) if s <= scale * scale => 1.0,
            Self::Huber(scale) => scale / s.sqrt(),
            Self::Cauchy(scale) => 1.0 / (1.0 + s / (scale * scale)),
            Self::GemanMcClure(scale) => (1.0 + s / (scale * scale)).powi(-2),
        }
    }
}
