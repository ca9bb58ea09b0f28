//! Verdicts: what a calibration is worth, in one sentence, and at the places that were asked for.

use vergence_page::{fixed, significant};
use vergence_rig::{AxisPosition, Mode, Rig, RigPose};
use vergence_vision::{Angle, Length};

use crate::depth::{DepthError, PointError, UncertainPair};
use crate::places::VerdictPlaces;

/// Half angle around straight ahead that the sentence covers; errors further towards the baseline are in the figures.
const CENTRAL_DEG: f64 = 45.0;

/// The worth of a calibration in words for a person.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Such as "Good to 0.2 mm at 350 mm straight ahead; weakest ...".
    pub sentence: String,
    /// Typical standard deviation of depth; `None` if nothing can be measured.
    pub depth_sigma: Option<Length>,
    /// Standard deviation of depth where it is largest.
    pub worst_sigma: Option<Length>,
    /// The range that both hold for.
    pub range: Length,
    /// The places that were asked for; none for one lens.
    pub places: Vec<PlaceVerdict>,
}

/// The error of a point at one place, in one mode of the rig.
#[derive(Clone, Debug, PartialEq)]
pub struct PlaceVerdict {
    /// Name of the mode; empty for a fixed pair.
    pub mode: String,
    /// Distance from the middle of the baseline.
    pub range: Length,
    /// Direction from straight ahead, towards the right camera's side.
    pub angle: Angle,
    /// Standard deviations along the line of sight and across it, in the worse direction; `None` if a camera does not see it.
    pub sigma: Option<[Length; 2]>,
}

impl Verdict {
    pub(crate) fn new(sentence: String, sigma: Option<[f64; 2]>, range_mm: f64) -> Self {
        let [depth_sigma, worst_sigma] = [0, 1].map(|index: usize| sigma.map(|sigma| Length::from_mm(sigma[index])));
        Self { sentence, depth_sigma, worst_sigma, range: Length::from_mm(range_mm), places: Vec::new() }
    }

    /// The verdict as lines for people: the sentence, and one for each place.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let place = |place: &PlaceVerdict| {
            let mode = if place.mode.is_empty() { String::new() } else { format!("{}, ", place.mode) };
            let at = format!("  {mode}{} mm, {}°", fixed(place.range.mm(), 0), fixed(place.angle.deg(), 0));
            match place.sigma.map(|sigma| sigma.map(|sigma| significant(sigma.mm(), 2))) {
                Some([along, across]) => format!("{at}: {along} mm along the line of sight, {across} mm across"),
                None => format!("{at}: not seen by both cameras"),
            }
        };
        std::iter::once(self.sentence.clone()).chain(self.places.iter().map(place)).collect()
    }
}

/// A mode of a rig, with both cameras and all that is uncertain of them.
pub(crate) struct ModeError<'a> {
    pub name: String,
    pair: UncertainPair<'a>,
    pub depth: DepthError,
}

/// The errors of `rig` in each of its modes, at rest; of a rig with axes but no modes, with all axes in the middle of their ranges.
pub(crate) fn in_modes<'a>(rig: &'a Rig, places: &VerdictPlaces) -> Vec<ModeError<'a>> {
    let of = |name: &str, pose: &RigPose| {
        let pair = UncertainPair::of(rig, pose, places.pixel_sigma);
        let depth = DepthError::of(&pair, places.first_range_mm());
        ModeError { name: name.to_owned(), pair, depth }
    };
    let values = |mode: &Mode| mode.targets.iter().map(|target| target.value()).collect::<Vec<f64>>();
    if !rig.modes.is_empty() {
        return rig.modes.iter().map(|mode| of(&mode.name, &rig.pose_read_at(&values(mode)))).collect();
    }
    let middle: Vec<f64> =
        rig.axes.iter().map(|axis| 0.5 * axis.range.map(AxisPosition::value).iter().sum::<f64>()).collect();
    let name = if rig.axes.is_empty() { "" } else { "the middle of the range" };
    vec![of(name, &rig.pose_read_at(&middle))]
}

