//! Pinhole cameras at the place of a fisheye camera, for programs that know no other.
//!
//! A pinhole camera sees less than 180°: five of 90° see all that a fisheye lens of 196° sees in front of it and to the sides.

use std::f64::consts::FRAC_PI_2;
use std::str::FromStr;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::{Angle, Camera, ImageSize, Pixel, Point, Transform, UnitRay, Virtual};

/// The direction in which a virtual view looks, as seen from its camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Face {
    /// Along the optical axis.
    Front,
    /// To the left, 90° from the optical axis.
    Left,
    /// To the right.
    Right,
    /// Up.
    Up,
    /// Down.
    Down,
}

/// A word that names no [`Face`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is no view: front, left, right, up or down")]
pub struct UnknownFace(String);

impl Face {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Front, Self::Left, Self::Right, Self::Up, Self::Down];

    /// Its name in files and topics.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Front => "front",
            Self::Left => "left",
            Self::Right => "right",
            Self::Up => "up",
            Self::Down => "down",
        }
    }

    /// How a view that looks there is turned: x to its right, y down, z forward.
    #[must_use]
    pub fn camera_from_view(self) -> Transform<Camera, Virtual> {
        let turn = match self {
            Self::Front => Vector3::zeros(),
            Self::Left => Vector3::y() * -FRAC_PI_2,
            Self::Right => Vector3::y() * FRAC_PI_2,
            Self::Up => Vector3::x() * FRAC_PI_2,
            Self::Down => Vector3::x() * -FRAC_PI_2,
        };
        Transform::new(UnitQuaternion::from_scaled_axis(turn), Vector3::zeros())
    }
}

impl FromStr for Face {
    type Err = UnknownFace;

    fn from_str(text: &str) -> Result<Self, UnknownFace> {
        Self::ALL.into_iter().find(|face| face.name() == text).ok_or_else(|| UnknownFace(text.to_owned()))
    }
}

/// A field that no view has.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("a pinhole view of {:.1}° and {} pixels: choose 10° to 150° and 16 to 8192 pixels", .field.deg(), .pixels)]
pub struct InvalidView {
    /// The field across the view.
    field: Angle,
    /// Pixels across it.
    pixels: u32,
}

/// A square pinhole camera without distortion, whose centre is that of a fisheye camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VirtualView {
    pixels: u32,
    focal: f64,
    camera_from_view: Transform<Camera, Virtual>,
}

impl VirtualView {
    /// A view that is turned by `camera_from_view`, with `pixels` columns and rows over `field` from edge to edge.
    ///
    /// # Errors
    /// [`InvalidView`] where a pinhole camera would be little more than edges, or has no pixels.
    pub fn new(camera_from_view: Transform<Camera, Virtual>, field: Angle, pixels: u32) -> Result<Self, InvalidView> {
        if !((10.0..=150.0).contains(&field.deg()) && (16..=8192).contains(&pixels)) {
            return Err(InvalidView { field, pixels });
        }
        let focal = 0.5 * f64::from(pixels) / (0.5 * field.rad()).tan();
        Ok(Self { pixels, focal, camera_from_view })
    }

    /// The number of pixels over `field` with which a view shows the middle as large as a lens that has `per_radian` pixels per radian there.
    #[must_use]
    pub fn natural_pixels(field: Angle, per_radian: f64) -> u32 {
        (2.0 * per_radian * (0.5 * field.rad()).tan()).round().clamp(16.0, 8192.0) as u32
    }

    /// Columns and rows.
    #[must_use]
    pub const fn size(&self) -> ImageSize {
        ImageSize { width: self.pixels, height: self.pixels }
    }

    /// The focal length in pixels, the same in both directions.
    #[must_use]
    pub const fn focal(&self) -> f64 {
        self.focal
    }

    /// The principal point: the middle of the view.
    #[must_use]
    pub fn centre(&self) -> Pixel {
        let middle = 0.5 * f64::from(self.pixels) - 0.5;
        Pixel { u: middle, v: middle }
    }

    /// The camera matrix K by rows.
    #[must_use]
    pub fn camera_matrix(&self) -> [f64; 9] {
        let Pixel { u, v } = self.centre();
        [self.focal, 0.0, u, 0.0, self.focal, v, 0.0, 0.0, 1.0]
    }

    /// How the view is turned in the camera's frame.
    #[must_use]
    pub const fn camera_from_view(&self) -> &Transform<Camera, Virtual> {
        &self.camera_from_view
    }

    /// The rotation R by rows: a point X in the camera's frame is imaged at K R X.
    #[must_use]
    pub fn view_from_camera(&self) -> [f64; 9] {
        let turn: Matrix3<f64> = *self.camera_from_view.inverse().rotation().to_rotation_matrix().matrix();
        let rows = turn.transpose();
        std::array::from_fn(|index| rows.as_slice()[index])
    }

    /// The ray of a pixel in the camera's frame; `None` where `at` is not finite.
    #[must_use]
    pub fn ray(&self, at: Pixel) -> Option<UnitRay<Camera>> {
        let centre = self.centre();
        let in_view = Vector3::new((at.u - centre.u) / self.focal, (at.v - centre.v) / self.focal, 1.0);
        Some(self.camera_from_view * UnitRay::new(in_view)?)
    }

    /// The pixel and the depth (millimetres along z of the view) of `point`; `None` behind the view.
    #[must_use]
    pub fn project(&self, point: &Point<Camera>) -> Option<(Pixel, f64)> {
        let at = (self.camera_from_view.inverse() * *point).mm();
        let centre = self.centre();
        let pixel = Pixel { u: centre.u + self.focal * at.x / at.z, v: centre.v + self.focal * at.y / at.z };
        (at.z > 0.0).then_some((pixel, at.z))
    }
}

#[cfg(test)]
#[path = "../tests/unit/virtual_view.rs"]
mod tests;
