//! OpenCV's FileStorage YAML of one camera, or of a pair. Its lists of coefficients do not tell every model from another: the file must.

use nalgebra::{Matrix3, Vector3};
use vergence_vision::{Base, Camera, CameraModel, ImageSize, Mei, Pinhole, Radtan, Transform};

use crate::node::{Node, parse};
use crate::rig::Place;
use crate::{ExchangeError, ForeignCamera, Format, pose};

/// The models of OpenCV's modules.
#[derive(Clone, Copy, PartialEq)]
enum Model {
    Pinhole,
    Fisheye,
    Omnidir,
}

/// The keys of one camera. OpenCV fixes none; these are those of its samples and of common tools.
struct Keys {
    name: &'static str,
    matrix: &'static [&'static str],
    distortion: &'static [&'static str],
    xi: &'static [&'static str],
    theta_max: &'static str,
}

const ALONE: Keys = Keys {
    name: "camera",
    matrix: &["camera_matrix", "K", "cameraMatrix", "Camera_Matrix"],
    distortion: &["distortion_coefficients", "D", "dist_coeffs", "distCoeffs", "Distortion_Coefficients"],
    xi: &["xi"],
    theta_max: "theta_max_deg",
};
const LEFT: Keys = Keys {
    name: "left",
    matrix: &["K1", "M1", "cameraMatrix1", "camera_matrix_1"],
    distortion: &["D1", "distCoeffs1", "distortion_coefficients_1"],
    xi: &["xi1"],
    theta_max: "theta_max_deg1",
};
const RIGHT: Keys = Keys {
    name: "right",
    matrix: &["K2", "M2", "cameraMatrix2", "camera_matrix_2"],
    distortion: &["D2", "distCoeffs2", "distortion_coefficients_2"],
    xi: &["xi2"],
    theta_max: "theta_max_deg2",
};

/// Reads one camera, or a pair.
pub fn read(text: &str) -> Result<Vec<ForeignCamera>, ExchangeError> {
    let root = parse(Format::OpenCv, text)?;
    let size = size(&root)?;
    if root.get(LEFT.matrix).is_none() {
        return Ok(vec![ForeignCamera::new(ALONE.name, model(&root, &ALONE, size)?, size)]);
    }
    let right_place = left_from_right(&root)?;
    let left_place = right_place.map(|_| Transform::from_isometry(nalgebra::Isometry3::identity()));
    let camera = |keys: &Keys, place| Ok(ForeignCamera::new(keys.name, model(&root, keys, size)?, size).at(place));
    Ok(vec![camera(&LEFT, left_place)?, camera(&RIGHT, right_place)?])
}

fn size(root: &Node) -> Result<ImageSize, ExchangeError> {
    let sides = [root.get(&["image_width", "image_Width"]), root.get(&["image_height", "image_Height"])];
    if let [Some(width), Some(height)] = sides {
        return root.image_size(width.number()?, height.number()?);
    }
    root.get(&["image_size", "imageSize", "resolution"])
        .ok_or_else(|| {
            root.wrong("does not say the size of images: add the lines 'image_width: 960' and 'image_height: 600'")
        })?
        .size()
}

