//! Kalibr's camchain. Its translations are in metres, and `T_cn_cnm1` maps the frame of the camera before to that of this one.

use vergence_vision::{Base, Camera, CameraModel, DoubleSphere, Eucm, ImageSize, Mei, Pinhole, Radtan, Transform};

use crate::node::{Node, parse};
use crate::rig::Place;
use crate::{ExchangeError, ForeignCamera, Format, pose};

/// Reads all cameras of a chain.
pub fn read(text: &str) -> Result<Vec<ForeignCamera>, ExchangeError> {
    let root = parse(Format::Kalibr, text)?;
    let names: Vec<_> = (0..root.keys().len()).map(|index| format!("cam{index}")).collect();
    let nodes: Vec<_> = names.iter().map_while(|name| root.get(&[name])).collect();
    if let Some(lost) = root.keys().iter().find(|key| is_camera(key) && !names[..nodes.len()].contains(key)) {
        return Err(root.wrong(format!("has {lost}, but not all cameras before it")));
    }
    let places = places(&nodes)?;
    let camera = |((name, node), place): ((&String, &Node), Option<_>)| {
        let size = node.need(&["resolution"])?.size()?;
        Ok(ForeignCamera::new(name, model(node, name, size)?, size).at(place))
    };
    names.iter().zip(&nodes).zip(places).map(camera).collect()
}

fn is_camera(key: &str) -> bool {
    key.strip_prefix("cam").is_some_and(|number| number.parse::<usize>().is_ok())
}

/// Where the cameras are relative to the first by the chain, or relative to the IMU where a link of the chain is missing.
fn places(nodes: &[Node]) -> Result<Vec<Option<Transform<Base, Camera>>>, ExchangeError> {
    if nodes.len() > 1 && nodes.iter().skip(1).all(|node| node.get(&["T_cn_cnm1"]).is_some()) {
        let mut here = Transform::<Base, Camera>::from_isometry(nalgebra::Isometry3::identity());
        let mut places = vec![Some(here)];
        for node in nodes.iter().skip(1) {
            let from_previous: Transform<Camera, Camera> = pose::of_matrix(&node.need(&["T_cn_cnm1"])?)?;
            here = here * from_previous.inverse();
            places.push(Some(here));
        }
        return Ok(places);
    }
    let by_imu = |node: &Node| {
        let camera_from_imu = node.get(&["T_cam_imu"]).map(|matrix| pose::of_matrix::<Camera, Base>(&matrix));
        camera_from_imu.transpose().map(|pose| pose.map(|pose| pose.inverse()))
    };
    nodes.iter().map(by_imu).collect()
}

fn model(node: &Node, name: &str, size: ImageSize) -> Result<Box<dyn CameraModel>, ExchangeError> {
    let place = Place { format: Format::Kalibr, camera: name };
    let camera = node.need(&["camera_model"])?.text()?;
    let distortion = node.get(&["distortion_model"]).map_or(Ok("none".to_owned()), |node| node.text())?;
    let coefficients = node.get(&["distortion_coeffs"]).map_or(Ok(Vec::new()), |node| node.numbers())?;
    let intrinsics = node.need(&["intrinsics"])?;
    let limit = node.get(&["theta_max_deg"]).map(|node| node.number()).transpose()?;
    let radtan = || match (distortion.as_str(), coefficients.len()) {
        ("none", 0) | ("radtan", 4) => Radtan::new(&coefficients).ok_or_else(|| node.wrong("has no distortion")),
        _ => Err(node.wrong(format!("has {} coefficients for the distortion '{distortion}'", coefficients.len()))),
    };
    match (camera.as_str(), distortion.as_str()) {
        ("pinhole", "equidistant") => {
            let k = node.need(&["distortion_coeffs"])?.array()?;
            place.fisheye(intrinsics.array()?, k, size, limit)
        }
        ("pinhole", "radtan" | "none") => {
            place.central(Pinhole { pinhole: intrinsics.array()?, distortion: radtan()? })
        }
        ("omni", "radtan" | "none") => {
            let [xi, pinhole @ ..] = intrinsics.array::<5>()?;
            place.central(Mei { pinhole, skew: 0.0, xi, distortion: radtan()? })
        }
        ("ds", "none") => {
            let [xi, alpha, pinhole @ ..] = intrinsics.array::<6>()?;
            place.central(DoubleSphere { pinhole, xi, alpha })
        }
        ("eucm", "none") => {
            let [alpha, beta, pinhole @ ..] = intrinsics.array::<6>()?;
            place.central(Eucm { pinhole, alpha, beta })
        }
        _ => Err(node.wrong(format!(
            "has the model {camera}-{distortion}, which is not read: pinhole-equidistant, pinhole-radtan, omni-radtan, ds-none and \
             eucm-none are, and pinhole or omni without distortion"
        ))),
    }
}
