//! What the rig has to say, as messages of ROS 2: lengths in metres, angles in radians, times since 1970.
//!
//! Frames: `base` carries `left` and `right`, the optical frames of both cameras (x right, y down, z forward).

use image::RgbImage;
use nalgebra::{Isometry3, Matrix3};
use vergence_pipeline::{ColouredPoint, PairCloud};
use vergence_protocol::PoseReport;
use vergence_rig::{AxisPosition, RigAxis, RigPose};
use vergence_vision::{ImageSize, KannalaBrandt, OpenCvFisheye, Pixel, VirtualView};

use crate::cdr::Cdr;
use crate::event::Eye;
use crate::png::Png;

/// Metres in a millimetre.
const MM: f64 = 1e-3;
/// `sensor_msgs/PointField`: a number of 32 bits with a fraction, and a whole one without sign.
const FLOAT32: u8 = 7;
const UINT32: u8 = 6;
/// Numbers of a point in [`cloud`]: place, range sigma, covariance and own covariance, score; and its colour.
const POINT_FLOATS: [&str; 17] = [
    "x",
    "y",
    "z",
    "sigma_range",
    "cov_xx",
    "cov_xy",
    "cov_xz",
    "cov_yy",
    "cov_yz",
    "cov_zz",
    "own_xx",
    "own_xy",
    "own_xz",
    "own_yy",
    "own_yz",
    "own_zz",
    "score",
];

/// A `std_msgs/Header` with a stamp in nanoseconds.
fn header(stamp_ns: u64, frame: &str) -> Cdr {
    stamped(Cdr::default(), stamp_ns, frame)
}

fn stamped(cdr: Cdr, stamp_ns: u64, frame: &str) -> Cdr {
    const SECOND: u64 = 1_000_000_000;
    let seconds = i32::try_from(stamp_ns / SECOND).unwrap_or(i32::MAX);
    // The rest is below a second.
    cdr.number(seconds).number((stamp_ns % SECOND) as u32).text(frame)
}

/// A `vergence_msgs/Event`: when the host heard of it, and its postcard encoding.
pub fn event(host_us: u64, postcard: &[u8]) -> Vec<u8> {
    Cdr::default().number(host_us).bytes(postcard).finish()
}

/// A `sensor_msgs/CompressedImage` with a PNG file.
pub fn image(stamp_ns: u64, eye: Eye, png: &Png) -> Vec<u8> {
    let format = if png.is_grey { "mono8; png compressed mono8" } else { "rgb8; png compressed rgb8" };
    header(stamp_ns, eye.name()).text(format).bytes(&png.bytes).finish()
}

/// A `sensor_msgs/CameraInfo` with the model `equidistant`, which ROS shares with OpenCV's fisheye model and Kalibr: r = f (θ + d1 θ³ + d2 θ⁵ +
/// d3 θ⁷ + d4 θ⁹). A moving pupil, asymmetry and further radial terms have no place there; the attached rig file has them.
pub fn camera_info(stamp_ns: u64, eye: Eye, lens: &KannalaBrandt) -> Vec<u8> {
    let OpenCvFisheye { fx, fy, cx, cy, k } = lens.nearest_opencv();
    lens_info(header(stamp_ns, eye.name()), lens.size(), ("equidistant", &k), [fx, fy, cx, cy])
}

/// A `sensor_msgs/CameraInfo` of a pinhole view in the frame `frame`, without distortion.
pub fn view_info(stamp_ns: u64, frame: &str, view: &VirtualView) -> Vec<u8> {
    let (focal, Pixel { u, v }) = (view.focal(), view.centre());
    lens_info(header(stamp_ns, frame), view.size(), ("plumb_bob", &[0.0; 5]), [focal, focal, u, v])
}

fn lens_info(header: Cdr, size: ImageSize, (model, d): (&str, &[f64]), [fx, fy, cx, cy]: [f64; 4]) -> Vec<u8> {
    let identity = Matrix3::<f64>::identity();
    header
        .number(size.height)
        .number(size.width)
        .text(model)
        .sequence(d)
        .array(&[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0])
        .array(identity.as_slice())
        .array(&[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0])
        // Neither binned nor cut.
        .array(&[0_u32; 6])
        .number(0_u8)
        .finish()
}

/// A `sensor_msgs/Image`: grey where all channels are the same.
pub fn raw_image(stamp_ns: u64, frame: &str, image: &RgbImage) -> Vec<u8> {
    let grey = image.pixels().all(|pixel| pixel.0 == [pixel.0[0]; 3]);
    let grey = grey.then(|| image.pixels().map(|pixel| pixel.0[0]).collect::<Vec<u8>>());
    let (encoding, channels) = if grey.is_some() { ("mono8", 1) } else { ("rgb8", 3) };
    header(stamp_ns, frame)
        .array(&[image.height(), image.width()])
        .text(encoding)
        .number(0_u8)
        .number(image.width() * channels)
        .bytes(grey.as_deref().unwrap_or(image.as_raw()))
        .finish()
}

