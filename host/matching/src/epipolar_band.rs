//! The epipolar band: the region of one view where the partner of a position in the other view may lie.

use vergence_vision::{Angle, Length};

use crate::{Grid, ViewPixel};

/// The rows and columns that the stated pose, its uncertainty and the nearest range allow for a partner.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EpipolarBand {
    grid: Grid,
    baseline_mm: f64,
    nearest_mm: f64,
    pose_px: f64,
    /// How far rows may differ at the nearest range, because rays do not start at the cameras' origins.
    pupil_px: f64,
}

impl EpipolarBand {
    /// Half height of the band in standard deviations of the pose.
    pub(crate) const SIGMAS: f64 = 2.0;

    pub(crate) fn new(grid: Grid, baseline: Length, nearest: Length, pose_sigma: Angle) -> Self {
        let pose_px = Self::SIGMAS * pose_sigma.rad() * grid.pixels_per_radian();
        Self { grid, baseline_mm: baseline.mm(), nearest_mm: nearest.mm(), pose_px, pupil_px: 0.0 }
    }

    /// The band for lenses whose rays start as much as `shift` from their cameras' origins: it is wider by the angle of that at the range of a
    /// partner, which its disparity tells.
    pub(crate) fn with_pupils(self, shift: Length) -> Self {
        let pupil_px = (shift.mm() / self.nearest_mm).atan() * self.grid.pixels_per_radian();
        Self { pupil_px, ..self }
    }

    /// Whether two positions, each known to `tolerance` pixels, may be of one point.
    pub(crate) fn allows(&self, left: ViewPixel, right: ViewPixel, tolerance: f64) -> bool {
        self.of(left, tolerance).holds(right)
    }

    /// Where partners of `left` may be, each known to `tolerance` pixels.
    pub(crate) fn of(&self, left: ViewPixel, tolerance: f64) -> Partners {
        Partners {
            left,
            shortening: self.shortening(left),
            largest_disparity: self.largest_disparity(left.x),
            slack: tolerance + self.pose_px,
            pupil_px: self.pupil_px,
        }
    }

    /// Length of the arc of one row at `at`, relative to that on the axis: a row is an angle about the baseline.
    pub(crate) fn shortening(&self, at: ViewPixel) -> f64 {
        self.grid.a(at.x).cos()
    }

    /// The largest distance of an allowed partner in rows.
    pub(crate) fn reach(&self, tolerance: f64) -> f64 {
        let (last, _) = self.grid.size();
        let least_cos = self.grid.a(0.0).cos().min(self.grid.a(last as f64).cos());
        (tolerance + self.pose_px + self.pupil_px) / least_cos.max(f64::MIN_POSITIVE)
    }

    /// The disparity in pixels of the nearest range at column x of the left view. The right camera at (B, 0) sees the
    /// point r (sin a, cos a) at the angle atan2(r sin a − B, r cos a).
    pub(crate) fn largest_disparity(&self, x: f64) -> f64 {
        let a = self.grid.a(x);
        let (along, across) = (self.nearest_mm * a.sin() - self.baseline_mm, self.nearest_mm * a.cos());
        (a - along.atan2(across)) * self.grid.pixels_per_radian()
    }
}

/// The part of the right view where partners of one position of the left view may be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Partners {
    left: ViewPixel,
    shortening: f64,
    largest_disparity: f64,
    slack: f64,
    pupil_px: f64,
}

impl Partners {
    /// Whether a position of the right view is one of them.
    pub(crate) fn holds(&self, right: ViewPixel) -> bool {
        let off_row = (self.left.y - right.y).abs() * self.shortening;
        let disparity = self.left.x - right.x;
        let nearness = (disparity / self.largest_disparity).clamp(0.0, 1.0);
        let nearness = if nearness.is_finite() { nearness } else { 1.0 };
        off_row <= self.slack + self.pupil_px * nearness
            && disparity >= -self.slack
            && disparity <= self.largest_disparity + self.slack
    }
}
