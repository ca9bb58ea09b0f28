//! Whether the pupil of the lens moves, as the views tell: the first step up the ladder of lenses.
//!
//! A lens whose pupil moves ([`vergence_vision::pupil_shift`]) leaves a central fit with residuals that hardly grow, and with poses of the
//! targets and a baseline that are wrong. Therefore the fit is made with and without the pupil's coefficient e0, and e0 is kept where
//! chi-squared falls by more than noise explains and views that were held out do not get worse.
//!
//! The prior of any lens goes with e0. Without it a lens that is not of the model's family borrows a pupil of centimetres from views that
//! hardly determine one. Targets that are all far away, or near the axis, show no pupil of ordinary size; then e0 is kept as an unknown
//! with that prior, so that it makes the covariance as large as the ignorance is.

use super::adjust::{Adjusted, PupilPrior, State, Terms, inlier_fit};
use super::lens::E0;
use super::observations::ObservedView;
use super::trial::{LEAST_GAIN, Trial, scatter};
use super::{IntrinsicsError, IntrinsicsOptions, LensModel};

/// A pupil with this e0 in millimetres is as small as one gets in lenses for cameras: twice a focal length of half a millimetre.
const SMALL_PUPIL_MM: f64 = 1.0;
/// Standard deviation of e0 before anything is known of the lens, in millimetres: twice the focal length of common lenses.
const PRIOR_MM: f64 = 3.0;

/// What the views say of the pupil.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PupilEvidence {
    /// It was not asked for.
    NotAsked,
    /// The lens is central as far as the views tell: a pupil that moves explains no more than noise.
    Central {
        /// By how much chi-squared would fall.
        gain: f64,
        /// Standard deviation of e0 in millimetres.
        sigma_mm: f64,
    },
    /// The pupil moves.
    Moves {
        /// By how much chi-squared falls.
        gain: f64,
        /// Root mean square residual of views held out, in pixels: central, and with the pupil.
        held_out_px: [f64; 2],
    },
    /// The views cannot tell a moving pupil from a fixed one: it counts as unknown.
    CannotTell {
        /// By how much chi-squared falls.
        gain: f64,
        /// Standard deviation of e0 in millimetres.
        sigma_mm: f64,
    },
}

/// The adjustment with the pupil that the options or the views ask for, what was found of it, and the prior of e0 if that is an unknown.
pub(super) fn fit(
    views: Vec<ObservedView>,
    state: State,
    options: &IntrinsicsOptions,
) -> Result<(Adjusted, PupilEvidence, Option<PupilPrior>), IntrinsicsError> {
    let free = |e0: bool| Terms { e0, ..Terms::default() }.free(options.warp);
    let central = inlier_fit(views, state, free(false), None, options)?;
    if options.model == LensModel::Central {
        return Ok((central, PupilEvidence::NotAsked, None));
    }
    let tried = scatter(&central.normal, central.prior_factor).and_then(|scatter| {
        let prior = PupilPrior { sigma_mm: PRIOR_MM, scatter };
        let trial = Trial::of(&central, free(true), Some(prior))?;
        Some((prior, trial.sigma(E0, scatter)?, trial))
    });
    let Some((prior, sigma_mm, trial)) = tried else {
        // With its prior e0 is always determined: the views do not determine the lens, which the report of it will say.
        return Ok((central, PupilEvidence::NotAsked, None));
    };
    let (gain, is_wanted) =
        (trial.gain(prior.scatter), matches!(options.model, LensModel::MovingPupil | LensModel::Full));
    let cannot_tell = sigma_mm * LEAST_GAIN.sqrt() > SMALL_PUPIL_MM;
    let evidence = if gain > LEAST_GAIN || is_wanted {
        let held_out_px = trial.held_out(&central);
        let is_kept = held_out_px[1] <= held_out_px[0] || is_wanted;
        is_kept.then_some(PupilEvidence::Moves { gain, held_out_px })
    } else {
        cannot_tell.then_some(PupilEvidence::CannotTell { gain, sigma_mm })
    };
    let Some(evidence) = evidence else { return Ok((central, PupilEvidence::Central { gain, sigma_mm }, None)) };
    let adjusted = trial.kept(central, Some(prior), options)?;
    Ok((adjusted, evidence, Some(prior)))
}
