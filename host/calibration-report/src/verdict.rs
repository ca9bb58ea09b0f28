//! Verdicts: what a calibration is worth, in one sentence.

use vergence_calibration::StageCalibration;
use vergence_page::{fixed, significant};
use vergence_rig::{Mode, Rig};
use vergence_vision::Length;

use crate::depth::{DepthError, UncertainPair};
use crate::ray_field::RANGE_MM;

/// Half angle around straight ahead that the verdict covers; errors further towards the baseline are in the figures.
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
}

impl Verdict {
    pub(crate) const fn useless(sentence: String) -> Self {
        Self { sentence, depth_sigma: None, worst_sigma: None }
    }
}

/// Verdict of a pair.
pub(crate) fn of_depth(depth: &DepthError) -> Verdict {
    let range = fixed(RANGE_MM, 0);
    let Some(((direction, ahead), (worst_at, worst))) = depth.ahead().zip(depth.worst_within(CENTRAL_DEG)) else {
        return Verdict::useless(format!("Both cameras see nothing in common at {range} mm around straight ahead."));
    };
    let sentence = format!(
        "Good to {} mm at {range} mm {}; weakest within {}°: {} mm, {}.",
        significant(ahead, 2),
        place(direction),
        fixed(CENTRAL_DEG, 0),
        significant(worst, 2),
        to_the_side(worst_at)
    );
    Verdict { sentence, depth_sigma: Some(Length::from_mm(ahead)), worst_sigma: Some(Length::from_mm(worst)) }
}

fn place(direction: f64) -> String {
    if direction == 0.0 { "straight ahead".into() } else { format!("{}° from straight ahead", fixed(direction, 0)) }
}

fn to_the_side(direction: f64) -> String {
    let side = if direction < 0.0 { "left" } else { "right" };
    format!("{}° to the {side}", fixed(direction.abs(), 0))
}

/// The depth error of `stage` in each mode of `rig`; without modes, with all axes in the middle of their ranges.
pub(crate) fn in_modes(stage: &StageCalibration, rig: &Rig) -> Vec<(String, DepthError)> {
    let middle: Vec<_> = stage.middle();
    let modes = rig.modes.iter().map(|mode| (mode.name.clone(), &mode.targets));
    let poses =
        if rig.modes.is_empty() { vec![("the middle of the range".to_owned(), &middle)] } else { modes.collect() };
    let depth = |(name, readings): (String, &Vec<_>)| {
        let pose = stage.predict(readings);
        let pair = UncertainPair {
            left: &stage.left,
            right: &stage.right,
            left_from_right: pose.left_from_right,
            covariance: pose.covariance,
        };
        (name, DepthError::of(&pair, RANGE_MM))
    };
    poses.into_iter().map(depth).collect()
}

/// The depth error of a calibrated `rig` with a trunk in each of its modes, by its joints alone.
pub(crate) fn in_modes_of_rig(rig: &Rig) -> Vec<(String, DepthError)> {
    let depth = |mode: &Mode| {
        let values: Vec<f64> = mode.targets.iter().map(|target| target.value()).collect();
        let pose = rig.pose_read_at(&values);
        let pair = UncertainPair {
            left: &rig.left_camera,
            right: &rig.right_camera,
            left_from_right: pose.left_from_right,
            covariance: pose.covariance(),
        };
        (mode.name.clone(), DepthError::of(&pair, RANGE_MM))
    };
    rig.modes.iter().map(depth).collect()
}

/// Verdict of a calibrated stage in the modes of `rig`.
#[must_use]
pub fn stage_verdict(stage: &StageCalibration, rig: &Rig) -> Verdict {
    let open = match stage.observability.weak.len() {
        0 => String::new(),
        1 => " One combination of the mechanism's unknowns is known from the drawing only.".into(),
        more => format!(" {more} combinations of the mechanism's unknowns are known from the drawing only."),
    };
    of_modes(&in_modes(stage, rig), &open)
}

/// Verdict of a rig with a calibrated trunk in its modes.
#[must_use]
pub fn trunk_verdict(rig: &Rig) -> Verdict {
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
    of_modes(&in_modes_of_rig(rig), &note)
}

/// Verdict of the depth errors of several modes, and what else is to say.
fn of_modes(modes: &[(String, DepthError)], note: &str) -> Verdict {
    let ahead: Vec<(&str, f64)> =
        modes.iter().filter_map(|(name, depth)| Some((name.as_str(), depth.ahead()?.1))).collect();
    let weakest = modes
        .iter()
        .filter_map(|(name, depth)| Some((name, depth.worst_within(CENTRAL_DEG)?)))
        .max_by(|a, b| a.1.1.total_cmp(&b.1.1));
    let range = fixed(RANGE_MM, 0);
    let Some((mode, (worst_at, worst))) = weakest else {
        return Verdict::useless(format!("Both cameras see nothing in common at {range} mm around straight ahead."));
    };
    let mut sentence = String::from("Good to ");
    for (index, (name, mm)) in ahead.iter().enumerate() {
        let at = if index == 0 { format!(" at {range} mm") } else { String::new() };
        let comma = if index == 0 { "" } else { ", " };
        sentence += &format!("{comma}{} mm{at} in {name}", significant(*mm, 2));
    }
    sentence += &format!("; weakest: {mode}, {}, {} mm.{note}", to_the_side(worst_at), significant(worst, 2));
    let typical = ahead.iter().map(|(_, mm)| *mm).fold(0.0, f64::max);
    Verdict { sentence, depth_sigma: Some(Length::from_mm(typical)), worst_sigma: Some(Length::from_mm(worst)) }
}
