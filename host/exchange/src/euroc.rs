//! The `sensor.yaml` of one camera in the data sets EuRoC and TUM-VI. `T_BS` is where the camera is in the frame of the body, in metres.

use vergence_vision::{CameraModel, ImageSize, Pinhole, Radtan};

use crate::node::{Node, parse};
use crate::rig::Place;
use crate::{ExchangeError, ForeignCamera, Format, pose};

/// Reads the camera.
pub fn read(text: &str) -> Result<Vec<ForeignCamera>, ExchangeError> {
    let root = parse(Format::Euroc, text)?;
    let kind = root.get(&["sensor_type"]).map_or(Ok("camera".to_owned()), |node| node.text())?;
    if kind != "camera" {
        return Err(root.wrong(format!("is of a sensor '{kind}': name that of a camera")));
    }
    let size = root.need(&["resolution"])?.size()?;
    let place = root.get(&["T_BS"]).map(|matrix| pose::of_matrix(&matrix)).transpose()?;
    Ok(vec![ForeignCamera::new("camera", model(&root, size)?, size).at(place)])
}

fn model(root: &Node, size: ImageSize) -> Result<Box<dyn CameraModel>, ExchangeError> {
    let place = Place { format: Format::Euroc, camera: "camera" };
    let camera = root.need(&["camera_model"])?.text()?;
    let distortion = root.need(&["distortion_model"])?.text()?;
    let pinhole = root.need(&["intrinsics"])?.array()?;
    let coefficients = root.need(&["distortion_coefficients"])?;
    match (camera.as_str(), distortion.as_str()) {
        ("pinhole", "equidistant") => {
            // A key of this program: other files do not say up to which angle the polynomial is good.
            let limit = root.get(&["theta_max_deg"]).map(|node| node.number()).transpose()?;
            place.fisheye(pinhole, coefficients.array()?, size, limit)
        }
        ("pinhole", "radial-tangential" | "radtan") => {
            let distortion = Radtan::new(&coefficients.array::<4>()?).ok_or_else(|| root.wrong("has no distortion"))?;
            place.central(Pinhole { pinhole, distortion })
        }
        _ => Err(root.wrong(format!(
            "has the model {camera}, {distortion}, which is not read: pinhole, radial-tangential and pinhole, equidistant are"
        ))),
    }
}
