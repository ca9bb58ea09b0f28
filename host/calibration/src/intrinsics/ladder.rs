//! Steps from a lens with a pupil of one coefficient to richer ones, each taken where the views ask for it.
//!
//! A richer lens than needed makes depths less certain for nothing, so a step is kept only where chi-squared falls by more than noise
//! explains and views that were held out do not get worse. The pupil's second coefficient comes first, then decentring and thin prism
//! together, because one displaced element makes both. What a lens is not symmetric by can hide how its pupil moves, so the pupil gets a
//! second trial.

use vergence_vision::ImageSize;

use super::adjust::{Adjusted, PupilPrior, State, Terms};
use super::lens::with_valid_cone;
use super::observations::ObservedView;
use super::pupil;
use super::report::outermost;
use super::trial::{LEAST_GAIN, Trial};
use super::{IntrinsicsError, IntrinsicsOptions, LensModel, PupilEvidence};

/// Parameters that a lens gets together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LensStep {
    /// The second coefficient e1 of the pupil.
    PupilGrowth,
    /// Decentring p1, p2 and thin prism s0 to s3.
    Asymmetry,
}

/// What the views say of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepEvidence {
    /// The step.
    pub step: LensStep,
    /// By how much chi-squared falls with it, in units of the scatter of the views that is left.
    pub gain: f64,
    /// Root mean square residual of the corners used, in pixels: without and with it.
    pub rms_px: [f64; 2],
    /// The same of views held out; `None` where the gain alone decides against the step.
    pub held_out_px: Option<[f64; 2]>,
    /// Whether the lens got it.
    pub is_kept: bool,
}

/// What the views say of the lens.
pub(super) struct Evidence {
    pub pupil: PupilEvidence,
    pub steps: Vec<StepEvidence>,
}

/// The adjustment with the lens that the options or the views ask for.
pub(super) fn fit(
    views: Vec<ObservedView>,
    state: State,
    size: ImageSize,
    options: &IntrinsicsOptions,
) -> Result<(Adjusted, Evidence), IntrinsicsError> {
    let (mut adjusted, pupil, prior) = pupil::fit(views, state, options)?;
    let mut steps = Vec::new();
    let mut terms = Terms { e0: prior.is_some(), ..Terms::default() };
    if matches!(options.model, LensModel::Full | LensModel::ByEvidence) {
        for step in [LensStep::PupilGrowth, LensStep::Asymmetry, LensStep::PupilGrowth] {
            let Some(richer) = step.next(terms, &steps) else { continue };
            let evidence;
            (adjusted, evidence) = Attempt { step, richer, prior, size, options }.made(adjusted);
            if evidence.is_some_and(|evidence| evidence.is_kept) {
                terms = richer;
            }
            // A second trial says more than the first.
            steps.retain(|earlier: &StepEvidence| earlier.step != step);
            steps.extend(evidence);
        }
    }
    Ok((adjusted, Evidence { pupil, steps }))
}

impl LensStep {
    /// The lens with `terms` after this step; `None` where there is no trial to make: the lens has it, its pupil stays, or nothing changed
    /// since the last trial.
    fn next(self, terms: Terms, steps: &[StepEvidence]) -> Option<Terms> {
        match self {
            Self::PupilGrowth => {
                let is_news = steps.is_empty() || terms.asymmetry;
                (terms.e0 && !terms.e1 && is_news).then_some(Terms { e1: true, ..terms })
            }
            Self::Asymmetry => Some(Terms { asymmetry: true, ..terms }),
        }
    }
}

/// A step that may be taken.
struct Attempt<'a> {
    step: LensStep,
    /// The lens after it.
    richer: Terms,
    /// That of e0.
    prior: Option<PupilPrior>,
    size: ImageSize,
    options: &'a IntrinsicsOptions,
}

impl Attempt<'_> {
    /// The adjustment with the richer lens if the step is kept, else as it was. There is no evidence where the views do not determine it.
    fn made(&self, adjusted: Adjusted) -> (Adjusted, Option<StepEvidence>) {
        let Some(trial) = Trial::of(&adjusted, self.richer.free(self.options.warp), self.prior) else {
            return (adjusted, None);
        };
        // By the scatter that the richer lens leaves: what it explains is no scatter.
        let Some(gain) = trial.scatter().map(|scatter| trial.gain(scatter)) else { return (adjusted, None) };
        let (rms_px, is_asked_for) = (trial.rms_px(&adjusted), self.options.model == LensModel::Full);
        let held_out_px = (gain > LEAST_GAIN || is_asked_for).then(|| trial.held_out(&adjusted));
        let evidence = |is_kept: bool| Some(StepEvidence { step: self.step, gain, rms_px, held_out_px, is_kept });
        let is_better = held_out_px.is_some_and(|[without, with]| with <= without);
        if !is_better && !is_asked_for {
            return (adjusted, evidence(false));
        }
        match trial.kept(adjusted.clone(), self.prior, self.options) {
            Ok(kept) if self.is_a_lens(&kept) => (kept, evidence(true)),
            // A richer lens may be one too many for the corners that are left.
            _ => (adjusted, evidence(false)),
        }
    }

    fn is_a_lens(&self, adjusted: &Adjusted) -> bool {
        with_valid_cone(adjusted.shared.lens, outermost(adjusted), self.size).is_ok()
    }
}