/// A `sensor_msgs/JointState` with the readings of the encoders.
pub fn joint_state(stamp_ns: u64, axes: &[RigAxis], pose: &PoseReport) -> Vec<u8> {
    let positions: Vec<f64> =
        axes.iter().zip(&pose.counts).map(|(axis, &counts)| si(axis.position_at(counts))).collect();
    header(stamp_ns, "base")
        .parts(axes, |cdr, axis| cdr.text(&axis.name))
        .sequence(&positions)
        .array(&[0_u32; 2])
        .finish()
}

fn si(position: AxisPosition) -> f64 {
    match position {
        AxisPosition::Linear(length) => length.mm() * MM,
        AxisPosition::Rotary(angle) => angle.rad(),
    }
}

/// A `tf2_msgs/TFMessage` with both cameras on the base.
pub fn transforms(stamp_ns: u64, pose: &RigPose) -> Vec<u8> {
    placed(stamp_ns, &cameras(pose))
}

/// A frame that stands in another one.
pub struct Placed {
    /// Name of the frame in which it stands.
    pub parent: String,
    /// Its own name.
    pub child: String,
    /// The child's frame in the parent's, in millimetres.
    pub pose: Isometry3<f64>,
}

/// Both cameras on the base.
pub fn cameras(pose: &RigPose) -> [Placed; 2] {
    let base_from_right = pose.base_from_left * pose.left_from_right;
    [(Eye::Left, *pose.base_from_left.isometry()), (Eye::Right, *base_from_right.isometry())]
        .map(|(eye, pose)| Placed { parent: "base".to_owned(), child: eye.name().to_owned(), pose })
}

/// A `tf2_msgs/TFMessage` with these frames.
pub fn placed(stamp_ns: u64, frames: &[Placed]) -> Vec<u8> {
    let one = |cdr: Cdr, Placed { parent, child, pose }: &Placed| {
        let metres = pose.translation.vector * MM;
        stamped(cdr, stamp_ns, parent).text(child).array(metres.as_slice()).array(pose.rotation.coords.as_slice())
    };
    Cdr::default().parts(frames, one).finish()
}

/// A `sensor_msgs/PointCloud2` in the frame of the left camera: metres, covariances in square metres, colour as 0x00RRGGBB in `rgba`.
pub fn cloud(stamp_ns: u64, cloud: &PairCloud) -> Vec<u8> {
    const SIZE: usize = 4;
    let point_step = (POINT_FLOATS.len() + 1) * SIZE;
    let count = cloud.points.len();
    let fields: Vec<_> =
        POINT_FLOATS.iter().map(|&name| (name, FLOAT32)).chain([("rgba", UINT32)]).zip(0_u32..).collect();
    let data: Vec<u8> = cloud.points.iter().flat_map(point).collect();
    header(stamp_ns, Eye::Left.name())
        .array(&[1, narrow(count)])
        .parts(&fields, |cdr, ((name, kind), place)| {
            cdr.text(name).number(place * SIZE as u32).number(*kind).number(1_u32)
        })
        .number(0_u8)
        .array(&[narrow(point_step), narrow(point_step * count)])
        .bytes(&data)
        .number(1_u8)
        .finish()
}

/// A pair has fewer points than its images have pixels.
fn narrow(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

/// The bytes of one point, as [`POINT_FLOATS`] names them, and its colour.
fn point(ColouredPoint { point, colour: [red, green, blue], score, .. }: &ColouredPoint) -> Vec<u8> {
    let upper =
        |matrix: &Matrix3<f64>| [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)].map(|place| matrix[place] * MM * MM);
    let place = point.point.mm().map(|mm| mm * MM);
    let floats = place.iter().copied().chain([point.sigma_range.mm() * MM]);
    let floats = floats.chain(upper(&point.covariance)).chain(upper(&point.own_covariance)).chain([f64::from(*score)]);
    let colour = u32::from_be_bytes([0, *red, *green, *blue]);
    floats.flat_map(|value| (value as f32).to_le_bytes()).chain(colour.to_le_bytes()).collect()
}

/// How a part of the rig is, as `diagnostic_msgs/DiagnosticStatus` grades it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grade {
    /// It works.
    Ok = 0,
    /// People should know.
    Warning = 1,
    /// It does not work.
    Error = 2,
    /// Nothing was heard of it for too long.
    Stale = 3,
}

/// One part of a [`diagnostics`] message.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Health {
    /// How it is.
    pub grade: Grade,
    /// What it is, such as `board`.
    pub name: &'static str,
    /// A sentence for people.
    pub message: String,
    /// Its figures by name.
    pub values: Vec<(&'static str, String)>,
}

/// A `diagnostic_msgs/DiagnosticArray`.
pub fn diagnostics(stamp_ns: u64, parts: &[Health]) -> Vec<u8> {
    let part = |cdr: Cdr, health: &Health| {
        cdr.number(health.grade as u8)
            .text(health.name)
            .text(&health.message)
            .text("vergence")
            .parts(&health.values, |cdr, (key, value)| cdr.text(key).text(value))
    };
    header(stamp_ns, "").parts(parts, part).finish()
}
