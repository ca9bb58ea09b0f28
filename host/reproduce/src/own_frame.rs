//! The frame of a lens whose elements are not where they belong.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use vergence_rig::even_directions;
use vergence_scene::Lens;
use vergence_vision::{Camera, KannalaBrandt, Pixel, Point};

/// How the frame that a calibration gives a lens is turned against the frame of its barrel, by light from all over its field:
/// `found = turn * barrel`.
///
/// A lens with displaced elements has no axis, and nobody sees its barrel in images: a turn of the frame by some thousandths of a radian looks
/// like another centre of the image with other decentring and thin prism. A calibration settles on one of these frames, and all that it says
/// is in that one. Distances between points do not depend on it.
#[must_use]
pub fn own_frame(found: &KannalaBrandt, truth: &dyn Lens) -> UnitQuaternion<f64> {
    own_frame_by(found, &|at| truth.image_of(&Point::from_mm(*at)))
}

/// [`own_frame`] of a lens that is given by where it images a place in its frame, in millimetres.
#[must_use]
pub fn own_frame_by(found: &KannalaBrandt, image_of: &dyn Fn(&Vector3<f64>) -> Option<Pixel>) -> UnitQuaternion<f64> {
    /// So far away that a pupil's shift is nothing.
    const FAR_MM: f64 = 1e7;
    let mut products = Matrix3::zeros();
    for direction in even_directions(found) {
        let truth = direction.vector();
        let ours = image_of(&(FAR_MM * truth)).and_then(|pixel| found.unproject::<Camera>(pixel).ok());
        products += ours.map_or_else(Matrix3::zeros, |ours| ours.vector() * truth.transpose());
    }
    UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix(&products))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::panic, reason = "a test may fail")]

    use vergence_lens::Displacement;
    use vergence_rig::{BENCH_TOML, Rig};
    use vergence_scene::TrueLens;
    use vergence_vision::{Angle, Length, OpenCvFisheye};

    use super::*;

    /// A centre that is off by 3 of some 600 pixels to the radian looks like a turn of 5 thousandths.
    #[test]
    fn a_shifted_image_is_a_turned_frame() {
        let lens = Rig::from_toml(BENCH_TOML).unwrap().left_camera;
        assert!(own_frame(&lens, &TrueLens::Ideal(lens)).angle() < 1e-12);
        let central = lens.to_opencv();
        let shifted = OpenCvFisheye { cx: central.cx + 3.0, ..central };
        let shifted = KannalaBrandt::from_opencv(shifted, lens.theta_max(), lens.size()).unwrap();
        let turn = own_frame(&shifted, &TrueLens::Ideal(lens)).scaled_axis();
        let expected = -3.0 / central.fx;
        assert!((0.5..1.5).contains(&(turn.y / expected)) && turn.x.abs() < 1e-5, "{turn:?} {expected}");
        // Displaced elements turn a frame, by less than a degree.
        let TrueLens::Traced(traced) = crate::TRUE_LENS.in_place_of(&lens).unwrap() else { panic!("it is traced") };
        let by = Displacement {
            decentre: Length::from_mm(0.01),
            tilt: Angle::from_deg(0.05),
            sensor_tilt: Angle::from_deg(0.0),
            seed: 3,
        };
        let displaced = TrueLens::Traced(traced.displaced(&by).unwrap());
        let turned = own_frame(&lens, &displaced).angle();
        assert!((1e-3..1e-2).contains(&turned), "{turned}");
    }
}
