//! Which lens the views ask for.
//!
//! The richest lens is fitted with what is known of lenses before any view (`prior`), and each group of its parameters is judged by what the fit
//! loses without it: the pupil's e0, its growth e1, and decentring with thin prism, which go together because one displaced element makes
//! both; and the bow of the target. All are judged by the scatter that the richest lens leaves, since what it explains is no scatter.
//!
//! Evidence is weighed for lenses as badly mounted as any; the fit that is left counts how badly this one is, as far as the views tell
//! (`mounting`).
//!
//! A group stays out only where the views tell that the lens has none of it. What they leave open stays an unknown with its prior: a lens
//! that passed as symmetric because few views did not show otherwise would be stated far more certain than it is.

use std::cell::RefCell;
use std::rc::Rc;

use vergence_vision::ImageSize;

use super::adjust::{Adjusted, EXACT, NEAR, State, Terms, deviations, inlier_fit};
use super::bundle::Bundle;
use super::foretold::Linear;
use super::lens::with_valid_cone;
use super::mounting::mounting;
use super::observations::ObservedView;
use super::prior::{BOW, Prior, Strength, narrowest};
use super::pupil;
use super::report::outermost;
use super::trial::{TEN, Trial, held_out_px, scatter};
use super::{IntrinsicsError, IntrinsicsOptions, LensModel, PupilEvidence, further};
use crate::Loss;
use crate::reprojection::POSE;
use crate::schur_lm::{SchurNormal, linearise};

/// Chi-squared by which the fit must get worse without parameters that count as found: of one unknown 5.5 standard deviations; of eight unknowns
/// chance gives it once in 5,000 calibrations.
pub(crate) const LEAST_GAIN: f64 = 30.0;
/// Chi-squared of the eight unknowns of an asymmetry that chance exceeds once in 100 calibrations of a symmetric lens.
const CHANCE_OF_ASYMMETRY: f64 = 20.1;
/// The same of the two unknowns of a bow.
const CHANCE_OF_BOW: f64 = 9.2;
/// A bow of so many millimetres moves corners of a tilted target by a tenth of a pixel at 350 mm.
const SMALL_BOW_MM: f64 = 0.1;

/// Parameters of lens or target that are fitted together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LensStep {
    /// The second coefficient e1 of the pupil.
    PupilGrowth,
    /// Decentring p1 to p4 and thin prism s0 to s3.
    Asymmetry,
    /// Terms k5 and k6 of the radius beyond θ⁹.
    FurtherTerms,
    /// The bow of the target, which a lens that fits it for flat takes into its own parameters.
    TargetBow,
}

/// What becomes of parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StepVerdict {
    /// The views show them.
    Found,
    /// The views do not tell: they are unknowns of the lens with what is known of any lens.
    NotTold,
    /// The views tell that the lens does not have them.
    Absent,
}

/// What the views say of parameters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StepEvidence {
    /// The parameters.
    pub step: LensStep,
    /// By how much chi-squared falls with them, in units of the scatter of the views that is left.
    pub gain: f64,
    /// Root mean square residual of the corners used, in pixels: without and with them.
    pub rms_px: [f64; 2],
    /// The same of views held out; `None` where the gain alone decides that they are not found.
    pub held_out_px: Option<[f64; 2]>,
    /// What becomes of them.
    pub verdict: StepVerdict,
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
    let is_start = options.model != LensModel::Central;
    let central_fit =
        |views, state, arrow| inlier_fit(views, state, Terms::central(options.warp).free(), None, (options, arrow));
    let central = central_fit(views, state, if is_start { &NEAR } else { &EXACT })?;
    let (whole, pupil) = (Terms::whole(options.warp), Terms::pupil(options.warp));
    let candidates = match options.model {
        LensModel::Central => Vec::new(),
        LensModel::MovingPupil => vec![pupil],
        LensModel::Full => vec![whole, pupil],
        LensModel::ByEvidence => vec![Terms::whole(true), whole, pupil],
    };
    // The richest lens may be one too many for a handful of corners.
    let richest = candidates.iter().find_map(|terms| Richest::of(&central, *terms, size, options));
    let none = Evidence { pupil: PupilEvidence::NotAsked, steps: Vec::new() };
    let (richer, mut evidence) = richest.map_or(Ok((None, none)), Richest::judged)?;
    let central_found = Found { terms: Terms::central(options.warp), prior: None };
    let found = richer.as_ref().map_or(central_found, |(_, found)| *found);
    let adjusted = match richer {
        Some((adjusted, _)) => adjusted,
        None if is_start => central_fit(central.views.clone(), central.state(), &EXACT)?.after(&central),
        None => central,
    };
    if options.model != LensModel::ByEvidence {
        return Ok((adjusted, evidence));
    }
    let (adjusted, further) = further::judged(adjusted, found, size, options);
    evidence.steps.extend(further);
    Ok((adjusted, evidence))
}

