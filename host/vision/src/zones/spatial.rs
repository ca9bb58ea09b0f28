//! Zones of two cameras in space, with real lenses, any pose, and masks of the robot's own body.
//!
//! A camera sees a point that its lens projects onto the sensor, within the valid cone, and outside the image of the
//! robot's own body. The test uses the angle to the axis and not the sign of z, because the lenses see past 90°.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use super::{Coverage, ZoneMap, ZonesError};
use crate::{Base, Camera, ImageSize, KannalaBrandt, Length, Pixel, Point, Transform};

/// Number of azimuths between which changes of visibility are sought; an arc narrower than the step of 0.125° may be
/// missed.
const STEPS: u32 = 2880;

/// A mask of the pixels of a camera that show the robot's own body.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BodyMask {
    size: ImageSize,
    hidden: Vec<bool>,
}

impl BodyMask {
    /// Makes a mask from one value per pixel, by rows, true where the body is. `None` where their number does not fit
    /// `size`.
    #[must_use]
    pub fn new(size: ImageSize, hidden: Vec<bool>) -> Option<Self> {
        let pixels = u64::from(size.width) * u64::from(size.height);
        (u64::try_from(hidden.len()) == Ok(pixels)).then_some(Self { size, hidden })
    }

    /// Whether the pixel nearest to `pixel` shows the body; false outside the image.
    #[must_use]
    pub fn hides(&self, pixel: Pixel) -> bool {
        let (column, row) = (pixel.u.round(), pixel.v.round());
        let inside = |x: f64, n: u32| x >= 0.0 && x < f64::from(n);
        inside(column, self.size.width)
            && inside(row, self.size.height)
            && self.hidden.get(row as usize * self.size.width as usize + column as usize).is_some_and(|&hidden| hidden)
    }
}

/// A camera with its pose in the base frame, for [`circle_zones`] and [`solid_zones`].
#[derive(Clone, Copy, Debug)]
pub struct PlacedCamera<'a> {
    /// The lens with its sensor.
    pub lens: &'a KannalaBrandt,
    /// Pose of the camera; the base frame has x to the right, y down, z forward.
    pub base_from_camera: Transform<Base, Camera>,
    /// The mask of the robot's own body, if there is one.
    pub body: Option<&'a BodyMask>,
}

impl PlacedCamera<'_> {
    /// Whether the camera sees `point`.
    #[must_use]
    pub fn sees(&self, point: &Point<Base>) -> bool {
        let in_camera = self.base_from_camera.inverse() * *point;
        self.lens
            .project_point(&in_camera)
            .is_ok_and(|pixel| self.lens.on_sensor(pixel) && !self.body.is_some_and(|body| body.hides(pixel)))
    }
}

/// The solid angles of the zones around a rig in steradians. Stereo, mono and blind add up to 4π.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SolidZones {
    /// Solid angle seen by both cameras.
    pub stereo_sr: f64,
    /// Solid angle seen by one camera.
    pub mono_sr: f64,
    /// Solid angle seen by no camera.
    pub blind_sr: f64,
    /// The part of `stereo_sr` behind the rig (z < 0).
    pub rear_sr: f64,
}

/// Computes the zones of two cameras on the horizontal circle of `radius` around `centre`.
///
/// Azimuth is measured from forward (base z), positive to the right (base x).
///
/// # Errors
/// [`ZonesError`] where a camera is not inside the circle's sphere or a value is not finite.
pub fn circle_zones(
    cameras: &[PlacedCamera<'_>; 2],
    centre: &Point<Base>,
    radius: Length,
) -> Result<ZoneMap, ZonesError> {
    check(cameras, centre, radius)?;
    let at = |azimuth: f64| Point::from_mm(centre.mm() + Vector3::new(azimuth.sin(), 0.0, azimuth.cos()) * radius.mm());
    let [left, right] = cameras;
    let cuts: Vec<f64> = cameras.iter().flat_map(|camera| changes(|azimuth| camera.sees(&at(azimuth)))).collect();
    Ok(ZoneMap::from_cuts(&cuts, |azimuth| {
        let point = at(azimuth);
        Coverage::of(left.sees(&point), right.sees(&point))
    }))
}

/// Computes the solid angles of the zones of two cameras on the sphere of `radius` around `centre`.
///
/// They are counted on a spherical Fibonacci lattice of `directions` points; 200 000 are right to about 0.001 sr.
///
/// # Errors
/// The errors of [`circle_zones`], and [`ZonesError::NoDirections`] for zero `directions`.
pub fn solid_zones(
    cameras: &[PlacedCamera<'_>; 2],
    centre: &Point<Base>,
    radius: Length,
    directions: u32,
) -> Result<SolidZones, ZonesError> {
    check(cameras, centre, radius)?;
    if directions == 0 {
        return Err(ZonesError::NoDirections);
    }
    let golden = PI * (3.0 - 5f64.sqrt());
    let [mut stereo, mut mono, mut rear] = [0_u32; 3];
    for i in 0..directions {
        let height = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(directions);
        let (across, turn) = ((1.0 - height * height).sqrt(), golden * f64::from(i));
        let direction = Vector3::new(across * turn.cos(), height, across * turn.sin());
        let point = Point::from_mm(centre.mm() + direction * radius.mm());
        let [left, right] = cameras.each_ref().map(|camera| camera.sees(&point));
        stereo += u32::from(left && right);
        mono += u32::from(left != right);
        rear += u32::from(left && right && direction.z < 0.0);
    }
    let steradians = |count: u32| 4.0 * PI * f64::from(count) / f64::from(directions);
    Ok(SolidZones {
        stereo_sr: steradians(stereo),
        mono_sr: steradians(mono),
        blind_sr: steradians(directions - stereo - mono),
        rear_sr: steradians(rear),
    })
}

fn check(cameras: &[PlacedCamera<'_>; 2], centre: &Point<Base>, radius: Length) -> Result<(), ZonesError> {
    for camera in cameras {
        let away = (camera.base_from_camera.origin().mm() - centre.mm()).norm();
        if !away.is_finite() || !radius.mm().is_finite() {
            return Err(ZonesError::NotFinite);
        }
        if away >= radius.mm() {
            return Err(ZonesError::OutsideCircle);
        }
    }
    Ok(())
}

/// Finds the azimuths in radians, once around, where `seen` changes, to rounding.
fn changes(seen: impl Fn(f64) -> bool) -> Vec<f64> {
    let at = |i: u32| TAU * f64::from(i) / f64::from(STEPS);
    let flags: Vec<bool> = (0..=STEPS).map(|i| seen(at(i))).collect();
    let change = |(i, pair): (u32, &[bool])| {
        let (mut low, mut high) = (at(i), at(i + 1));
        let &[before, after] = pair else { return None };
        if before == after {
            return None;
        }
        while high - low > 4.0 * f64::EPSILON * TAU {
            let middle = 0.5 * (low + high);
            if seen(middle) == before { low = middle } else { high = middle }
        }
        Some(high)
    };
    (0..STEPS).zip(flags.windows(2)).filter_map(change).collect()
}
