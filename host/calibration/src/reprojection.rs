//! Local coordinates of lenses and poses, and projection with derivatives.
//!
//! A pose moves in local coordinates `[ω, δ]`: `R ← exp(ω) R`, `t ← t + δ`, in radians about and millimetres along the
//! axes of the frame it maps to.

use nalgebra::{Isometry3, Matrix2x3, Matrix3, SMatrix, SVector, Translation3, UnitQuaternion, Vector2, Vector3};
use vergence_vision::{InvalidLens, KannalaBrandt, Point};

pub(crate) use crate::intrinsics::{CENTRAL, LENS};
use crate::intrinsics::{LensParameters, reproject};

/// Number of local coordinates of a pose.
pub(crate) const POSE: usize = 6;

/// A lens as a point of the parameter space, in the order of [`LENS_PARAMETERS`](vergence_vision::LENS_PARAMETERS).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lens(LensParameters);

/// A pixel and its derivatives by the point (in the camera frame) and by the lens.
pub(crate) struct Projection {
    pub pixel: Vector2<f64>,
    pub by_point: Matrix2x3<f64>,
    pub by_lens: SMatrix<f64, 2, LENS>,
}

impl Lens {
    pub fn of(camera: &KannalaBrandt) -> Self {
        Self(LensParameters::of(camera))
    }

    pub fn parameters(&self) -> SVector<f64, LENS> {
        SVector::from(self.0.to_array())
    }

    pub fn moved(&self, delta: &SVector<f64, LENS>) -> Self {
        Self(LensParameters::from_array((self.parameters() + delta).into()))
    }

    /// The lens of the parameters alone: see [`LensParameters::polynomial`].
    pub fn polynomial(&self) -> Self {
        Self(self.0.polynomial())
    }

    /// The camera with these parameters, its field cut to where they are still a lens.
    pub fn camera(&self, like: &KannalaBrandt) -> Result<KannalaBrandt, InvalidLens> {
        match self.0.camera(like.theta_max(), like.size()) {
            Err(InvalidLens::TurnsOver { .. }) => {
                self.0.camera(self.0.central.largest_theta_with(self.0.further, like.size())?, like.size())
            }
            made => made,
        }
    }

    /// Image of `point`, also outside the field, so that an iteration which strays there can return. `None` at the
    /// optical centre and straight behind it.
    pub fn project(&self, point: &Vector3<f64>) -> Option<Projection> {
        let projected = reproject(self.0, &Point::from_mm(*point))?;
        Some(Projection {
            pixel: projected.pixel.into(),
            by_point: projected.by_point.into(),
            by_lens: projected.by_lens.into(),
        })
    }
}

/// `pose` moved by `[ω, δ]`.
pub(crate) fn moved(pose: &Isometry3<f64>, delta: &SVector<f64, POSE>) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_scaled_axis(delta.fixed_rows::<3>(0).into_owned()) * pose.rotation;
    let translation = pose.translation.vector + delta.fixed_rows::<3>(3);
    // Renormalised: rounding errors of many moves would add up.
    let rotation = UnitQuaternion::new_normalize(rotation.into_inner());
    Isometry3::from_parts(Translation3::from(translation), rotation)
}

/// The move from `origin` to `pose`.
pub(crate) fn difference(pose: &Isometry3<f64>, origin: &Isometry3<f64>) -> SVector<f64, POSE> {
    let turn = (pose.rotation * origin.rotation.inverse()).scaled_axis();
    let shift = pose.translation.vector - origin.translation.vector;
    SVector::from([turn.x, turn.y, turn.z, shift.x, shift.y, shift.z])
}

/// The derivative of `pose * point` by the move of `pose`; `turned` is the rotated point without the translation.
pub(crate) fn point_by_move(turned: &Vector3<f64>) -> SMatrix<f64, 3, POSE> {
    let mut derivative = SMatrix::<f64, 3, POSE>::zeros();
    derivative.fixed_view_mut::<3, 3>(0, 0).copy_from(&-turned.cross_matrix());
    derivative.fixed_view_mut::<3, 3>(0, 3).copy_from(&Matrix3::identity());
    derivative
}
