//! Whether the radius of the lens has terms beyond θ⁹, as the views tell.
//!
//! They are asked for last, beside the lens that is found without them, and count only where they are found: chi-squared falls by more than
//! noise explains, in units of the scatter that is left with them, and views held out do not get worse. Else the lens stays as it is. No prior
//! says how large they are. Of most lenses the equations at the lens without them foretell that they gain too little, and no fit is made.

use vergence_vision::ImageSize;

use super::adjust::{Adjusted, EXACT, Terms, inlier_fit};
use super::bundle::Bundle;
use super::foretold::Linear;
use super::ladder::{Found, LEAST_GAIN};
use super::lens::with_valid_cone;
use super::report::outermost;
use super::trial::{Trial, held_out_px, scatter};
use super::{IntrinsicsOptions, LensStep, StepEvidence, StepVerdict};
use crate::Loss;
use crate::schur_lm::linearise;

/// The adjustment with further terms where the views show them, else as it was `found`, and the evidence; none where the corners do not
/// determine the terms.
pub(super) fn judged(
    adjusted: Adjusted,
    found: Found,
    size: ImageSize,
    options: &IntrinsicsOptions,
) -> (Adjusted, Option<StepEvidence>) {
    let Some((evidence, with)) = weighed(&adjusted, found.terms) else { return (adjusted, None) };
    if evidence.verdict != StepVerdict::Found {
        return (adjusted, Some(evidence));
    }
    let (views, free) = (adjusted.views.clone(), with.free.clone());
    match inlier_fit(views, with.state, free, found.prior, (options, &EXACT)) {
        Ok(longer) if with_valid_cone(longer.shared.lens, outermost(&longer), size).is_ok() => {
            (longer.after(&adjusted), Some(evidence))
        }
        // A radius that turns over inside the corners is that of no lens.
        _ => (adjusted, Some(StepEvidence { verdict: StepVerdict::Absent, ..evidence })),
    }
}

/// What the views say of the terms, and the fit with them.
fn weighed(adjusted: &Adjusted, terms: Terms) -> Option<(StepEvidence, Trial)> {
    let longer = Terms { further: true, ..terms };
    let (free, views): (_, Vec<_>) = (longer.free(), adjusted.views.iter().collect());
    let problem = Bundle { prior: adjusted.strength, ..Bundle::of(&views, &free) };
    let normal = linearise(&problem, &adjusted.shared, &adjusted.poses, Loss::Squares);
    let linear = Linear { shared: &adjusted.shared, poses: &adjusted.poses, free: &free, normal: &normal };
    linear.foretold(&problem)?;
    let [without, with] = [terms, longer].map(|terms| Trial::of(adjusted, (&linear, true), terms));
    let variance = with.normal.variance()? * scatter(&with.normal)?.powi(2);
    let gain = 2.0 * (without.normal.cost() - with.normal.cost()) / variance;
    let held_out_px = (gain > LEAST_GAIN).then(|| held_out_px(adjusted, &without, &with));
    let verdict = match held_out_px {
        Some([without, with]) if with <= without => StepVerdict::Found,
        _ => StepVerdict::Absent,
    };
    let rms_px = [&without, &with].map(|lens| lens.rms_px(adjusted));
    Some((StepEvidence { step: LensStep::FurtherTerms, gain, rms_px, held_out_px, verdict }, with))
}
