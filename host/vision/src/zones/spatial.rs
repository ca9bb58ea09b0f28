//! Zones of any two cameras in space: real lenses, any pose, and what the robot's body hides.
//!
//! A camera sees a point where its lens shows it on the sensor, within the valid cone, and not on the robot's own body. The
//! test is on the angle to the axis; nothing asks for z > 0, because the lenses see past 90°.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use super::{Coverage, ZoneMap, ZonesError};
use crate::{Base, Camera, ImageSize, KannalaBrandt, Length, Pixel, Point, Transform};

/// The circle is cut where visibility changes between two azimuths this many to the turn; an arc narrower than the step
/// of 0.125° may be missed.
const STEPS: u32 = 2880;

/// Which pixels of a camera show the robot's own body.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BodyMask {
    size: ImageSize,
    hidden: Vec<bool>,
}

impl BodyMask {
    /// From one value per pixel, by rows: true where the body is. `None` where the count is not that of the size.
    #[must_use]
    pub fn new(size: ImageSize, hidden: Vec<bool>) -> Option<Self> {
        let pixels = u64::from(size.width) * u64::from(size.height);
        (u64::try_from(hidden.len()) == Ok(pixels)).then_some(Self { size, hidden })
    }

    /// Whether the pixel nearest to `pixel` shows the body. What lies outside the image does not.
    #[must_use]
    pub fn hides(&self, pixel: Pixel) -> bool {
        let (column, row) = (pixel.u.round(), pixel.v.round());
        let inside = |x: f64, n: u32| x >= 0.0 && x < f64::from(n);
        inside(column, self.size.width)
            && inside(row, self.size.height)
            && self.hidden.get(row as usize * self.size.width as usize + column as usize).is_some_and(|&hidden| hidden)
    }
}

/// A camera in its place.
#[derive(Clone, Copy, Debug)]
pub struct Eye<'a> {
    /// The lens and sensor.
    pub lens: &'a KannalaBrandt,
    /// Where it is: base x to the right, y down, z forward.
    pub base_from_camera: Transform<Base, Camera>,
    /// What of the image shows the robot.
    pub body: Option<&'a BodyMask>,
}

impl Eye<'_> {
    /// Whether `point` is seen.
    #[must_use]
    pub fn sees(&self, point: &Point<Base>) -> bool {
        let in_camera = self.base_from_camera.inverse() * *point;
        self.lens
            .project_point(&in_camera)
            .is_ok_and(|pixel| self.lens.on_sensor(pixel) && !self.body.is_some_and(|body| body.hides(pixel)))
    }
}

/// Solid angles around a rig in steradians. They add up to 4π.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SolidZones {
    /// Seen by both cameras.
    pub stereo_sr: f64,
    /// Seen by one camera.
    pub mono_sr: f64,
    /// Seen by none.
    pub blind_sr: f64,
    /// The part of `stereo_sr` behind the rig.
    pub rear_sr: f64,
}

/// The zones of two cameras on the horizontal circle of `radius` around `centre`: by azimuth from forward (base z), positive
/// to the right (base x).
///
/// # Errors
/// [`ZonesError`] where a camera is not inside the circle's sphere or a value is not finite.
pub fn circle_zones(eyes: &[Eye<'_>; 2], centre: &Point<Base>, radius: Length) -> Result<ZoneMap, ZonesError> {
    check(eyes, centre, radius)?;
    let at = |azimuth: f64| Point::from_mm(centre.mm() + Vector3::new(azimuth.sin(), 0.0, azimuth.cos()) * radius.mm());
    let [left, right] = eyes;
    let cuts: Vec<f64> = eyes.iter().flat_map(|eye| changes(|azimuth| eye.sees(&at(azimuth)))).collect();
    Ok(ZoneMap::from_cuts(&cuts, |azimuth| {
        let point = at(azimuth);
        Coverage::of(left.sees(&point), right.sees(&point))
    }))
}

/// The solid angles of two cameras on the sphere of `radius` around `centre`, counted in as many evenly spread `directions`
/// (a spherical Fibonacci lattice; 200 000 are right to about 0.001 sr).
///
/// # Errors
/// As [`circle_zones`].
pub fn solid_zones(
    eyes: &[Eye<'_>; 2],
    centre: &Point<Base>,
    radius: Length,
    directions: u32,
) -> Result<SolidZones, ZonesError> {
    check(eyes, centre, radius)?;
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
        let [left, right] = eyes.each_ref().map(|eye| eye.sees(&point));
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

fn check(eyes: &[Eye<'_>; 2], centre: &Point<Base>, radius: Length) -> Result<(), ZonesError> {
    for eye in eyes {
        let away = (eye.base_from_camera.origin().mm() - centre.mm()).norm();
        if !away.is_finite() || !radius.mm().is_finite() {
            return Err(ZonesError::NotFinite);
        }
        if away >= radius.mm() {
            return Err(ZonesError::OutsideCircle);
        }
    }
    Ok(())
}

/// The azimuths once around where `seen` changes, to rounding.
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
