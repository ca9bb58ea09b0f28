//! The shared axes of a pair, in which both images are compared.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use vergence_vision::{Angle, Frame, Left, Length, Right, Transform};

/// The frame of the shared axes of a pair.
///
/// x points along the baseline from the left to the right camera, z along the component of the mean optical axis that
/// is orthogonal to x, and y = z × x. Each camera is its own origin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shared;
impl Frame for Shared {}

/// The rotations of both cameras to the [`Shared`] axes, and the baseline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SharedFrame {
    shared_from_left: Transform<Shared, Left>,
    shared_from_right: Transform<Shared, Right>,
    baseline: Length,
}

impl SharedFrame {
    /// Computes the shared axes of two cameras; `None` without a baseline (coinciding cameras or a pose that is not
    /// finite).
    ///
    /// Where the optical axes cancel or run along the baseline, z is taken orthogonal to the cameras' down axes
    /// instead. Rows are epipolar for any z orthogonal to the baseline.
    #[must_use]
    pub fn new(left_from_right: &Transform<Left, Right>) -> Option<Self> {
        let x = left_from_right.origin().direction()?.vector();
        let right = left_from_right.rotation();
        let mean = |axis: Vector3<f64>| axis + right * axis;
        let candidates = [mean(Vector3::z()), x.cross(&mean(Vector3::y())), Vector3::z(), Vector3::y()];
        let z = candidates.iter().find_map(|axis| orthogonal_to(&x, axis))?;
        let y = z.cross(&x);
        let rows = Matrix3::from_rows(&[x.transpose(), y.transpose(), z.transpose()]);
        let turn = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows));
        turn.coords.iter().all(|c| c.is_finite()).then(|| Self {
            shared_from_left: Transform::new(turn, Vector3::zeros()),
            shared_from_right: Transform::new(turn * right, Vector3::zeros()),
            baseline: Length::from_mm(left_from_right.origin().mm().norm()),
        })
    }

    /// The axes of `before`, if neither camera has turned from them by as much as `most`, or else these: what was made for one serves the other.
    pub(crate) fn or_nearly(self, before: &Self, most: Angle) -> Self {
        let left = self.shared_from_left.rotation().angle_to(&before.shared_from_left.rotation());
        let right = self.shared_from_right.rotation().angle_to(&before.shared_from_right.rotation());
        if left.max(right) < most.rad() { Self { baseline: self.baseline, ..*before } } else { self }
    }

    /// The rotation of the left camera to the shared axes; its translation is zero.
    #[must_use]
    pub const fn shared_from_left(&self) -> Transform<Shared, Left> {
        self.shared_from_left
    }

    /// The rotation of the right camera to the shared axes; its translation is zero. The right camera lies at
    /// (baseline, 0, 0) of the left one's shared axes.
    #[must_use]
    pub const fn shared_from_right(&self) -> Transform<Shared, Right> {
        self.shared_from_right
    }

    /// The distance between the cameras.
    #[must_use]
    pub const fn baseline(&self) -> Length {
        self.baseline
    }
}

/// The normalised component of `axis` orthogonal to the unit vector `x`; `None` where it is short.
fn orthogonal_to(x: &Vector3<f64>, axis: &Vector3<f64>) -> Option<Vector3<f64>> {
    /// Sine of about 3° between axis and baseline; at smaller angles z would follow the noise of the pose.
    const LEAST: f64 = 0.05;
    (axis - x * axis.dot(x)).try_normalize(LEAST)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn turned(by: f64, baseline_mm: f64) -> SharedFrame {
        let turn = UnitQuaternion::from_euler_angles(0.0, 1.0 + by, 0.0);
        SharedFrame::new(&Transform::new(turn, Vector3::new(baseline_mm, 1.0, 3.0))).unwrap()
    }

    #[test]
    fn axes_stay_while_no_camera_turns_by_what_shows() {
        let (first, most) = (turned(0.0, 100.0), Angle::from_rad(1e-5));
        let near = turned(4e-6, 100.0).or_nearly(&first, most);
        assert_eq!(near.shared_from_right, first.shared_from_right);
        // Small turns do not add up: it is the axes that were kept which count.
        let far = turned(4e-5, 100.0);
        assert_eq!(far.or_nearly(&near, most), far);
        // The baseline is always the new one.
        let longer = SharedFrame { baseline: Length::from_mm(130.0), ..first };
        assert_eq!(longer.or_nearly(&first, most).baseline(), Length::from_mm(130.0));
    }
}