fn model(root: &Node, keys: &Keys, size: ImageSize) -> Result<Box<dyn CameraModel>, ExchangeError> {
    let place = Place { format: Format::OpenCv, camera: keys.name };
    let matrix = root.need(keys.matrix)?;
    let [fx, skew, cx, below, fy, cy, rest @ ..] = matrix.array::<9>()?;
    if below != 0.0 || rest != [0.0, 0.0, 1.0] {
        return Err(matrix.wrong("is no camera matrix: fx s cx, 0 fy cy, 0 0 1"));
    }
    let distortion = root.get(keys.distortion).map_or(Ok(Vec::new()), |node| node.numbers())?;
    let xi = root.get(keys.xi).map(|node| node.array::<1>().or_else(|_| Ok([node.number()?]))).transpose()?;
    let model = kind(root, xi.is_some(), distortion.len())?;
    if skew != 0.0 && model != Model::Omnidir {
        return Err(matrix.wrong(format!("has a skew of {skew}, which only the model of omnidir has")));
    }
    let pinhole = [fx, fy, cx, cy];
    let count =
        || root.wrong(format!("has {} distortion coefficients, which are not those of its model", distortion.len()));
    match model {
        Model::Fisheye => {
            let k = <[f64; 4]>::try_from(&distortion[..]).map_err(|_| count())?;
            let limit = root.get(&[keys.theta_max]).map(|node| node.number()).transpose()?;
            place.fisheye(pinhole, k, size, limit)
        }
        Model::Pinhole => place.central(Pinhole { pinhole, distortion: Radtan::new(&distortion).ok_or_else(count)? }),
        Model::Omnidir => {
            let [xi] = xi.ok_or_else(|| root.wrong("has no xi, which the model of omnidir needs"))?;
            let distortion = Radtan::new(&distortion).filter(|_| distortion.len() == 4).ok_or_else(count)?;
            place.central(Mei { pinhole, skew, xi, distortion })
        }
    }
}

/// The model that the file states, or that no other has: omnidir alone has ξ, and only the pinhole 5 coefficients or more, or none. Four are
/// those of the fisheye and of the pinhole.
fn kind(root: &Node, has_xi: bool, coefficients: usize) -> Result<Model, ExchangeError> {
    if let Some(stated) = root.get(&["model", "camera_model", "distortion_model", "lens_model"]) {
        let text = stated.text()?.to_lowercase();
        let says = |words: &[&str]| words.iter().any(|word| text.contains(word));
        return if says(&["fisheye", "equidistant", "kannala"]) {
            Ok(Model::Fisheye)
        } else if says(&["omni", "mei"]) {
            Ok(Model::Omnidir)
        } else if says(&["pinhole", "radtan", "plumb_bob", "rational"]) {
            Ok(Model::Pinhole)
        } else {
            Err(stated.wrong(format!("is '{text}', which is not known: say pinhole, fisheye or omnidir")))
        };
    }
    if let Some(flag) = root.get(&["fisheye_model"]) {
        // OpenCV's sample calibration.cpp writes it, as a number.
        let is_fisheye = flag.number().map(|number| number != 0.0).or_else(|_| Ok(flag.text()? == "true"))?;
        return Ok(if is_fisheye { Model::Fisheye } else { Model::Pinhole });
    }
    match (has_xi, coefficients) {
        (true, _) => Ok(Model::Omnidir),
        (false, 4) => Err(root.wrong(
            "has four distortion coefficients and does not say its model: add the line 'model: fisheye' (cv::fisheye) or \
             'model: pinhole' (cv::calibrateCamera)",
        )),
        (false, _) => Ok(Model::Pinhole),
    }
}

/// Where the right camera is. OpenCV's R and T map the left frame to the right one, and T has the unit of the target's squares.
fn left_from_right(root: &Node) -> Result<Option<Transform<Base, Camera>>, ExchangeError> {
    let (Some(turn), Some(shift)) = (root.get(&["R"]), root.get(&["T"])) else { return Ok(None) };
    let unit = root.get(&["translation_unit"]).map_or(Ok(String::new()), |node| node.text())?;
    let mm = match unit.as_str() {
        "mm" => 1.0,
        "cm" => 10.0,
        "m" => pose::METRE,
        _ => {
            return Err(root.wrong(
                "has T in the unit of the squares of a target, and does not say which: add the line 'translation_unit: mm', cm or m",
            ));
        }
    };
    let rotation = pose::rotation(&turn, Matrix3::from_row_slice(&turn.array::<9>()?))?;
    let right_from_left = Transform::<Camera, Base>::new(rotation, Vector3::from(shift.array::<3>()?) * mm);
    Ok(Some(right_from_left.inverse()))
}
