//! The `sensor.yaml` of a camera in folders as those of the data sets EuRoC and TUM-VI.

use nalgebra::Isometry3;
use vergence_vision::{ImageSize, KannalaBrandt, OpenCvFisheye, VirtualView};

use super::{Cameras, WrittenFile, each};
use crate::pose::METRE;

/// A `sensor.yaml`: plain YAML, with the keys of EuRoC in their order, and `theta_max_deg` where the lens is a fisheye one.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    comment: String,
    body_from_camera: Option<Isometry3<f64>>,
    size: ImageSize,
    intrinsics: [f64; 4],
    distortion: &'static str,
    coefficients: [f64; 4],
    theta_max_deg: Option<f64>,
}

impl Sensor {
    /// A fisheye camera, as in TUM-VI: the model `equidistant`, which is that of Kannala and Brandt with four coefficients. Of a lens that is more than
    /// that ([`KannalaBrandt::fits_opencv`]) only this part is written, with the radius that comes nearest.
    #[must_use]
    pub fn fisheye(lens: &KannalaBrandt) -> Self {
        let OpenCvFisheye { fx, fy, cx, cy, k } = lens.nearest_opencv();
        let theta_max_deg = Some(lens.theta_max().deg());
        Self { theta_max_deg, ..Self::new(lens.size(), [fx, fy, cx, cy], ("equidistant", k)) }
    }

    /// A pinhole camera without distortion, as in EuRoC: the model `radial-tangential` with zeros.
    #[must_use]
    pub fn pinhole(view: &VirtualView) -> Self {
        let (focal, centre) = (view.focal(), view.centre());
        Self::new(view.size(), [focal, focal, centre.u, centre.v], ("radial-tangential", [0.0; 4]))
    }

    const fn new(size: ImageSize, intrinsics: [f64; 4], (distortion, coefficients): (&'static str, [f64; 4])) -> Self {
        Self {
            comment: String::new(),
            body_from_camera: None,
            size,
            intrinsics,
            distortion,
            coefficients,
            theta_max_deg: None,
        }
    }

    /// The same with a comment on one line.
    #[must_use]
    pub fn with_comment(self, comment: String) -> Self {
        Self { comment, ..self }
    }

    /// The same with `T_BS`: where the camera is in the body, which is the left camera, with millimetres; `None` where that is not known.
    #[must_use]
    pub fn at(self, body_from_camera: Option<Isometry3<f64>>) -> Self {
        Self { body_from_camera, ..self }
    }

    /// The text of the file.
    #[must_use]
    pub fn text(&self) -> String {
        let Self { comment, size: ImageSize { width, height }, intrinsics, distortion, coefficients, .. } = self;
        let mut text = format!("sensor_type: camera\ncomment: {comment:?}\n");
        if let Some(pose) = &self.body_from_camera {
            let mut rows = pose.to_homogeneous().transpose();
            (0..3).for_each(|row| rows[(3, row)] /= METRE);
            let rows: Vec<_> = rows.as_slice().chunks(4).map(|row| format!("{row:?}")).collect();
            let rows = rows.join(",\n").replace('[', "         ").replace(']', "");
            text += &format!("T_BS:\n  cols: 4\n  rows: 4\n  data: [{}]\n", rows.trim_start());
        }
        text += &format!(
            "resolution: [{width}, {height}]\ncamera_model: pinhole\nintrinsics: {intrinsics:?}\n\
             distortion_model: {distortion}\ndistortion_coefficients: {coefficients:?}\n"
        );
        text + &self.theta_max_deg.map(|deg| format!("theta_max_deg: {deg:?}\n")).unwrap_or_default()
    }
}

/// The files of both cameras as those of TUM-VI; the body is the left camera.
pub fn write(cameras: &Cameras) -> Vec<WrittenFile> {
    each(cameras, |index, lens| {
        // A camera alone says nothing of where it is.
        let pose = cameras.right.as_ref().map(|(_, left_from_right)| match index {
            0 => Isometry3::identity(),
            _ => *left_from_right.isometry(),
        });
        let comment = "fisheye: a program must know the model equidistant beyond 90 degrees".to_owned();
        Sensor::fisheye(lens).with_comment(comment).at(pose).text()
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test may fail")]

    use nalgebra::{UnitQuaternion, Vector3};
    use vergence_vision::{Angle, Face, Left, Length, Pixel, Right, Transform};

    use super::*;
    use crate::Format;

    #[test]
    fn what_is_written_is_read_back() {
        let size = ImageSize { width: 640, height: 480 };
        let k = [180.25, -3.5, 0.25, -0.125, 0.0625];
        let lens = KannalaBrandt::new(k, 1.0, Pixel { u: 320.5, v: 239.25 }, Angle::from_deg(98.0), size);
        let lens = lens.expect("a lens");
        let pose = Transform::new(UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3), Vector3::new(145.5, 1.0, -2.0));
        let files = write(&Cameras { left: lens, right: Some((lens, pose)) });
        let rigs = files.iter().map(|file| crate::read(&file.text).expect("it is read")).collect::<Vec<_>>();
        assert!(rigs.iter().all(|rig| rig.format == Format::Euroc));
        let read = rigs[1].cameras[0].lens().expect("a lens");
        let difference = lens.largest_difference(&read.lens, Length::from_mm(1e6));
        assert!(difference < 1e-9 && (read.lens.theta_max().deg() - 98.0).abs() < 1e-9, "{difference} px");
        let places = [0, 1].map(|index| rigs[index].cameras[0].base_from_camera.expect("a place"));
        let read: Transform<Left, Right> = (places[0].inverse() * places[1]).renamed();
        assert!((read.origin().mm() - pose.origin().mm()).norm() < 1e-9);
        assert!(read.rotation().angle_to(&pose.rotation()) < 1e-9);
    }

    #[test]
    fn a_view_is_a_pinhole_without_distortion() {
        let view = VirtualView::new(Face::Front.camera_from_view(), Angle::from_deg(90.0), 512).expect("a view");
        let text = Sensor::pinhole(&view).text();
        assert!(text.contains("intrinsics: [256.0") && text.contains("radial-tangential\n"), "{text}");
        assert!(!text.contains("T_BS"), "{text}");
        assert_eq!(crate::read(&text).expect("it is read").cameras.len(), 1);
    }
}
