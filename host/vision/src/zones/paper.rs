//! The zones published in the paper, for comparison.
//!
//! "Bio-inspired reconfigurable stereo vision for robotics using omnidirectional cameras".

use std::f64::consts::{PI, TAU};

use super::Zones;
use crate::{Angle, Length};

/// Horizontal field of view of the paper's lenses (Sec. II).
pub const PAPER_FIELD: Angle = Angle::from_deg(195.95);

/// A vision mode of the paper, with its printed figures and the nominal pose that explains them best.
///
/// The paper states neither baseline nor separation of the modes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PublishedMode {
    /// Name in the paper.
    pub name: &'static str,
    /// Printed stereo zone.
    pub stereo: Angle,
    /// Printed mono zone, or the printed total field less the stereo zone; `None` where the paper has neither.
    pub mono: Option<Angle>,
    /// Nominal distance of the optical centres.
    pub baseline: Length,
    /// Nominal angle between the optical axes, outward positive.
    pub separation: Angle,
    /// Radius of the circle on which the zones are measured.
    pub radius: Length,
}

/// The two modes of the paper's bench and the three of its robot.
pub const PUBLISHED_MODES: [PublishedMode; 5] = [
    PublishedMode::new("human", [193.0, f64::NAN], [0.0, 350.0]),
    PublishedMode::new("herbivore", [56.0, 209.0], [120.0, 350.0]),
    PublishedMode::new("gecko", [76.0, 207.0], [120.0, 3000.0]),
    PublishedMode::new("spider", [136.0, 87.0], [60.0, 3000.0]),
    PublishedMode::new("stick-bug", [140.0, 95.0], [-40.0, 3000.0]),
];

impl PublishedMode {
    /// Makes a mode from its zones in degrees, separation in degrees and radius in millimetres, at the bench's
    /// baseline.
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

/// Computes the zones by the paper's Eq. 3 as printed, for comparison with published figures.
///
/// For any other purpose use [`crate::zones_exact`]. With u = field - separation and b = baseline / (2 radius):
///
/// ```text
/// stereo = u [1 - b cot(u / 2)]        blind = u + 2 asin[b sin((π + u) / 2)]        mono = 2π - stereo - blind
/// ```
///
/// Inside its domain (see [`paper_eq3_applies`]) `stereo` is smaller than the exact value by up to 11°, and `blind` is
/// exact only for a field of 180°: the exact expression has 360° - field - separation in place of u. Outside the domain
/// the angles are meaningless, and may be negative or not a number.
#[must_use]
pub fn paper_eq3(field: Angle, separation: Angle, baseline: Length, radius: Length) -> Zones {
    let u = (field - separation).rad();
    let b = baseline.mm() / (2.0 * radius.mm());
    let stereo = u * (1.0 - b / (u / 2.0).tan());
    let blind = u + 2.0 * (b * ((PI + u) / 2.0).sin()).asin();
    let [stereo, mono, blind] = [stereo, TAU - stereo - blind, blind].map(Angle::from_rad);
    Zones { stereo, mono, blind }
}

/// Whether the arguments lie in the domain of [`paper_eq3`].
///
/// The domain is separation ≥ field - 180°, 0 < u ≤ 180° and radius ≥ (baseline / 2) cot(u / 2), the radius where the
/// inner edges of the fields cross. The paper prints tan in place of cot, which admits negative stereo angles.
#[must_use]
pub fn paper_eq3_applies(field: Angle, separation: Angle, baseline: Length, radius: Length) -> bool {
    let u = (field - separation).rad();
    let crossing = 0.5 * baseline.mm() / (u / 2.0).tan();
    u > 0.0 && u <= PI && radius.mm() > 0.5 * baseline.mm() && radius.mm() >= crossing
}
