//! The places that a verdict is asked for.

use std::fmt;
use std::str::FromStr;

use vergence_vision::{Angle, Length};

use crate::ray_field::RANGE_MM;

/// Where a verdict is told, and how well matches are registered.
///
/// ```
/// # use vergence_calibration_report::VerdictPlaces;
/// let places: VerdictPlaces = "350mm,1m at -40deg,0deg,40deg with 0.1px".parse()?;
/// assert_eq!((places.ranges.len(), places.angles.len(), places.pixel_sigma), (2, 3, 0.1));
/// # Ok::<(), vergence_calibration_report::InvalidPlaces>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct VerdictPlaces {
    /// Distances from the middle of the baseline, one at least; the sentence of a verdict speaks of the first.
    pub ranges: Vec<Length>,
    /// Directions from straight ahead in the plane of the baseline, towards the right camera's side.
    pub angles: Vec<Angle>,
    /// Standard deviation of each coordinate of a matched position, in pixels.
    pub pixel_sigma: f64,
}

/// Error of parsing [`VerdictPlaces`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' names no places: write them as '350mm,1m at -40deg,0deg,40deg with 0.1px'")]
pub struct InvalidPlaces(String);

impl Default for VerdictPlaces {
    /// 350 mm straight ahead, and matches good to 0.1 px.
    fn default() -> Self {
        Self { ranges: vec![Length::from_mm(RANGE_MM)], angles: vec![Angle::from_rad(0.0)], pixel_sigma: 0.1 }
    }
}

impl VerdictPlaces {
    pub(crate) fn first_range_mm(&self) -> f64 {
        self.ranges.first().map_or(RANGE_MM, |range| range.mm())
    }
}

impl FromStr for VerdictPlaces {
    type Err = InvalidPlaces;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        parse(text).ok_or_else(|| InvalidPlaces(text.to_owned()))
    }
}

fn parse(text: &str) -> Option<VerdictPlaces> {
    let (ranges, rest) = text.split_once(" at ")?;
    let (angles, pixels) = rest.split_once(" with ")?;
    let ranges: Vec<Length> = ranges.split(',').map(|range| range.parse().ok()).collect::<Option<_>>()?;
    let angles: Vec<Angle> = angles.split(',').map(|angle| angle.parse().ok()).collect::<Option<_>>()?;
    let pixel_sigma: f64 = pixels.trim().strip_suffix("px")?.trim().parse().ok()?;
    let sensible = ranges.iter().all(|range| range.mm() > 0.0)
        && angles.iter().all(|angle| angle.deg().abs() < 180.0)
        && pixel_sigma >= 0.0
        && pixel_sigma.is_finite();
    sensible.then_some(VerdictPlaces { ranges, angles, pixel_sigma })
}

impl fmt::Display for VerdictPlaces {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ranges: Vec<String> = self.ranges.iter().map(|range| format!("{}mm", range.mm())).collect();
        let angles: Vec<String> = self.angles.iter().map(|angle| format!("{}deg", angle.deg())).collect();
        write!(f, "{} at {} with {}px", ranges.join(","), angles.join(","), self.pixel_sigma)
    }
}
