//! Basalt's calibration: JSON with one `value0`. `T_imu_cam` is where each camera is in the frame of the IMU, in metres.

use nalgebra::Vector3;
use vergence_vision::{Base, Camera, CameraModel, DoubleSphere, Eucm, ImageSize, Pinhole, Radtan, Transform};

use crate::node::{Node, parse};
use crate::rig::Place;
use crate::{ExchangeError, ForeignCamera, Format, pose};

const PINHOLE: [&str; 4] = ["fx", "fy", "cx", "cy"];

/// Reads all cameras.
pub fn read(text: &str) -> Result<Vec<ForeignCamera>, ExchangeError> {
    let root = parse(Format::Basalt, text)?.need(&["value0"])?;
    let list = |key| root.need(&[key])?.entries();
    let (models, poses, sizes) = (list("intrinsics")?, list("T_imu_cam")?, list("resolution")?);
    if models.len() != poses.len() || models.len() != sizes.len() {
        let counts = format!("{} intrinsics, {} T_imu_cam, {} resolution", models.len(), poses.len(), sizes.len());
        return Err(root.wrong(format!("says {counts}: it must say the same number of each")));
    }
    let camera = |(index, ((model, pose), size)): (usize, ((&Node, &Node), &Node))| {
        let (name, size) = (format!("cam{index}"), size.size()?);
        let model = self::model(model, &name, size)?;
        Ok(ForeignCamera::new(name, model, size).at(Some(place(pose)?)))
    };
    models.iter().zip(&poses).zip(&sizes).enumerate().map(camera).collect()
}

fn place(node: &Node) -> Result<Transform<Base, Camera>, ExchangeError> {
    let rotation = pose::quaternion(node, node.fields(["qw", "qx", "qy", "qz"])?)?;
    let metres = Vector3::from(node.fields(["px", "py", "pz"])?);
    Ok(Transform::new(rotation, metres * pose::METRE))
}

fn model(node: &Node, name: &str, size: ImageSize) -> Result<Box<dyn CameraModel>, ExchangeError> {
    let place = Place { format: Format::Basalt, camera: name };
    let kind = node.need(&["camera_type"])?.text()?;
    let values = node.need(&["intrinsics"])?;
    let pinhole = values.fields(PINHOLE)?;
    match kind.as_str() {
        "kb4" => place.fisheye(pinhole, values.fields(["k1", "k2", "k3", "k4"])?, size, None),
        "ds" => {
            let [xi, alpha] = values.fields(["xi", "alpha"])?;
            place.central(DoubleSphere { pinhole, xi, alpha })
        }
        "eucm" => {
            let [alpha, beta] = values.fields(["alpha", "beta"])?;
            place.central(Eucm { pinhole, alpha, beta })
        }
        "ucm" => {
            let [alpha] = values.fields(["alpha"])?;
            place.central(Eucm { pinhole, alpha, beta: 1.0 })
        }
        "pinhole" | "pinhole-radtan8" => {
            let keys = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];
            let coefficients = if kind == "pinhole" { Vec::new() } else { values.fields(keys)?.to_vec() };
            let distortion = Radtan::new(&coefficients).ok_or_else(|| node.wrong("has no distortion"))?;
            place.central(Pinhole { pinhole, distortion })
        }
        _ => Err(node.wrong(format!(
            "has the camera_type '{kind}', which is not read: kb4, ds, eucm, ucm, pinhole and pinhole-radtan8 are"
        ))),
    }
}
