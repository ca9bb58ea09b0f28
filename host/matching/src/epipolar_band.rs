//! Where in one view the partner of a position in the other view may lie.

use vergence_vision::{Angle, Length};

use crate::{Grid, ViewPixel};

/// The rows and columns that the known pose, its uncertainty and the nearest range leave open.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EpipolarBand {
    grid: Grid,
    baseline_mm: f64,
    nearest_mm: f64,
    pose_px: f64,
}

impl EpipolarBand {
    /// How many standard deviations of the pose the band leaves open.
    pub(crate) const SIGMAS: f64 = 2.0;

    pub(crate) fn new(grid: Grid, baseline: Length, nearest: Length, pose_sigma: Angle) -> Self {
        let pose_px = Self::SIGMAS * pose_sigma.rad() * grid.pixels_per_radian();
        Self { grid, baseline_mm: baseline.mm(), nearest_mm: nearest.mm(), pose_px }
    }

    /// Whether the two positions, each known to `tolerance` pixels, may show one point.
    pub(crate) fn allows(&self, left: ViewPixel, right: ViewPixel, tolerance: f64) -> bool {
        let slack = tolerance + self.pose_px;
        // A row is an angle about the baseline: off the axis it covers only cos a of arc.
        let off_row = (left.y - right.y).abs() * self.grid.a(left.x).cos();
        let disparity = left.x - right.x;
        off_row <= slack && disparity >= -slack && disparity <= self.largest_disparity(left.x) + slack
    }

    /// No allowed partner is farther off in rows than this.
    pub(crate) fn reach(&self, tolerance: f64) -> f64 {
        let (last, _) = self.grid.size();
        let least_cos = self.grid.a(0.0).cos().min(self.grid.a(last as f64).cos());
        (tolerance + self.pose_px) / least_cos.max(f64::MIN_POSITIVE)
    }

    /// The disparity in pixels of the nearest range at column x of the left view: the point r (sin a, cos a) is seen
    /// from (B, 0) at atan2(r sin a − B, r cos a).
    pub(crate) fn largest_disparity(&self, x: f64) -> f64 {
        let a = self.grid.a(x);
        let (along, across) = (self.nearest_mm * a.sin() - self.baseline_mm, self.nearest_mm * a.cos());
        (a - along.atan2(across)) * self.grid.pixels_per_radian()
    }
}