/// The lens that is found, before a radius of more terms is asked for.
#[derive(Clone, Copy)]
pub(super) struct Found {
    pub terms: Terms,
    pub prior: Option<Prior>,
}

/// The fit of the richest lens.
pub(super) struct Richest<'a> {
    adjusted: Adjusted,
    pub terms: Terms,
    prior: Prior,
    /// Variance of a residual, as the views scatter with this lens.
    pub variance: f64,
    pub options: &'a IntrinsicsOptions,
    before: Before,
    /// Whether the fit with one centre used the same corners.
    is_same: bool,
    /// The trials made.
    trials: RefCell<Vec<(Terms, Rc<Trial>)>>,
}

/// The equations of the richest lens where the one with one centre is: they foretell the lenses whose pupil does not move.
struct Before {
    state: State,
    free: Vec<usize>,
    normal: SchurNormal<POSE>,
}

impl Before {
    fn of(central: &Adjusted, terms: Terms, prior: Option<Strength>) -> Self {
        let (state, free) = (central.state(), terms.free());
        let references: Vec<_> = central.views.iter().collect();
        let problem = Bundle { prior, ..Bundle::of(&references, &free) };
        let normal = linearise(&problem, &state.shared, &state.poses, Loss::Squares);
        Self { state, free, normal }
    }

    fn linear(&self) -> Linear<'_> {
        Linear { shared: &self.state.shared, poses: &self.state.poses, free: &self.free, normal: &self.normal }
    }
}

impl<'a> Richest<'a> {
    /// `None` where the corners do not give one.
    fn of(central: &Adjusted, terms: Terms, size: ImageSize, options: &'a IntrinsicsOptions) -> Option<Self> {
        let rough = Prior { scatter: 1.0, mounting: 1.0 };
        let strength = rough.strength(&central.views, &deviations(&central.views, &central.state()));
        let before = Before::of(central, terms, strength);
        let first = Trial::fitted(central, &before.linear(), (terms, strength), TEN);
        let prior = Prior { scatter: scatter(&first.normal)?, ..rough };
        let start = first.linear().start(&central.views, terms, strength.map(|rough| rough.scaled(prior)));
        // With decentring and thin prism it is never the result: that has a prior by how badly the lens is mounted.
        let arrow = if terms.asymmetry { &NEAR } else { &EXACT };
        let adjusted = inlier_fit(central.views.clone(), start, terms.free(), Some(prior), (options, arrow));
        let adjusted = adjusted.ok()?.after(central);
        with_valid_cone(adjusted.shared.lens, outermost(&adjusted), size).ok()?;
        let variance = adjusted.normal.variance()? * scatter(&adjusted.normal)?.powi(2);
        let (is_same, trials) = (adjusted.uses_corners_of(central), RefCell::default());
        let richest = Self { adjusted, terms, prior, variance, options, before, is_same, trials };
        (variance > 0.0).then_some(richest)
    }

    /// The fit of a lens to the corners that this one used.
    pub fn trial(&self, terms: Terms) -> Rc<Trial> {
        let mut trials = self.trials.borrow_mut();
        if let Some((_, trial)) = trials.iter().find(|(of, _)| *of == terms) {
            return Rc::clone(trial);
        }
        // A pupil that does not move any more leaves the poses of the targets far from where they were.
        let from = if terms.e0 { (&self.adjusted.linear(), true) } else { (&self.before.linear(), self.is_same) };
        let trial = Rc::new(Trial::of(&self.adjusted, from, terms));
        trials.push((terms, Rc::clone(&trial)));
        trial
    }

