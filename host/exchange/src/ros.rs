//! A `camera_info` of ROS, as `camera_calibration` writes it or as a topic is echoed. Its rectified pair is in metres.

use nalgebra::{Matrix3, Vector3};
use vergence_vision::{Base, Camera, CameraModel, ImageSize, Pinhole, Radtan, Transform};

use crate::node::{Node, parse};
use crate::rig::Place;
use crate::{ExchangeError, ForeignCamera, Format, pose};

/// Reads the camera.
pub fn read(text: &str) -> Result<Vec<ForeignCamera>, ExchangeError> {
    let root = parse(Format::Ros, text)?;
    let side = |keys: &[&str]| root.need(keys)?.number();
    let size = root.image_size(side(&["image_width", "width"])?, side(&["image_height", "height"])?)?;
    let name = root.get(&["camera_name"]).map_or(Ok("camera".to_owned()), |node| node.text())?;
    let model = model(&root, &name, size)?;
    Ok(vec![ForeignCamera::new(name, model, size).at(place(&root)?)])
}

fn model(root: &Node, name: &str, size: ImageSize) -> Result<Box<dyn CameraModel>, ExchangeError> {
    let place = Place { format: Format::Ros, camera: name };
    let matrix = root.need(&["camera_matrix", "K", "k"])?;
    let [fx, skew, cx, _, fy, cy, ..] = matrix.array::<9>()?;
    if fx == 0.0 {
        return Err(matrix.wrong("is zero: the camera was not calibrated"));
    }
    if skew != 0.0 {
        return Err(matrix.wrong(format!("has a skew of {skew}, which ROS does not know")));
    }
    let distortion = root.need(&["distortion_model"])?.text()?;
    let coefficients = root.need(&["distortion_coefficients", "D", "d"])?;
    let pinhole = [fx, fy, cx, cy];
    match distortion.as_str() {
        "equidistant" | "fisheye" => place.fisheye(pinhole, coefficients.array()?, size, None),
        "plumb_bob" | "rational_polynomial" => {
            let numbers = coefficients.numbers()?;
            let distortion = Radtan::new(&numbers)
                .ok_or_else(|| coefficients.wrong(format!("has {} numbers, not 4, 5, 8, 12 or 14", numbers.len())))?;
            place.central(Pinhole { pinhole, distortion })
        }
        _ => Err(root.wrong(format!(
            "has the distortion_model '{distortion}', which is not read: plumb_bob, rational_polynomial and equidistant are"
        ))),
    }
}

/// Where the camera is in the frame of the rectified left camera: turned by the rectification, and beside it by the baseline in P.
fn place(root: &Node) -> Result<Option<Transform<Base, Camera>>, ExchangeError> {
    let (Some(turn), Some(projection)) =
        (root.get(&["rectification_matrix", "R", "r"]), root.get(&["projection_matrix", "P", "p"]))
    else {
        return Ok(None);
    };
    let [fx, _, _, along, ..] = projection.array::<12>()?;
    if fx == 0.0 {
        return Ok(None);
    }
    let rotation = pose::rotation(&turn, Matrix3::from_row_slice(&turn.array::<9>()?))?;
    Ok(Some(Transform::new(rotation, Vector3::new(-along / fx, 0.0, 0.0) * pose::METRE)))
}
