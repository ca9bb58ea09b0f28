//! A `.cameramodel` of mrcal for each camera. mrcal has no polynomial fisheye model: a splined stereographic one is fitted.

use nalgebra::Vector3;
use vergence_vision::{Camera, ImageSize, KannalaBrandt, UnitRay};

use super::spline_fit::{SplineFit, fit_spline};
use super::{Cameras, WrittenFile, each};
use crate::ExchangeError;
use crate::pose::METRE;

pub fn write(cameras: &Cameras, remarks: &mut Vec<String>) -> Result<Vec<WrittenFile>, ExchangeError> {
    let fail = |side: &'static str| move |fit| ExchangeError::Fit { camera: side.to_owned(), fit };
    let left = fit_spline(&cameras.left).map_err(fail("left"))?;
    let right = cameras.right.as_ref().map(|(lens, _)| fit_spline(lens)).transpose().map_err(fail("right"))?;
    for (side, fit) in [("left", Some(&left)), ("right", right.as_ref())] {
        remarks.extend(fit.map(|fit| {
            format!(
                "The splined model of the {side} lens is up to {:.5} px off it, {:.5} px rms.",
                fit.largest_px, fit.rms_px
            )
        }));
    }
    let fits = [Some(&left), right.as_ref()];
    Ok(each(cameras, |index, lens| fits[index].map(|fit| model(cameras, index, lens, fit)).unwrap_or_default()))
}

fn model(cameras: &Cameras, index: usize, lens: &KannalaBrandt, fit: &SplineFit) -> String {
    let grid = &fit.model.grid;
    let numbers: Vec<f64> = fit.model.pinhole.into_iter().chain(fit.model.control.iter().copied().flatten()).collect();
    // The reference frame is that of the left camera.
    let pose = cameras.right.as_ref().filter(|_| index == 1).map(|(_, pose)| pose.inverse());
    let extrinsics = pose.map_or([0.0; 6], |right_from_left| {
        let (turn, metres) = (right_from_left.rotation().scaled_axis(), right_from_left.origin().mm() / METRE);
        [turn.x, turn.y, turn.z, metres.x, metres.y, metres.z]
    });
    let ImageSize { width, height } = lens.size();
    format!(
        "{{\n    'lensmodel':  'LENSMODEL_SPLINED_STEREOGRAPHIC_order={}_Nx={}_Ny={}_fov_x_deg={:.0}',\n    \
         'intrinsics': {numbers:?},\n    'extrinsics': {extrinsics:?},\n    'imagersize': [ {width}, {height} ],\n    'valid_intrinsics_region': {:?}\n}}\n",
        grid.order,
        grid.columns,
        grid.rows,
        grid.field_deg,
        outline(lens)
    )
}

/// A closed polygon around the part of the image that the lens shows. Beyond it the control points say nothing.
fn outline(lens: &KannalaBrandt) -> Vec<[f64; 2]> {
    const CORNERS: u32 = 144;
    let corner = |index: u32| {
        let phi = std::f64::consts::TAU * f64::from(index % CORNERS) / f64::from(CORNERS);
        let pixel = |theta: f64| {
            let ray =
                UnitRay::<Camera>::new(Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()))?;
            lens.project(&ray).ok().filter(|pixel| lens.on_sensor(*pixel))
        };
        let (mut low, mut high) = (0.0, lens.theta_max().rad());
        for _ in 0..40 {
            let middle = 0.5 * (low + high);
            if pixel(middle).is_some() { low = middle } else { high = middle }
        }
        pixel(low).map(|pixel| [pixel.u, pixel.v])
    };
    (0..=CORNERS).filter_map(corner).collect()
}
