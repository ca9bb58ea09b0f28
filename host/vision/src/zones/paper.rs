//! The zones as published, to compare with.

use std::f64::consts::{PI, TAU};

use super::Zones;
use crate::{Angle, Length};

/// Horizontal field of the paper's lenses, Sec. II.
pub const PAPER_FIELD: Angle = Angle::from_deg(195.95);

/// A vision mode of the paper: its figures, and the nominal pose that explains them best. The paper prints neither baseline
/// nor separation of the modes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PublishedMode {
    /// As the paper calls it.
    pub name: &'static str,
    /// Stereo zone as printed.
    pub stereo: Angle,
    /// Mono zone as printed, or total field less stereo zone; `None` where neither is.
    pub mono: Option<Angle>,
    /// Nominal distance of the optical centres.
    pub baseline: Length,
    /// Nominal angle between the optical axes, outward positive.
    pub separation: Angle,
    /// Of the circle on which the zones are told.
    pub radius: Length,
}

/// The two modes of the bench, and the three of the robot.
pub const PUBLISHED_MODES: [PublishedMode; 5] = [
    PublishedMode::new("human", [193.0, f64::NAN], [0.0, 350.0]),
    PublishedMode::new("herbivore", [56.0, 209.0], [120.0, 350.0]),
    PublishedMode::new("gecko", [76.0, 207.0], [120.0, 3000.0]),
    PublishedMode::new("spider", [136.0, 87.0], [60.0, 3000.0]),
    PublishedMode::new("stick-bug", [140.0, 95.0], [-40.0, 3000.0]),
];

impl PublishedMode {
    /// Degrees; the separation in degrees and the radius in millimetres, at the bench's baseline.
    const fn new(name: &'static str, [stereo, mono]: [f64; 2], [separation, radius]: [f64; 2]) -> Self {
        Self {
            name,
            stereo: Angle::from_deg(stereo),
            mono: if mono.is_nan() { None } else { Some(Angle::from_deg(mono)) },
            baseline: Length::from_mm(145.0),
            separation: Angle::from_deg(separation),
            radius: Length::from_mm(radius),
        }
    }
}

/// The zones by Eq. 3 of "Bio-inspired reconfigurable stereo vision for robotics using omnidirectional cameras", as
/// printed, to compare with published figures. For anything else use [`crate::zones_exact`].
///
/// With u = field - separation and b = baseline / (2 radius):
///
/// ```text
/// stereo = u [1 - b cot(u / 2)]        blind = u + 2 asin[b sin((π + u) / 2)]        mono = 2π - stereo - blind
/// ```
///
/// Inside its domain, see [`paper_eq3_applies`], `stereo` falls short of the exact value by up to 11°, and `blind` is exact
/// only for a field of 180°: the exact expression has 360° - field - separation for u. Outside it the angles mean nothing:
/// they may be negative or not a number.
#[must_use]
pub fn paper_eq3(field: Angle, separation: Angle, baseline: Length, radius: Length) -> Zones {
    let u = (field - separation).rad();
    let b = baseline.mm() / (2.0 * radius.mm());
    let stereo = u * (1.0 - b / (u / 2.0).tan());
    let blind = u + 2.0 * (b * ((PI + u) / 2.0).sin()).asin();
    let [stereo, mono, blind] = [stereo, TAU - stereo - blind, blind].map(Angle::from_rad);
    Zones { stereo, mono, blind }
}

/// Whether [`paper_eq3`] means anything: separation ≥ field - 180°, 0 < u ≤ 180° and radius ≥ (baseline / 2) cot(u / 2),
/// where the inner edges of the fields cross. (Printed with tan in place of cot, which admits negative stereo angles.)
#[must_use]
pub fn paper_eq3_applies(field: Angle, separation: Angle, baseline: Length, radius: Length) -> bool {
    let u = (field - separation).rad();
    let crossing = 0.5 * baseline.mm() / (u / 2.0).tan();
    u > 0.0 && u <= PI && radius.mm() > 0.5 * baseline.mm() && radius.mm() >= crossing
}
