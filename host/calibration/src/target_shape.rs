//! The shape of a target that is not quite flat.

use nalgebra::Vector3;
use vergence_targets::Corner;

/// The target's height over its plane, towards +z of its frame: along_x (1 − x̂²) + along_y (1 − ŷ²) millimetres, with x̂ and ŷ from −1 to 1 over
/// the corners that views show. The rows of its corners bend with the first, the columns with the second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TargetShape {
    /// Height of the middle over the left and right edges, in millimetres.
    pub along_x_mm: f64,
    /// Height of the middle over the upper and lower edges, in millimetres.
    pub along_y_mm: f64,
    /// Middle of the rectangle of all corners, in millimetres.
    pub centre_mm: [f64; 2],
    /// Half of its width and height, in millimetres.
    pub half_mm: [f64; 2],
}

impl TargetShape {
    /// A plane.
    pub const FLAT: Self = Self { along_x_mm: 0.0, along_y_mm: 0.0, centre_mm: [0.0; 2], half_mm: [1.0; 2] };

    /// A plane whose bow would be measured over the rectangle of these corners.
    pub(crate) fn over<'a>(corners: impl IntoIterator<Item = &'a Corner>) -> Self {
        let mut ends = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
        for corner in corners {
            for (ends, at) in ends.iter_mut().zip(corner.target_mm) {
                *ends = [ends[0].min(at), ends[1].max(at)];
            }
        }
        if ends.iter().any(|[first, last]| first >= last) {
            return Self::FLAT;
        }
        let [centre_mm, half_mm] = [1.0, -1.0].map(|sign| ends.map(|[first, last]| 0.5 * (last + sign * first)));
        Self { centre_mm, half_mm, ..Self::FLAT }
    }

    /// Bent by these heights along x and along y, in millimetres.
    pub(crate) const fn bent(self, [along_x_mm, along_y_mm]: [f64; 2]) -> Self {
        Self { along_x_mm, along_y_mm, ..self }
    }

    /// The heights along x and along y, in millimetres.
    pub(crate) const fn heights_mm(&self) -> [f64; 2] {
        [self.along_x_mm, self.along_y_mm]
    }

    /// The height here for a unit bow along x and along y: 1 − x̂² and 1 − ŷ².
    pub(crate) fn bow(&self, target_mm: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| 1.0 - ((target_mm[axis] - self.centre_mm[axis]) / self.half_mm[axis]).powi(2))
    }

    /// A place on the target, in millimetres in its frame.
    #[must_use]
    pub fn point_mm(&self, target_mm: [f64; 2]) -> Vector3<f64> {
        let [x, y] = target_mm;
        let [along_x, along_y] = self.bow(target_mm);
        Vector3::new(x, y, self.along_x_mm * along_x + self.along_y_mm * along_y)
    }
}

/// A bow that was estimated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TargetWarp {
    /// The target's shape.
    pub shape: TargetShape,
    /// Standard deviations of its heights along x and along y, in millimetres.
    pub sigma_mm: [f64; 2],
}
