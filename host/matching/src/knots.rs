//! Smooth functions of a column, computed exactly at knots and interpolated between them.

/// Columns from one knot to the next. Values between knots are interpolated by the cubic through four of them: at 183 pixels per radian the position of a ray
/// in an image is off by less than a thousandth of a pixel.
pub(crate) const KNOT: usize = 8;

/// Weights of four knots at each column from the second to the third, by Lagrange's cubic.
const BETWEEN: [[f64; 4]; KNOT] = {
    let mut weights = [[0.0; 4]; KNOT];
    let mut i = 0;
    while i < KNOT {
        let t = i as f64 / KNOT as f64;
        let (before, after, beyond) = (t + 1.0, t - 1.0, t - 2.0);
        weights[i] = [
            -t * after * beyond / 6.0,
            before * after * beyond / 2.0,
            -before * t * beyond / 2.0,
            before * t * after / 6.0,
        ];
        i += 1;
    }
    weights
};

/// Values between the second and the third of four knots.
#[inline(always)]
pub(crate) fn interpolate<const N: usize>(knots: &[[f64; N]], values: &mut [[f64; N]]) {
    let &[p, q, r, s] = knots else { return };
    for (value, weights) in values.iter_mut().zip(&BETWEEN) {
        *value = std::array::from_fn(|k| weights[0] * p[k] + weights[1] * q[k] + weights[2] * r[k] + weights[3] * s[k]);
    }
}
