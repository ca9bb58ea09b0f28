//! The paper's figures beside what each kind of error gives alone.

use vergence_vision::Angle;

use crate::conditions::Cause;
use crate::measure::DEPTH;
use crate::method::Method;
use crate::study::BASELINE;
use crate::tally::Table;

/// A mean absolute error that the paper reports of its hardware.
pub struct Published {
    /// The mode here; for the first two the paper names none.
    pub mode: &'static str,
    /// The method here.
    pub method: Method,
    /// The error of the depth, in millimetres.
    pub mm: f64,
    /// The paper's words.
    pub words: &'static str,
}

impl Published {
    const fn new(mode: &'static str, method: Method, mm: f64, words: &'static str) -> Self {
        Self { mode, method, mm, words }
    }
}

/// All of them, at 350 mm.
pub const PUBLISHED: [Published; 4] = [
    Published::new("human", Method::Rectified, 0.793, "rectified pair"),
    Published::new("human", Method::Midpoint, 2.36, "plain midpoint"),
    Published::new("human", Method::PseudoIntersection, 1.08, "its method, human mode"),
    Published::new("herbivore", Method::PseudoIntersection, 1.44, "its method, herbivore mode"),
];

/// What a kind of error gives alone.
pub struct Column {
    /// The kind.
    pub cause: Cause,
    /// Every method in every mode.
    pub table: Table,
}

/// One size of an error that comes closest to all published figures.
pub struct Closest {
    /// So many times the size that it has here.
    pub times: f64,
    /// The largest ratio of a published figure to that size's, or the inverse.
    pub worst: f64,
}

impl Column {
    /// How many times larger the error would have to be to give each published figure, if the depth's error grows with it.
    #[must_use]
    pub fn times(&self) -> [Option<f64>; PUBLISHED.len()] {
        PUBLISHED.each_ref().map(|published| {
            let row = self.table.row(published.mode, published.method.as_str())?;
            Some(published.mm / row.figures.mean_abs_mm)
        })
    }

    /// The size that comes closest to all of them; `None` where a method has no points.
    #[must_use]
    pub fn closest(&self) -> Option<Closest> {
        let logarithms = self.times().into_iter().map(|times| times.map(f64::ln)).collect::<Option<Vec<f64>>>()?;
        let (low, high) =
            logarithms.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        Some(Closest { times: (0.5 * (low + high)).exp(), worst: (0.5 * (high - low)).exp() })
    }

    /// The largest difference of the midpoint from the pseudo-intersection of the same rays in a mode, as a share.
    #[must_use]
    pub fn midpoint_differs(&self) -> f64 {
        let differs = |mode: &&str| {
            let error = |method: Method| Some(self.table.row(mode, method.as_str())?.figures.mean_abs_mm);
            Some((error(Method::Midpoint)? / error(Method::PseudoIntersection)? - 1.0).abs())
        };
        crate::bench::MODES.iter().filter_map(differs).fold(0.0, f64::max)
    }
}

/// By how much rays must miss each other across the epipolar plane for the midpoint to be off by the published difference of
/// 2.36 and 1.08 mm: its range is short by δ² / (γ² + δ²) of itself where rays meet at an angle γ and miss by δ.
#[must_use]
pub fn miss_for_published_midpoint() -> Angle {
    let share = (PUBLISHED[1].mm - PUBLISHED[2].mm) / DEPTH.mm();
    let parallax = 2.0 * (0.5 * BASELINE.mm()).atan2(DEPTH.mm());
    Angle::from_rad(parallax * (share / (1.0 - share)).sqrt())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may fail")]

    use super::*;
    use crate::tally::{Figures, Row};

    fn column(errors: [f64; 4]) -> Column {
        let row = |(published, mean_abs_mm): (&Published, f64)| Row {
            mode: published.mode,
            method: published.method.as_str(),
            figures: Figures { mean_abs_mm, ..Figures::default() },
            nees: None,
            field: Vec::new(),
        };
        let rows = PUBLISHED.iter().zip(errors).map(row).collect();
        let table = Table {
            rows,
            seeds: 1,
            corner_px: 0.1,
            stated_px: 0.1,
            photographs: [0, 0],
            corners: [0, 0],
            undistorted: Vec::new(),
        };
        Column { cause: Cause::Pose, table }
    }

    #[test]
    fn a_column_in_proportion_gives_the_pattern_by_one_factor() {
        let closest = column([0.793, 2.36, 1.08, 1.44].map(|mm| mm / 3.0)).closest().unwrap();
        assert!((closest.times - 3.0).abs() < 1e-9 && (closest.worst - 1.0).abs() < 1e-9);
        // All alike: 2.36 / 0.793 is shared between both ends.
        let flat = column([0.5; 4]);
        assert!((flat.closest().unwrap().worst - (2.36f64 / 0.793).sqrt()).abs() < 1e-9);
        assert!(flat.midpoint_differs() < 1e-12);
    }

    /// The midpoint of two rays that miss by that angle is as far off as stated.
    #[test]
    fn the_miss_explains_the_published_difference() {
        let miss = miss_for_published_midpoint();
        let half = 0.5 * BASELINE.mm();
        let ray = |x: f64, turn: f64| {
            nalgebra::UnitQuaternion::from_axis_angle(&nalgebra::Vector3::x_axis(), turn)
                * nalgebra::Vector3::new(x, 0.0, DEPTH.mm()).normalize()
        };
        let cosine = half.atan2(DEPTH.mm()).cos();
        // Turned about the baseline, rays leave their plane by the turn times the cosine.
        let (left, right) = (ray(half, 0.5 * miss.rad() / cosine), ray(-half, -0.5 * miss.rad() / cosine));
        let [left, right] =
            [left, right].map(|ray| vergence_vision::UnitRay::<vergence_vision::Left>::new(ray).unwrap());
        let centre = vergence_vision::Point::from_mm(nalgebra::Vector3::new(BASELINE.mm(), 0.0, 0.0));
        let short = DEPTH.mm() - vergence_vision::midpoint(&left, &right, &centre).unwrap().point.mm().z;
        assert!((short / (PUBLISHED[1].mm - PUBLISHED[2].mm) - 1.0).abs() < 0.2, "{short} mm");
    }
}
