//! Distortion on a plane in lanes: OpenCV's radial, rational, tangential and thin prism terms, which those of FISHEYE624 are too.

use super::lanes::multiply_add;

/// The coefficients of [`crate::Radtan`] without the sensor's tilt.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Plane {
    over: [f64; 3],
    under: Option<[f64; 3]>,
    p: [f64; 2],
    s: [f64; 4],
    /// Neither `over` nor `under`.
    pub is_radial: bool,
    /// Neither `p` nor `s`.
    pub is_asymmetric: bool,
}

/// Where places go, and how: the derivatives of x', then of y', by x and y.
pub(super) struct Moved<const W: usize> {
    pub at: [[f64; W]; 2],
    pub by: [[[f64; W]; 2]; 2],
}

impl Plane {
    pub(super) fn new(coefficients: &[f64; 14]) -> Self {
        let &[k1, k2, p1, p2, k3, k4, k5, k6, s1, s2, s3, s4, _, _] = coefficients;
        let (over, under, p, s) = ([k1, k2, k3], [k4, k5, k6], [p1, p2], [s1, s2, s3, s4]);
        let any = |numbers: &[f64]| numbers.iter().any(|number| *number != 0.0);
        Self {
            over,
            under: any(&under).then_some(under),
            p,
            s,
            is_radial: any(&over) || any(&under),
            is_asymmetric: any(&p) || any(&s),
        }
    }

    /// The factor of the radius at its square.
    pub(super) fn growth(&self, squared: f64) -> f64 {
        let [growth] = self.growths::<false, 1>(&[squared]);
        growth
    }

    #[inline(always)]
    fn growths<const FUSED: bool, const W: usize>(&self, squared: &[f64; W]) -> [f64; W] {
        let mut growth = series::<FUSED, W>(self.over, squared);
        if let Some(under) = self.under {
            let under = series::<FUSED, W>(under, squared);
            for j in 0..W {
                growth[j] /= under[j];
            }
        }
        growth
    }

    /// What the asymmetric terms add at a place.
    #[inline(always)]
    pub(super) fn added<const FUSED: bool, const W: usize>(&self, [x, y]: &[[f64; W]; 2]) -> [[f64; W]; 2] {
        let fused = multiply_add::<FUSED>;
        let ([p1, p2], [s1, s2, s3, s4]) = (self.p, self.s);
        let (mut a, mut b) = ([0.0; W], [0.0; W]);
        for j in 0..W {
            let squared = fused(x[j], x[j], y[j] * y[j]);
            let along = 2.0 * fused(p1, y[j], p2 * x[j]);
            a[j] = fused(along, x[j], squared * (p2 + fused(s2, squared, s1)));
            b[j] = fused(along, y[j], squared * (p1 + fused(s4, squared, s3)));
        }
        [a, b]
    }

    /// Where places go.
    #[inline(always)]
    pub(super) fn moved<const FUSED: bool, const W: usize>(&self, at: [[f64; W]; 2]) -> [[f64; W]; 2] {
        let mut moved = at;
        if self.is_radial {
            let mut squared = [0.0; W];
            for j in 0..W {
                squared[j] = multiply_add::<FUSED>(at[0][j], at[0][j], at[1][j] * at[1][j]);
            }
            let growth = self.growths::<FUSED, W>(&squared);
            for j in 0..W {
                moved[0][j] *= growth[j];
                moved[1][j] *= growth[j];
            }
        }
        if self.is_asymmetric {
            let [a, b] = self.added::<FUSED, W>(&at);
            for j in 0..W {
                moved[0][j] += a[j];
                moved[1][j] += b[j];
            }
        }
        moved
    }

    /// Where places go, and how.
    #[inline(always)]
    pub(super) fn moved_with_slopes<const FUSED: bool, const W: usize>(&self, [x, y]: &[[f64; W]; 2]) -> Moved<W> {
        let fused = multiply_add::<FUSED>;
        let ([k1, k2, k3], [p1, p2], [s1, s2, s3, s4]) = (self.over, self.p, self.s);
        let (mut squared, mut growth, mut steeper) = ([0.0; W], [0.0; W], [0.0; W]);
        for j in 0..W {
            squared[j] = fused(x[j], x[j], y[j] * y[j]);
            growth[j] = fused(squared[j], fused(squared[j], fused(squared[j], k3, k2), k1), 1.0);
            // Twice the derivative by the squared radius.
            steeper[j] = 2.0 * fused(squared[j], fused(squared[j], 3.0 * k3, 2.0 * k2), k1);
        }
        if let Some([k4, k5, k6]) = self.under {
            for j in 0..W {
                let over = 1.0 / fused(squared[j], fused(squared[j], fused(squared[j], k6, k5), k4), 1.0);
                let steeper_under = 2.0 * fused(squared[j], fused(squared[j], 3.0 * k6, 2.0 * k5), k4);
                growth[j] *= over;
                steeper[j] = over * (steeper[j] - growth[j] * steeper_under);
            }
        }
        let zero = [0.0; W];
        let mut moved = Moved { at: [zero; 2], by: [[zero; 2]; 2] };
        for j in 0..W {
            let (x, y, squared) = (x[j], y[j], squared[j]);
            let along = 2.0 * fused(p1, y, p2 * x);
            let (a, b) = (p2 + fused(s2, squared, s1), p1 + fused(s4, squared, s3));
            let (by_a, by_b) = (2.0 * fused(s2, squared, a), 2.0 * fused(s4, squared, b));
            let scale = growth[j] + along;
            let (radial_x, radial_y) = (steeper[j] * x, steeper[j] * y);
            moved.at[0][j] = fused(scale, x, a * squared);
            moved.at[1][j] = fused(scale, y, b * squared);
            moved.by[0][0][j] = scale + x * (radial_x + 2.0 * p2 + by_a);
            moved.by[0][1][j] = fused(x, radial_y + 2.0 * p1, y * by_a);
            moved.by[1][0][j] = fused(y, radial_x + 2.0 * p2, x * by_b);
            moved.by[1][1][j] = scale + y * (radial_y + 2.0 * p1 + by_b);
        }
        moved
    }
}

#[inline(always)]
fn series<const FUSED: bool, const W: usize>([a, b, c]: [f64; 3], squared: &[f64; W]) -> [f64; W] {
    let fused = multiply_add::<FUSED>;
    let mut sum = [0.0; W];
    for j in 0..W {
        sum[j] = fused(squared[j], fused(squared[j], fused(squared[j], c, b), a), 1.0);
    }
    sum
}

#[cfg(test)]
#[path = "../../tests/unit/plane.rs"]
mod tests;
