//! Stereo, mono and blind zones of two cameras in the horizontal plane.
//!
//! The zones are arcs of a circle of some radius about the rig's centre, the viewpoint. Azimuth runs from forward (y),
//! positive to the right (x). A ray from the centre `c` of a camera with azimuth β meets the circle of radius R at the
//! central angle
//!
//! ```text
//! ψ(β) = β + asin((cx cos β - cy sin β) / R)
//! ```
//!
//! which grows with β while |c| < R. A camera with axis α and half field h therefore sees exactly the arc from ψ(α - h)
//! to ψ(α + h), whatever the toe-in and for lenses past 180°, and the zones follow from counting two intervals.
//!
//! [`circle_zones`] and [`solid_zones`] do without the plane: any two poses, the real lenses, and what the robot's body hides.

mod paper;
mod spatial;

use std::f64::consts::{PI, TAU};

pub use paper::{PAPER_FIELD, PUBLISHED_MODES, PublishedMode, paper_eq3, paper_eq3_applies};
pub use spatial::{BodyMask, Eye, SolidZones, circle_zones, solid_zones};

use crate::{Angle, Length};

/// A camera seen from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarCamera {
    /// Optical centre in millimetres: x to the right, y forward.
    pub centre_mm: [f64; 2],
    /// Azimuth of the optical axis from forward, positive to the right.
    pub axis: Angle,
    /// Half the horizontal field, from 0° to 180°.
    pub half_field: Angle,
}

/// How much of the circle two cameras, one, or none see. The three add up to 360°.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Zones {
    /// Seen by both cameras.
    pub stereo: Angle,
    /// Seen by one camera.
    pub mono: Angle,
    /// Seen by none.
    pub blind: Angle,
}

/// What an arc of the circle is seen by.
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
    /// Where it begins: central azimuth from forward, positive to the right, from 0° to 360°.
    pub start: Angle,
    /// Where it ends, never before `start`; the last arc may pass 360°.
    pub end: Angle,
    /// What sees it.
    pub coverage: Coverage,
}

/// The zones and the arcs they consist of.
#[derive(Clone, Debug, PartialEq)]
pub struct ZoneMap {
    /// Total angle of each zone.
    pub zones: Zones,
    /// Once around the circle in order of azimuth, each arc beginning where the one before ends.
    pub arcs: Vec<Arc>,
}

impl ZoneMap {
    /// The part of the stereo zone in the rear half of the circle: what both cameras see past each other's back.
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

    /// The map of a circle cut at `cuts` (central azimuths in radians), each part as `coverage` finds its middle.
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
    /// By who sees it.
    const fn of(left: bool, right: bool) -> Self {
        match (left, right) {
            (true, true) => Self::Stereo,
            (false, false) => Self::Blind,
            _ => Self::Mono,
        }
    }
}

/// Why a rig has no zones.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ZonesError {
    /// A position, angle or radius is infinite or not a number.
    #[error("a camera position, an angle or the radius is not a finite number")]
    NotFinite,
    /// A camera's optical centre is not inside the circle.
    #[error("a camera lies outside the viewing circle: enlarge the radius or reduce the baseline")]
    OutsideCircle,
    /// A sphere is not looked at in at least one direction.
    #[error("solid angles need at least one direction")]
    NoDirections,
    /// A half field is not in 0° to 180°.
    #[error("a half field must lie between 0° and 180°")]
    HalfField,
}

/// Arcs not longer than this are where two ends meet, in radians.
const ROUNDING: f64 = 1e-12;

/// The exact zones of any two cameras on the circle of `radius` about the origin.
///
/// # Errors
/// [`ZonesError`] where the input is not finite, a camera is not inside the circle, or a half field is out of range.
pub fn zones_exact(cameras: [PlanarCamera; 2], radius: Length) -> Result<ZoneMap, ZonesError> {
    let [left, right] = cameras;
    let seen = [seen_arc(&left, radius)?, seen_arc(&right, radius)?];
    let cuts = [seen[0].start, seen[0].start + seen[0].width, seen[1].start, seen[1].start + seen[1].width];
    Ok(ZoneMap::from_cuts(&cuts, |azimuth| coverage(&seen, azimuth)))
}

/// Two equal cameras on a common baseline: the left one at -`baseline` / 2 with its axis at -`separation` / 2, the
/// right one mirrored. `separation` is positive outwards and negative for toe-in; `field` is the full horizontal field.
#[must_use]
pub fn symmetric_pair(baseline: Length, separation: Angle, field: Angle) -> [PlanarCamera; 2] {
    [-0.5, 0.5].map(|side| PlanarCamera {
        centre_mm: [side * baseline.mm(), 0.0],
        axis: separation * side,
        half_field: field / 2.0,
    })
}

/// The part of the circle that one camera sees, in radians.
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

/// How many cameras see the circle at the central angle `azimuth` in radians.
fn coverage(seen: &[SeenArc; 2], azimuth: f64) -> Coverage {
    let [left, right] = seen.each_ref().map(|arc| (azimuth - arc.start).rem_euclid(TAU) < arc.width);
    Coverage::of(left, right)
}
