//! What a person should look at: each check says what was found and, where it is not good, what to do.

use vergence_page::{counted, escape, fixed, significant};

use super::coverage::FieldCoverage;
use super::places::{OCTANTS, list, name};
use crate::Validation;

/// A finding.
pub(super) struct Check {
    good: bool,
    text: String,
}

/// A view with a residual this many times the views' median is worth a look at its photograph.
const SUSPECT: f64 = 1.5;
/// What agrees among neighbours hardly matters below this share of a corner's noise, both axes together.
const LITTLE: f64 = 0.35;
/// Sentences name so many views or places.
const MOST_NAMES: usize = 3;
/// More corners left out than this share mean that something is wrong besides the odd corner.
const FEW_OUTLIERS: f64 = 0.02;

impl Check {
    pub fn good(text: String) -> Self {
        Self { good: true, text }
    }

    pub fn attention(text: String) -> Self {
        Self { good: false, text }
    }

    pub fn is_good(&self) -> bool {
        self.good
    }
}

pub(super) fn html(checks: &[Check]) -> String {
    let item = |check: &Check| {
        let (class, sign) = if check.good { ("good", "✓") } else { ("attention", "!") };
        format!("<li class=\"{class}\"><span class=\"sign\">{sign}</span> {}</li>\n", escape(&check.text))
    };
    format!("<ul class=\"checks\">\n{}</ul>\n", checks.iter().map(item).collect::<String>())
}

pub(super) fn outliers(left_out: usize, total: usize) -> Check {
    let share = left_out as f64 / total.max(1) as f64;
    let found = format!("{left_out} of {} left out ({} %).", counted(total, "corner"), significant(100.0 * share, 2));
    if share <= FEW_OUTLIERS {
        Check::good(found)
    } else {
        Check::attention(format!("{found} That is more than chance: see the list for the views that they come from."))
    }
}

/// Whether a view's residual stands out from all of them.
pub(super) fn suspects(rms_px: &[Option<f64>]) -> Vec<bool> {
    let median = crate::median(rms_px.iter().flatten().copied().collect());
    rms_px.iter().map(|rms| rms.zip(median).is_some_and(|(rms, median)| rms > SUSPECT * median)).collect()
}

/// On views whose residuals stand out, by name.
pub(super) fn views(rms_px: &[(String, Option<f64>)]) -> Check {
    let flags = suspects(&rms_px.iter().map(|(_, rms)| *rms).collect::<Vec<_>>());
    let mut found: Vec<_> = rms_px.iter().zip(flags).filter(|(_, suspect)| *suspect).map(|(view, _)| view).collect();
    found.sort_by(|a, b| b.1.unwrap_or(0.0).total_cmp(&a.1.unwrap_or(0.0)));
    if found.is_empty() {
        return Check::good("No view stands out: all fit about equally well.".to_owned());
    }
    let mut names: Vec<String> = found.iter().take(MOST_NAMES).map(|(name, _)| name.clone()).collect();
    if found.len() > MOST_NAMES {
        names.push(format!("{} more", found.len() - MOST_NAMES));
    }
    let (verb, photograph) = if found.len() == 1 { ("stands", "photograph") } else { ("stand", "photographs") };
    Check::attention(format!(
        "{} {verb} out with more than {SUSPECT} times the median residual: look at the {photograph} (blur, glare, a bent \
         board, corners counted wrongly).",
        list(&names)
    ))
}

/// Whether so much of the residuals agrees with its neighbours that it matters; `sigma_px` is the noise per axis.
pub(super) fn is_pattern(pattern_px: f64, sigma_px: f64) -> bool {
    pattern_px > LITTLE * std::f64::consts::SQRT_2 * sigma_px
}

