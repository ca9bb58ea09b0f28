//! Stereo, mono and blind zones of two cameras in the horizontal plane.
//!
//! The zones are arcs of a circle about the rig's centre. Azimuth is measured from forward (y), positive to the right
//! (x). A ray from the centre `c` of a camera with azimuth β meets the circle of radius R at the central angle
//!
//! ```text
//! ψ(β) = β + asin((cx cos β - cy sin β) / R)
//! ```
//!
//! which grows with β while |c| < R. A camera with axis α and half field h therefore sees exactly the arc from ψ(α - h)
//! to ψ(α + h), for any toe-in and for fields past 180°, and the zones follow from counting two intervals.
//!
//! [`circle_zones`] and [`solid_zones`] take any two poses in space, the real lenses, and masks of the robot's own
//! body.

mod paper;
mod spatial;

use std::f64::consts::{PI, TAU};

pub use paper::{PAPER_FIELD, PUBLISHED_MODES, PublishedMode, paper_eq3, paper_eq3_applies};
pub use spatial::{BodyMask, PlacedCamera, SolidZones, circle_zones, solid_zones};

use crate::{Angle, Length};

/// A camera in the horizontal plane, for [`zones_exact`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarCamera {
    /// Optical centre in millimetres: x to the right, y forward.
    pub centre_mm: [f64; 2],
    /// Azimuth of the optical axis from forward, positive to the right.
    pub axis: Angle,
    /// Half the horizontal field, from 0° to 180°.
    pub half_field: Angle,
}

/// The angles of the stereo, mono and blind zones of the circle. They add up to 360°.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Zones {
    /// Angle seen by both cameras.
    pub stereo: Angle,
    /// Angle seen by one camera.
    pub mono: Angle,
    /// Angle seen by no camera.
    pub blind: Angle,
}

/// The number of cameras that see an arc of the circle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Coverage {
    /// No camera.
    Blind,
    /// One camera.
    Mono,
    /// Both cameras.
    Stereo,
}

/// An arc of the circle with one coverage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// Begin as central azimuth from forward, positive to the right, from 0° to 360°.
    pub start: Angle,
    /// End, never before `start`; that of the last arc may exceed 360°.
    pub end: Angle,
    /// Number of cameras that see it.
    pub coverage: Coverage,
}

/// The zones of a circle and the arcs that they consist of.
#[derive(Clone, Debug, PartialEq)]
pub struct ZoneMap {
    /// Total angle of each zone.
    pub zones: Zones,
    /// The arcs once around the circle in order of azimuth, each beginning where the one before ends.
    pub arcs: Vec<Arc>,
}

impl ZoneMap {
    /// The part of the stereo zone in the rear half of the circle, where both fields overlap behind the rig.
    #[must_use]
    pub fn rear_overlap(&self) -> Angle {
        let rear = |from: f64, to: f64| (to.min(1.5 * PI) - from.max(0.5 * PI)).max(0.0);
        let in_rear = |arc: &Arc| {
            let (start, end) = (arc.start.rad(), arc.end.rad());
            // The last arc may pass 360°.
            rear(start, end) + rear(start - TAU, end - TAU)
        };
        let stereo = self.arcs.iter().filter(|arc| arc.coverage == Coverage::Stereo);
        Angle::from_rad(stereo.map(in_rear).sum())
    }

    /// Makes the map of a circle cut at `cuts` (central azimuths in radians); `coverage` is evaluated at the middle of
    /// each arc.
    fn from_cuts(cuts: &[f64], coverage: impl Fn(f64) -> Coverage) -> Self {
        let mut starts: Vec<f64> = cuts.iter().map(|cut| cut.rem_euclid(TAU)).collect();
        starts.sort_by(f64::total_cmp);
        if starts.is_empty() {
            starts.push(0.0);
        }
        let ends: Vec<f64> = starts.iter().copied().skip(1).chain(starts.first().map(|first| first + TAU)).collect();
        let arcs: Vec<Arc> = starts
            .into_iter()
            .zip(ends)
            .filter(|(start, end)| end - start > ROUNDING)
            .map(|(start, end)| Arc {
                start: Angle::from_rad(start),
                end: Angle::from_rad(end),
                coverage: coverage(0.5 * (start + end)),
            })
            .collect();
        let total = |zone| {
            let same = arcs.iter().filter(|arc| arc.coverage == zone);
            same.fold(Angle::default(), |sum, arc| sum + (arc.end - arc.start))
        };
        let zones =
            Zones { stereo: total(Coverage::Stereo), mono: total(Coverage::Mono), blind: total(Coverage::Blind) };
        Self { zones, arcs }
    }
}