    /// By how much chi-squared falls from one lens to the other.
    pub fn gain(&self, without: &Trial, with: &Trial) -> f64 {
        2.0 * (without.normal.cost() - with.normal.cost()) / self.variance
    }

    /// The residuals of views held out, without and with the parameters in question.
    pub fn held_out_px(&self, without: &Trial, with: &Trial) -> [f64; 2] {
        held_out_px(&self.adjusted, without, with)
    }

    /// The adjustment with the lens that is left, unless that has one centre, and the evidence.
    fn judged(self) -> Result<(Option<(Adjusted, Found)>, Evidence), IntrinsicsError> {
        let pupil = pupil::evidence(&self);
        let has_pupil = !matches!(pupil, PupilEvidence::Central { .. });
        let (mut terms, mut steps) =
            (Terms { e0: has_pupil, e1: has_pupil && self.terms.e1, ..self.terms }, Vec::new());
        if terms.e1 {
            steps.push(self.step(LensStep::PupilGrowth, Terms { e1: false, ..self.terms }));
        }
        if terms.asymmetry {
            let evidence = self.step(LensStep::Asymmetry, Terms { asymmetry: false, ..self.terms });
            terms.asymmetry = evidence.verdict != StepVerdict::Absent;
            steps.push(evidence);
        }
        if terms.bow && !self.options.warp {
            let evidence = self.step(LensStep::TargetBow, Terms { bow: false, ..self.terms });
            terms.bow = evidence.verdict != StepVerdict::Absent;
            steps.push(evidence);
        }
        let adjusted = if terms == Terms::central(self.options.warp) {
            None
        } else if terms == self.terms && !terms.asymmetry {
            Some((self.adjusted, Found { terms, prior: Some(self.prior) }))
        } else {
            let prior = Prior { mounting: mounting(&self.adjusted, self.variance).unwrap_or(1.0), ..self.prior };
            let strength = self.adjusted.strength.map(|strength| strength.mounted(prior));
            let start = self.adjusted.linear().start(&self.adjusted.views, terms, strength);
            let (views, arrow) = (self.adjusted.views.clone(), (self.options, &EXACT));
            let adjusted = inlier_fit(views, start, terms.free(), Some(prior), arrow)?.after(&self.adjusted);
            Some((adjusted, Found { terms, prior: Some(prior) }))
        };
        Ok((adjusted, Evidence { pupil, steps }))
    }

    fn step(&self, step: LensStep, without: Terms) -> StepEvidence {
        let [without, with] = [without, self.terms].map(|terms| self.trial(terms));
        let gain = self.gain(&without, &with);
        let held_out_px = (gain > LEAST_GAIN).then(|| self.held_out_px(&without, &with));
        let verdict = match held_out_px {
            Some([without, with]) if with <= without => StepVerdict::Found,
            None if self.is_absent(step, gain, &with) => StepVerdict::Absent,
            _ => StepVerdict::NotTold,
        };
        StepEvidence {
            step,
            gain,
            rms_px: [&without, &with].map(|lens| lens.rms_px(&self.adjusted)),
            held_out_px,
            verdict,
        }
    }

    /// Whether the views tell that there is none of it: as much as matters would have been found, whatever its direction, and no more is there
    /// than chance gives.
    fn is_absent(&self, step: LensStep, gain: f64, with: &Trial) -> bool {
        let (chance, left) = match step {
            LensStep::PupilGrowth | LensStep::FurtherTerms => return false,
            LensStep::Asymmetry => (CHANCE_OF_ASYMMETRY, narrowest(&self.adjusted, self.variance)),
            LensStep::TargetBow => {
                let sigma_mm = |parameter| with.sigma(parameter, self.variance);
                (CHANCE_OF_BOW, sigma_mm(BOW).zip(sigma_mm(BOW + 1)).map(|(x, y)| x.max(y) / SMALL_BOW_MM))
            }
        };
        let is_told = left.is_some_and(|left| left * LEAST_GAIN.sqrt() <= 1.0);
        self.options.model != LensModel::Full && gain <= chance && is_told
    }
}