/// On residuals that agree with their neighbours; `who` says whose, if there is a choice.
pub(super) fn pattern(who: &str, pattern_px: Option<f64>, sigma_px: f64) -> Option<Check> {
    let pattern = pattern_px?;
    let size = significant(pattern, 2);
    Some(if is_pattern(pattern, sigma_px) {
        Check::attention(format!(
            "{size} px of the residuals{who} agree with their neighbours. That is no noise: a board that is not flat (let \
             its bow be estimated), a moving camera, or a lens that the model does not fit."
        ))
    } else {
        Check::good(format!("Residuals{who} look like noise: neighbours agree in {size} px only."))
    })
}

/// On the part of the field that corners do not reach. `circle_known`: the sensor's border is not the limit.
pub(super) fn coverage(coverage: &FieldCoverage, circle_known: bool) -> Check {
    /// Less than this is filled by the margin of the valid cone.
    const GAP_DEG: f64 = 10.0;
    let (empty, cells) = coverage.empty();
    let covered = format!("Corners in {} of {cells} parts of the field.", cells - empty);
    let mut gaps: Vec<(usize, f64, f64)> = (0..OCTANTS)
        .zip(coverage.reach())
        .map(|(place, (reach, outermost))| (place, reach.to_degrees(), outermost.to_degrees()))
        .filter(|(_, reach, outermost)| reach - outermost > GAP_DEG)
        .collect();
    gaps.sort_by(|a, b| (b.1 - b.2).total_cmp(&(a.1 - a.2)));
    if gaps.is_empty() && empty == 0 {
        return Check::good(covered);
    }
    if gaps.is_empty() {
        return Check::attention(format!("{covered} Show the board where the map of the coverage is red."));
    }
    let named: Vec<String> = gaps
        .iter()
        .take(MOST_NAMES)
        .map(|(place, _, outer)| format!("{}° ({})", fixed(*outer, 0), name(*place)))
        .collect();
    let reach = gaps.iter().take(MOST_NAMES).map(|gap| gap.1).fold(0.0, f64::max);
    let condition = if circle_known { "" } else { " if the lens's image reaches it" };
    Check::attention(format!(
        "{covered} No corners beyond {}, while the sensor sees up to {}° there{condition}: show the board near the rim on \
         these sides{}.",
        list(&named),
        fixed(reach, 0),
        if gaps.len() > MOST_NAMES { " first" } else { "" }
    ))
}

/// Whether boards are off as a whole by so much that it matters, against `rms_px` of all residuals.
pub(super) fn is_shift(shift_px: f64, rms_px: f64) -> bool {
    shift_px > LITTLE * rms_px
}

/// On boards that are off as a whole.
pub(super) fn board_shift(shift_px: f64, rms_px: f64) -> Check {
    let size = significant(shift_px, 2);
    if is_shift(shift_px, rms_px) {
        Check::attention(format!(
            "Whole boards are off by {size} px rms: the cameras did not see them at the same instant, or a lens has changed \
             since. Put the board on a stand and trigger both cameras together."
        ))
    } else {
        Check::good(format!("Both cameras agree on where the boards were: whole boards are off by {size} px rms only."))
    }
}

/// On views that the calibration did not see, against `rms_px` of those that it did.
pub(super) fn held_out(validation: &Validation, rms_px: f64) -> Check {
    let found = format!(
        "Views that the calibration did not see fit to {} px rms, those that it saw to {} px ({} parts held out in turn).",
        significant(validation.rms_px, 3),
        significant(rms_px, 3),
        validation.folds
    );
    if validation.is_sound(rms_px) {
        Check::good(found)
    } else {
        Check::attention(format!("{found} The calibration fits its views better than the world: take more of them."))
    }
}

pub(super) fn tilts(spread_deg: f64) -> Check {
    /// Z. Zhang, "A flexible new technique for camera calibration", PAMI 22(11), 2000, fig. 4: the errors are small
    /// from here on and least at 45°.
    const ENOUGH_DEG: f64 = 30.0;
    let spread = fixed(spread_deg, 0);
    if spread_deg >= ENOUGH_DEG {
        Check::good(format!("Boards differ in tilt by up to {spread}°."))
    } else {
        Check::attention(format!(
            "Boards differ in tilt by {spread}° only: tilt the board by 45° to tell focal length and distance apart."
        ))
    }
}
