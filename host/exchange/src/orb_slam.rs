//! The settings of ORB-SLAM3, in the form of version 1.0 and the one before. `Stereo.T_c1_c2` and `Tlr` are where the right camera is in the
//! frame of the left one, in metres.

use vergence_vision::{Base, Camera, CameraModel, ImageSize, Pinhole, Radtan, Transform};

use crate::node::{Node, parse};
use crate::rig::Place;
use crate::{ExchangeError, ForeignCamera, Format, pose};

/// Reads one camera or a pair.
pub fn read(text: &str) -> Result<Vec<ForeignCamera>, ExchangeError> {
    let root = parse(Format::OrbSlam, text)?;
    let side = |keys: &[&str]| root.need(keys)?.number();
    let size = root.image_size(side(&["Camera.width"])?, side(&["Camera.height"])?)?;
    let first = if root.get(&["Camera1.fx"]).is_some() { "Camera1" } else { "Camera" };
    let left = ForeignCamera::new(first, model(&root, first, size)?, size);
    if root.get(&["Camera2.fx"]).is_none() {
        return Ok(vec![left]);
    }
    let left_from_right =
        root.get(&["Stereo.T_c1_c2", "Tlr"]).map(|node| pose::of_matrix::<Base, Camera>(&node)).transpose()?;
    let here = left_from_right.map(|_| Transform::from_isometry(nalgebra::Isometry3::identity()));
    let right = ForeignCamera::new("Camera2", model(&root, "Camera2", size)?, size);
    Ok(vec![left.at(here), right.at(left_from_right)])
}

fn model(root: &Node, name: &str, size: ImageSize) -> Result<Box<dyn CameraModel>, ExchangeError> {
    let place = Place { format: Format::OrbSlam, camera: name };
    let number = |key: &str| root.need(&[&format!("{name}.{key}")])?.number();
    let optional = |key: &str| root.get(&[&format!("{name}.{key}")]).map_or(Ok(0.0), |node| node.number());
    let pinhole = [number("fx")?, number("fy")?, number("cx")?, number("cy")?];
    let kind = root.need(&["Camera.type"])?.text()?;
    match kind.as_str() {
        "KannalaBrandt8" => {
            place.fisheye(pinhole, [number("k1")?, number("k2")?, number("k3")?, number("k4")?], size, None)
        }
        "PinHole" => {
            let keys = ["k1", "k2", "p1", "p2", "k3"];
            let coefficients = keys.iter().map(|key| optional(key)).collect::<Result<Vec<_>, _>>()?;
            let distortion = Radtan::new(&coefficients).ok_or_else(|| root.wrong("has no distortion"))?;
            place.central(Pinhole { pinhole, distortion })
        }
        _ => {
            Err(root.wrong(format!("has the Camera.type '{kind}', which is not read: PinHole and KannalaBrandt8 are")))
        }
    }
}
