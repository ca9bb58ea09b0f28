//! mrcal's `.cameramodel`, a Python dictionary. Its extrinsics map the reference frame to the camera's, in metres as mrcal's tools write it.

use nalgebra::{UnitQuaternion, Vector3};
use vergence_vision::{Base, Camera, CameraModel, Pinhole, Pixel, Radtan, SplineGrid, SplinedStereographic, Transform};

use crate::node::{Node, parse};
use crate::rig::Place;
use crate::{ExchangeError, ForeignCamera, Format, pose};

/// Reads the camera.
pub fn read(text: &str) -> Result<Vec<ForeignCamera>, ExchangeError> {
    // With lists, numbers, quoted texts and comments, such a dictionary is YAML. Bytes are not: the solver's inputs, which are not needed.
    let root = parse(Format::Mrcal, &text.replace(": b'", ": '").replace(": None", ": null"))?;
    let size = root.need(&["imagersize"])?.size()?;
    let outline = root.get(&["valid_intrinsics_region"]).map_or(Ok(Vec::new()), |node| outline(&node))?;
    let model = model(&root)?;
    Ok(vec![ForeignCamera { outline, ..ForeignCamera::new("camera", model, size).at(Some(place(&root)?)) }])
}

fn outline(node: &Node) -> Result<Vec<Pixel>, ExchangeError> {
    node.entries()?.iter().map(|corner| corner.array().map(|[u, v]| Pixel { u, v })).collect()
}

fn place(root: &Node) -> Result<Transform<Base, Camera>, ExchangeError> {
    let [turn_x, turn_y, turn_z, x, y, z] = root.need(&["extrinsics", "rt_cam_ref"])?.array()?;
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(turn_x, turn_y, turn_z));
    Ok(Transform::<Camera, Base>::new(rotation, Vector3::new(x, y, z) * pose::METRE).inverse())
}

fn model(root: &Node) -> Result<Box<dyn CameraModel>, ExchangeError> {
    let place = Place { format: Format::Mrcal, camera: "camera" };
    let name = root.need(&["lensmodel"])?.text()?;
    let intrinsics = root.need(&["intrinsics"])?;
    let numbers = intrinsics.numbers()?;
    let [fx, fy, cx, cy, rest @ ..] = &numbers[..] else {
        return Err(intrinsics.wrong("has less than four numbers"));
    };
    let pinhole = [*fx, *fy, *cx, *cy];
    let bare = name.strip_prefix("LENSMODEL_").unwrap_or(&name);
    let coefficients = match bare {
        "PINHOLE" => Some(0),
        "OPENCV4" => Some(4),
        "OPENCV5" => Some(5),
        "OPENCV8" => Some(8),
        "OPENCV12" => Some(12),
        _ => None,
    };
    if let Some(count) = coefficients {
        let distortion = Radtan::new(rest).filter(|_| rest.len() == count);
        let distortion = distortion.ok_or_else(|| {
            intrinsics.wrong(format!("has {} numbers, not the {} of {name}", numbers.len(), 4 + count))
        })?;
        return place.central(Pinhole { pinhole, distortion });
    }
    let Some(configuration) = bare.strip_prefix("SPLINED_STEREOGRAPHIC_") else {
        return Err(root.wrong(format!(
            "has the lensmodel {name}, which is not read: PINHOLE, OPENCV4, OPENCV5, OPENCV8, OPENCV12 and SPLINED_STEREOGRAPHIC are"
        )));
    };
    let grid = grid(configuration)
        .ok_or_else(|| root.wrong(format!("has a lensmodel {name} whose grid is not understood")))?;
    let control = rest.chunks_exact(2).map(|pair| [pair[0], pair[1]]).collect();
    if rest.len() % 2 != 0 {
        return Err(intrinsics.wrong("has an odd number of control values"));
    }
    place.central(SplinedStereographic { pinhole, grid, control })
}

/// The grid of `order=3_Nx=30_Ny=20_fov_x_deg=170`.
fn grid(configuration: &str) -> Option<SplineGrid> {
    let rest = configuration.strip_prefix("order=")?;
    let (order, rest) = rest.split_once("_Nx=")?;
    let (columns, rest) = rest.split_once("_Ny=")?;
    let (rows, field) = rest.split_once("_fov_x_deg=")?;
    let number = |text: &str| text.parse().ok();
    Some(SplineGrid {
        order: number(order)?,
        columns: number(columns)?,
        rows: number(rows)?,
        field_deg: field.parse().ok()?,
    })
}
