//! Uncertainty of the ray behind a pixel, from the covariance of the lens.

use nalgebra::{Matrix2, Matrix3x2, SMatrix, Vector3};
use vergence_rig::common_turn_by_lens;
use vergence_vision::{Angle, Camera, KannalaBrandt, OutsideField, Pixel, UnitRay};

use crate::IntrinsicsCalibration;
use crate::intrinsics::LENS;

/// Uncertainty of rays over the field of a lens.
///
/// The error of a lens has two parts. A common rotation of all rays shows in the standard deviation of the principal
/// point but is harmless: the poses of whatever is measured absorb it. The rest does harm and is what this type states.
/// D. Kogan, mrcal, "projection uncertainty", removes the rotation for the same reason. Here the rotation removed is
/// the one that best aligns all rays of the valid cone, every direction weighted alike, independent of the distances of
/// the targets.
#[derive(Clone, Debug, PartialEq)]
pub struct RayUncertainty {
    camera: KannalaBrandt,
    covariance: SMatrix<f64, LENS, LENS>,
    /// Common rotation (radians about the camera's axes) per change of each lens parameter.
    rotation_by_lens: SMatrix<f64, 3, LENS>,
}

/// A ray and its covariance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayCovariance {
    /// The ray.
    pub ray: UnitRay<Camera>,
    /// Unit vectors orthogonal to the ray: away from the optical axis, and around it (in the direction from x to y). On
    /// the axis x and y.
    pub tangents: [Vector3<f64>; 2],
    /// Covariance of the ray's direction along `tangents`, in rad².
    pub covariance: Matrix2<f64>,
}

impl RayCovariance {
    /// Standard deviation along the worst direction.
    #[must_use]
    pub fn sigma(&self) -> Angle {
        Angle::from_rad(self.covariance.symmetric_eigenvalues().max().max(0.0).sqrt())
    }
}

/// One point of a map of ray uncertainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MapPoint {
    /// Position in the image.
    pub pixel: Pixel,
    /// The ray there; `None` outside the valid cone.
    pub ray: Option<RayCovariance>,
}

impl RayUncertainty {
    /// The ray uncertainty of a calibrated lens.
    #[must_use]
    pub fn of(calibration: &IntrinsicsCalibration) -> Self {
        let camera = calibration.camera;
        Self { camera, covariance: calibration.covariance, rotation_by_lens: common_turn_by_lens(&camera) }
    }

    /// Ray at `pixel`, its covariance without the rotation common to all rays.
    ///
    /// # Errors
    /// [`OutsideField`] outside the valid cone.
    pub fn at(&self, pixel: Pixel) -> Result<RayCovariance, OutsideField> {
        self.with(pixel, &self.rotation_by_lens)
    }

    /// Ray at `pixel`, its covariance including the rotation common to all rays: for a camera whose pose was fixed
    /// before and will not be estimated again.
    ///
    /// # Errors
    /// [`OutsideField`] outside the valid cone.
    pub fn at_with_rotation(&self, pixel: Pixel) -> Result<RayCovariance, OutsideField> {
        self.with(pixel, &SMatrix::zeros())
    }

    /// [`Self::at`] on a grid of `columns` × `rows` points over the image, borders included, row by row.
    #[must_use]
    pub fn map(&self, columns: u32, rows: u32) -> Vec<MapPoint> {
        let size = self.camera.size();
        let at = |i: u32, n: u32, length: u32| f64::from(i) / f64::from(n.max(2) - 1) * (f64::from(length) - 1.0);
        let pixels = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
        pixels
            .map(|(column, row)| {
                let pixel = Pixel { u: at(column, columns, size.width), v: at(row, rows, size.height) };
                MapPoint { pixel, ray: self.at(pixel).ok() }
            })
            .collect()
    }

    fn with(&self, pixel: Pixel, rotation: &SMatrix<f64, 3, LENS>) -> Result<RayCovariance, OutsideField> {
        let ray = self.camera.unproject::<Camera>(pixel)?;
        let basis = tangents(&ray.vector());
        let by_lens = self.ray_by_lens(&ray);
        let left = basis.transpose() * (by_lens - ray.vector().cross_matrix() * rotation);
        let tangents = [basis.column(0).into_owned(), basis.column(1).into_owned()];
        Ok(RayCovariance { ray, tangents, covariance: left * self.covariance * left.transpose() })
    }

    /// Derivative of the direction of the ray behind a fixed pixel with respect to the lens, from ∂u/∂d δd + ∂u/∂lens δlens = 0.
    fn ray_by_lens(&self, ray: &UnitRay<Camera>) -> SMatrix<f64, 3, LENS> {
        -(self.camera.ray_by_pixel(ray) * self.camera.pixel_by_lens(ray))
    }
}

/// Columns: away from the optical axis, and around it.
fn tangents(ray: &Vector3<f64>) -> Matrix3x2<f64> {
    let rho = ray.x.hypot(ray.y);
    let (cos, sin) = if rho > 0.0 { (ray.x / rho, ray.y / rho) } else { (1.0, 0.0) };
    Matrix3x2::from_columns(&[Vector3::new(ray.z * cos, ray.z * sin, -rho), Vector3::new(-sin, cos, 0.0)])
}
