//! One step of a fit of a lens to the pixels of known rays.

use nalgebra::{SMatrix, SVector, Vector2};

use crate::lens_derivatives::CENTRAL_PARAMETERS;
use crate::{Camera, KannalaBrandt, OpenCvFisheye, UnitRay};

/// The Gauss-Newton step of the parameters `columns`, by their indices in [`crate::LENS_PARAMETER_NAMES`], for rays with what the pixel by `lens`
/// is short of. `None` where the rays do not determine it.
pub(crate) fn lens_step<const N: usize>(
    lens: &KannalaBrandt,
    columns: &[usize; N],
    missing: impl IntoIterator<Item = (UnitRay<Camera>, Vector2<f64>)>,
) -> Option<SVector<f64, N>> {
    let (mut normal, mut right) = (SMatrix::<f64, N, N>::zeros(), SVector::<f64, N>::zeros());
    for (ray, missing) in missing {
        let by_all = lens.pixel_by_lens(&ray);
        let by_lens = SMatrix::<f64, 2, N>::from_fn(|row, column| by_all[(row, columns[column])]);
        normal += by_lens.transpose() * by_lens;
        right += by_lens.transpose() * missing;
    }
    // Scaled to unit diagonal: the parameters differ by many orders of magnitude.
    let scale = normal.diagonal().map(|value| 1.0 / value.sqrt());
    let scaled = SMatrix::<f64, N, N>::from_fn(|i, k| scale[i] * normal[(i, k)] * scale[k]);
    Some(scaled.cholesky()?.solve(&right.component_mul(&scale)).component_mul(&scale))
}

impl OpenCvFisheye {
    /// These parameters changed by the first eight of a step.
    pub(crate) fn stepped(&self, step: &[f64]) -> Self {
        let [dfx, dfy, dcx, dcy, changes @ ..]: [f64; CENTRAL_PARAMETERS] = std::array::from_fn(|i| step[i]);
        let k = std::array::from_fn(|i| self.k[i] + changes[i]);
        Self { fx: self.fx + dfx, fy: self.fy + dfy, cx: self.cx + dcx, cy: self.cy + dcy, k }
    }
}
