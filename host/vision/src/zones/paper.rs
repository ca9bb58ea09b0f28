//! The zones as published, to compare with.

use std::f64::consts::{PI, TAU};

use super::Zones;
use crate::{Angle, Length};

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
