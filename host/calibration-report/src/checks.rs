//! Checks: each says what was found and, if that is not good, what to do. Below them the verdict that they stand under.

use vergence_calibration::Validation;
use vergence_page::{counted, escape, fixed, significant};

use crate::coverage::FieldCoverage;
use crate::image_frame::{OCTANTS, list, name};
use crate::pattern::Neighbours;

/// Result of a check.
pub(crate) struct Check {
    good: bool,
    text: String,
}

/// A view stands out if its residual exceeds this many times the median of all views.
const SUSPECT: f64 = 1.5;
/// Systematic residuals below this share of a corner's noise (both axes together) hardly matter.
const LITTLE: f64 = 0.35;
/// Most views or places that a sentence names.
const MOST_NAMES: usize = 3;
/// Share of corners left out above which more is wrong than the odd corner.
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

pub(crate) fn html(checks: &[Check]) -> String {
    let item = |check: &Check| {
        let (class, sign) = if check.good { ("good", "✓") } else { ("attention", "!") };
        format!("<li class=\"{class}\"><span class=\"sign\">{sign}</span> {}</li>\n", escape(&check.text))
    };
    format!("<ul class=\"checks\">\n{}</ul>\n", checks.iter().map(item).collect::<String>())
}

pub(crate) fn outliers(left_out: usize, total: usize) -> Check {
    let share = left_out as f64 / total.max(1) as f64;
    let found = format!("{left_out} of {} left out ({} %).", counted(total, "corner"), significant(100.0 * share, 2));
    if share <= FEW_OUTLIERS {
        Check::good(found)
    } else {
        Check::attention(format!("{found} That is more than chance: the list names their views."))
    }
}

/// Whether the residual of each view stands out.
pub(crate) fn suspects(rms_px: &[Option<f64>]) -> Vec<bool> {
    let median = vergence_vision::median(rms_px.iter().flatten().copied().collect());
    rms_px.iter().map(|rms| rms.zip(median).is_some_and(|(rms, median)| rms > SUSPECT * median)).collect()
}

/// Checks for views whose residuals stand out, by name.
pub(crate) fn views(rms_px: &[(String, Option<f64>)]) -> Check {
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
        "{} {verb} out with more than {SUSPECT} times the median residual: look at the {photograph} (blur, glare, a \
         bent target, corners counted wrongly).",
        list(&names)
    ))
}

/// Whether the systematic part of the residuals matters; `sigma_px` is the noise per axis.
pub(crate) fn is_pattern(pattern_px: f64, sigma_px: f64) -> bool {
    pattern_px > LITTLE * std::f64::consts::SQRT_2 * sigma_px
}

/// Checks that residuals are noise: that they agree neither with those of other views nearby in the image
/// (`pattern_px`) nor with their neighbours in the same view. `who` names the camera if there are two.
pub(crate) fn pattern(
    who: &str,
    pattern_px: Option<f64>,
    neighbours: Option<Neighbours>,
    sigma_px: f64,
) -> Option<Check> {
    let shared = neighbours.as_ref().map(Neighbours::shared_px);
    let size = significant(pattern_px.into_iter().chain(shared).reduce(f64::max)?, 2);
    let systematic = pattern_px.is_some_and(|pattern| is_pattern(pattern, sigma_px))
        || neighbours.is_some_and(|neighbours| neighbours.is_systematic());
    Some(if systematic {
        Check::attention(format!(
            "Residuals{who} are systematic: neighbours share {size} px. Likely causes: a target that is not flat (let \
             its bow be estimated), a camera or target that moved, or a lens that the model does not fit."
        ))
    } else {
        let shared = if size == "0" { "nothing".to_owned() } else { format!("only {size} px") };
        Check::good(format!("Residuals{who} look like noise: neighbours share {shared}."))
    })
}