impl Coverage {
    /// The coverage of a direction by which cameras see it.
    const fn of(left: bool, right: bool) -> Self {
        match (left, right) {
            (true, true) => Self::Stereo,
            (false, false) => Self::Blind,
            _ => Self::Mono,
        }
    }
}

/// Why the zones of a pair cannot be computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ZonesError {
    /// A position, angle or radius is infinite or not a number.
    #[error("a camera position, an angle or the radius is not a finite number")]
    NotFinite,
    /// A camera's optical centre is not inside the circle.
    #[error("a camera lies outside the viewing circle: enlarge the radius or reduce the baseline")]
    OutsideCircle,
    /// The number of directions on the sphere is zero.
    #[error("solid angles need at least one direction")]
    NoDirections,
    /// A half field is not in 0° to 180°.
    #[error("a half field must lie between 0° and 180°")]
    HalfField,
}

/// Arcs up to this length in radians are rounding errors where two ends meet, and are left out.
const ROUNDING: f64 = 1e-12;

/// Computes the exact zones of two cameras in the plane, on the circle of `radius` about the origin.
///
/// ```
/// # use vergence_vision::{Angle, Length, symmetric_pair, zones_exact};
/// let human = symmetric_pair(Length::from_mm(145.0), Angle::from_deg(0.0), Angle::from_deg(195.95));
/// let zones = zones_exact(human, Length::from_mm(3000.0))?.zones;
/// assert!(((zones.stereo + zones.mono + zones.blind).deg() - 360.0).abs() < 1e-9);
/// assert!(zones.stereo.deg() > 190.0);
/// # Ok::<(), vergence_vision::ZonesError>(())
/// ```
///
/// # Errors
/// [`ZonesError`] where the input is not finite, a camera is not inside the circle, or a half field is out of range.
pub fn zones_exact(cameras: [PlanarCamera; 2], radius: Length) -> Result<ZoneMap, ZonesError> {
    let [left, right] = cameras;
    let seen = [seen_arc(&left, radius)?, seen_arc(&right, radius)?];
    let cuts = [seen[0].start, seen[0].start + seen[0].width, seen[1].start, seen[1].start + seen[1].width];
    Ok(ZoneMap::from_cuts(&cuts, |azimuth| coverage(&seen, azimuth)))
}

/// Makes two equal cameras on a common baseline: the left one at -`baseline` / 2 with its axis at -`separation` / 2,
/// the right one mirrored.
///
/// `separation` is positive outwards and negative for toe-in; `field` is the full horizontal field.
#[must_use]
pub fn symmetric_pair(baseline: Length, separation: Angle, field: Angle) -> [PlanarCamera; 2] {
    [-0.5, 0.5].map(|side| PlanarCamera {
        centre_mm: [side * baseline.mm(), 0.0],
        axis: separation * side,
        half_field: field / 2.0,
    })
}

/// The arc of the circle that one camera sees, in radians.
struct SeenArc {
    start: f64,
    width: f64,
}

fn seen_arc(camera: &PlanarCamera, radius: Length) -> Result<SeenArc, ZonesError> {
    let ([x, y], axis, half_field, radius) =
        (camera.centre_mm, camera.axis.rad(), camera.half_field.rad(), radius.mm());
    if ![x, y, axis, half_field, radius].iter().all(|value| value.is_finite()) {
        return Err(ZonesError::NotFinite);
    }
    if x.hypot(y) >= radius {
        return Err(ZonesError::OutsideCircle);
    }
    if !(0.0..=PI).contains(&half_field) {
        return Err(ZonesError::HalfField);
    }
    let central = |azimuth: f64| azimuth + ((x * azimuth.cos() - y * azimuth.sin()) / radius).clamp(-1.0, 1.0).asin();
    let start = central(axis - half_field);
    Ok(SeenArc { start, width: central(axis + half_field) - start })
}

/// The coverage of the circle at the central angle `azimuth` in radians.
fn coverage(seen: &[SeenArc; 2], azimuth: f64) -> Coverage {
    let [left, right] = seen.each_ref().map(|arc| (azimuth - arc.start).rem_euclid(TAU) < arc.width);
    Coverage::of(left, right)
}