/// Verdict of a calibrated rig in its modes, with `note` behind the sentence.
pub(crate) fn of_rig(rig: &Rig, places: &VerdictPlaces, note: &str) -> Verdict {
    let modes = in_modes(rig, places);
    let range_mm = places.first_range_mm();
    let range = fixed(range_mm, 0);
    let weakest = modes
        .iter()
        .filter_map(|mode| Some((mode.name.as_str(), mode.depth.worst_within(CENTRAL_DEG)?)))
        .max_by(|a, b| a.1.1.along.total_cmp(&b.1.1.along));
    let verdict = match weakest {
        None => {
            let nothing = format!("Both cameras see nothing in common at {range} mm around straight ahead.");
            Verdict::new(nothing, None, range_mm)
        }
        Some((weakest, (worst_at, worst))) => {
            let ahead: Vec<_> =
                modes.iter().filter_map(|mode| Some((mode.name.as_str(), mode.depth.ahead()?))).collect();
            let parts: Vec<String> = ahead.iter().map(|(name, error)| good_to(name, *error)).collect();
            let weakest = if weakest.is_empty() { String::new() } else { format!("{weakest}, ") };
            let sentence = format!(
                "Good to {} at {range} mm, along and across the line of sight, with matches good to {} px; weakest \
                 within {}°: {weakest}{}, {} mm along.{note}",
                parts.join(", "),
                significant(places.pixel_sigma, 2),
                fixed(CENTRAL_DEG, 0),
                to_the_side(worst_at),
                significant(worst.along, 2),
            );
            let typical = ahead.iter().map(|(_, (_, error))| error.along).fold(0.0, f64::max);
            Verdict::new(sentence, Some([typical, worst.along]), range_mm)
        }
    };
    let places = modes.iter().flat_map(|mode| asked(mode, places)).collect();
    Verdict { places, ..verdict }
}

/// The errors of one mode at the places asked for.
fn asked(mode: &ModeError<'_>, places: &VerdictPlaces) -> Vec<PlaceVerdict> {
    let at = |range: Length, angle: Angle| {
        let found = mode.pair.at(range.mm(), angle.deg());
        let sigma = found.map(|PointError { along, across }| [along, across].map(Length::from_mm));
        PlaceVerdict { mode: mode.name.clone(), range, angle, sigma }
    };
    places.ranges.iter().flat_map(|&range| places.angles.iter().map(move |&angle| at(range, angle))).collect()
}

fn good_to(mode: &str, (direction, error): (f64, PointError)) -> String {
    let place =
        if direction == 0.0 { String::new() } else { format!(" {}° from straight ahead", fixed(direction, 0)) };
    let mode = if mode.is_empty() { String::new() } else { format!(" in {mode}") };
    format!("{} and {} mm{mode}{place}", significant(error.along, 2), significant(error.across, 2))
}

fn to_the_side(direction: f64) -> String {
    let side = if direction < 0.0 { "left" } else { "right" };
    format!("{}° to the {side}", fixed(direction.abs(), 0))
}

/// Verdict of a rig with a calibrated trunk in its modes.
#[must_use]
pub fn trunk_verdict(rig: &Rig, places: &VerdictPlaces) -> Verdict {
    let near = |mode: &&Mode| {
        let values: Vec<f64> = mode.targets.iter().map(|target| target.value()).collect();
        rig.trunk.as_ref().is_some_and(|trunk| trunk.is_near_dead_centre(&values))
    };
    let names: Vec<&str> = rig.modes.iter().filter(near).map(|mode| mode.name.as_str()).collect();
    let note = match names.as_slice() {
        [] => String::new(),
        names => format!(
            " Near a dead centre ({}) joints tell little: there a cloud's pose comes from its images.",
            names.join(", ")
        ),
    };
    of_rig(rig, places, &note)
}