/// Checks which part of the field the corners reach. `circle_known`: the limit of the field is known, it is not just
/// the sensor's border.
pub(crate) fn coverage(coverage: &FieldCoverage, circle_known: bool) -> Check {
    /// Gaps below this angle are covered by the margin of the valid cone.
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
        return Check::attention(format!("{covered} Show the target where the map of the coverage is red."));
    }
    let named: Vec<String> = gaps
        .iter()
        .take(MOST_NAMES)
        .map(|(place, _, outer)| format!("{}° ({})", fixed(*outer, 0), name(*place)))
        .collect();
    let reach = gaps.iter().take(MOST_NAMES).map(|gap| gap.1).fold(0.0, f64::max);
    let condition = if circle_known { "" } else { " if the lens's image reaches it" };
    Check::attention(format!(
        "{covered} No corners beyond {}, while the sensor sees up to {}° there{condition}: show the target near the \
         rim on these sides{}.",
        list(&named),
        fixed(reach, 0),
        if gaps.len() > MOST_NAMES { " first" } else { "" }
    ))
}

/// Whether the views of a pair disagree more than by chance: the ratio of ten views varies by 0.1.
pub(crate) fn is_scatter(view_scatter: f64) -> bool {
    view_scatter > 1.3
}

/// Checks that the views agree on the relative pose.
pub(crate) fn scatter(view_scatter: f64) -> Check {
    let times = significant(view_scatter, 2);
    if is_scatter(view_scatter) {
        Check::attention(format!(
            "The views disagree on the relative pose {times} times as much as the noise of their corners explains: \
             the lenses are not as given (let them move: --lenses known or free), the images of a pair were not taken \
             at the same instant, or the target bends. Standard deviations count it."
        ))
    } else {
        Check::good("The views agree on the relative pose as well as the noise of their corners explains.".to_owned())
    }
}

/// Whether the common shift of whole targets matters beside `rms_px`, the residual of all corners.
pub(crate) fn is_shift(shift_px: f64, rms_px: f64) -> bool {
    shift_px > LITTLE * rms_px
}

/// Checks the common shift of whole targets.
pub(crate) fn target_shift(shift_px: f64, rms_px: f64) -> Check {
    let size = significant(shift_px, 2);
    if is_shift(shift_px, rms_px) {
        Check::attention(format!(
            "Whole targets are off by {size} px rms: the cameras did not see them at the same instant, or a lens has \
             changed since. Put the target on a stand and trigger both cameras together."
        ))
    } else {
        Check::good(format!(
            "Both cameras agree on where the targets were: whole targets are off by {size} px rms only."
        ))
    }
}

/// Checks held-out views against `rms_px`, the residual of the views used.
pub(crate) fn held_out(validation: &Validation, rms_px: f64) -> Check {
    let found = format!(
        "Views that the calibration did not see fit to {} px rms, those that it saw to {} px ({} parts held out in turn).",
        significant(validation.rms_px, 3),
        significant(rms_px, 3),
        validation.folds
    );
    if validation.is_sound(rms_px) {
        Check::good(found)
    } else {
        Check::attention(format!("{found} The calibration fits its own views too closely: take more of them."))
    }
}

pub(crate) fn tilts(spread_deg: f64) -> Check {
    /// Z. Zhang, "A flexible new technique for camera calibration", PAMI 22(11), 2000, fig. 4: the errors are small
    /// from here on and least at 45°.
    const ENOUGH_DEG: f64 = 30.0;
    let spread = fixed(spread_deg, 0);
    if spread_deg >= ENOUGH_DEG {
        Check::good(format!("Targets differ in tilt by up to {spread}°."))
    } else {
        Check::attention(format!(
            "Targets differ in tilt by {spread}° only: tilt the target by 45° to tell focal length and distance apart."
        ))
    }
}

/// HTML of the verdict, its figures and the checks.
pub(crate) fn verdict(sentence: &str, explanation: &str, facts: &[(&str, String)], list: &[Check]) -> String {
    let class = if list.iter().all(Check::is_good) { "good" } else { "attention" };
    let fact =
        |(name, value): &(&str, String)| format!("<div><dt>{}</dt><dd>{}</dd></div>\n", escape(name), escape(value));
    format!(
        "<section class=\"verdict {class}\"><p class=\"sentence\">{}</p>\n<p>{}</p>\n<dl class=\"facts\">\n{}</dl>\n{}\
         </section>\n",
        escape(sentence),
        escape(explanation),
        facts.iter().map(fact).collect::<String>(),
        html(list)
    )
}
