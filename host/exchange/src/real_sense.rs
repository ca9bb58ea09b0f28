//! What `rs-enumerate-devices -c` prints of a RealSense camera, such as the T265. Extrinsics map points of one stream to another, in metres.

use nalgebra::{Matrix3, Vector3};
use vergence_vision::{Base, Camera, CameraModel, ImageSize, Pinhole, Radtan, Transform};

use crate::node::Node;
use crate::rig::Place;
use crate::{ExchangeError, ForeignCamera, Format, pose};

/// Reads every stream that has intrinsics.
pub fn read(text: &str) -> Result<Vec<ForeignCamera>, ExchangeError> {
    let mut cameras: Vec<ForeignCamera> = Vec::new();
    for block in text.split("Intrinsic of \"").skip(1) {
        let name = block.split('"').next().unwrap_or_default();
        if !block.lines().any(|line| line.trim_start().starts_with("PPX:")) {
            continue; // Of a gyroscope or an accelerometer.
        }
        let (model, size) = model(block, name)?;
        let is_known = cameras.iter().any(|camera| camera.name == name);
        let name = if is_known { format!("{name} {}x{}", size.width, size.height) } else { name.to_owned() };
        let first = cameras.first().map(|camera| camera.name.clone());
        let place = match first {
            None => Some(Transform::from_isometry(nalgebra::Isometry3::identity())),
            Some(first) => first_from(text, &first, &name)?,
        };
        cameras.push(ForeignCamera::new(name, model, size).at(place));
    }
    Ok(cameras)
}

fn wrong(problem: String) -> ExchangeError {
    ExchangeError::Wrong { format: Format::RealSense, problem }
}

fn model(block: &str, name: &str) -> Result<(Box<dyn CameraModel>, ImageSize), ExchangeError> {
    let field = |key: &str| {
        let line = block.lines().find_map(|line| line.trim_start().strip_prefix(key));
        line.map(str::trim).ok_or_else(|| wrong(format!("\"{name}\" has no {key}")))
    };
    let number = |key: &str| {
        let number = field(key)?.parse().ok().filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| wrong(format!("{key} of \"{name}\" is no number")))
    };
    let pinhole = [number("Fx:")?, number("Fy:")?, number("PPX:")?, number("PPY:")?];
    let size = Node::nothing(Format::RealSense).image_size(number("Width:")?, number("Height:")?)?;
    let coefficients: Option<Vec<f64>> = field("Coeffs:")?.split_whitespace().map(|word| word.parse().ok()).collect();
    let coefficients: [f64; 5] = coefficients
        .and_then(|list| list.try_into().ok())
        .ok_or_else(|| wrong(format!("Coeffs: of \"{name}\" are not five numbers")))?;
    let place = Place { format: Format::RealSense, camera: name };
    let kind = field("Distortion:")?;
    let is_straight = coefficients.iter().all(|value| *value == 0.0);
    let model = match kind {
        "Kannala Brandt4" => {
            let [k1, k2, k3, k4, _] = coefficients;
            place.fisheye(pinhole, [k1, k2, k3, k4], size, None)?
        }
        _ if kind == "Brown Conrady" || is_straight => {
            let distortion =
                Radtan::new(&coefficients).ok_or_else(|| wrong(format!("\"{name}\" has no distortion")))?;
            place.central(Pinhole { pinhole, distortion })?
        }
        _ => {
            return Err(wrong(format!(
                "\"{name}\" has the distortion '{kind}', which is not read: Kannala Brandt4 and Brown Conrady are"
            )));
        }
    };
    Ok((model, size))
}

/// Where the stream `other` is in the frame of the stream `first`.
fn first_from(text: &str, first: &str, other: &str) -> Result<Option<Transform<Base, Camera>>, ExchangeError> {
    let is_between = |block: &&str| {
        let names: Vec<_> = block.lines().next().unwrap_or_default().split('"').collect();
        names.first() == Some(&first) && names.get(2) == Some(&other)
    };
    let Some(block) = text.split("Extrinsic from \"").skip(1).find(is_between) else { return Ok(None) };
    let numbers = block.lines().skip(1).flat_map(str::split_whitespace).filter_map(|word| word.parse::<f64>().ok());
    let numbers: Vec<f64> = numbers.take(12).collect();
    let [turn @ .., x, y, z] = &numbers[..] else {
        return Err(wrong(format!("no numbers from \"{first}\" to \"{other}\"")));
    };
    if turn.len() != 9 {
        return Err(wrong(format!(
            "the extrinsic from \"{first}\" to \"{other}\" has {} numbers, not 12",
            numbers.len()
        )));
    }
    let rotation = pose::rotation(&Node::nothing(Format::RealSense), Matrix3::from_row_slice(turn))?;
    let other_from_first = Transform::<Camera, Base>::new(rotation, Vector3::new(*x, *y, *z) * pose::METRE);
    Ok(Some(other_from_first.inverse()))
}
