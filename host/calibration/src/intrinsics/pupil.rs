//! Whether the pupil of the lens moves, as the views tell.
//!
//! A lens whose pupil moves ([`vergence_vision::pupil_shift`]) leaves a central fit with residuals that hardly grow, and with poses of the
//! targets and a baseline that are wrong. Therefore the fit is made with and without the pupil's coefficient e0, and e0 counts as found where
//! chi-squared falls by more than noise explains and views that were held out do not get worse.
//!
//! Targets that are all far away, or near the axis, show no pupil of ordinary size; then e0 is kept as an unknown with its prior, so that it
//! makes the covariance as large as the ignorance is.

use super::LensModel;
use super::adjust::Terms;
use super::ladder::{LEAST_GAIN, Richest};
use super::lens::E0;

/// A pupil with this e0 in millimetres is as small as one gets in lenses for cameras: twice a focal length of half a millimetre.
const SMALL_PUPIL_MM: f64 = 1.0;

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

/// What the views say of e0. Its growth e1 is left out of both fits: it would make e0 uncertain by as much as it is unknown.
pub(super) fn evidence(richest: &Richest<'_>) -> PupilEvidence {
    let is_wanted = matches!(richest.options.model, LensModel::MovingPupil | LensModel::Full);
    let [without, with] = [false, true].map(|e0| richest.trial(Terms { e0, e1: false, ..richest.terms }));
    let gain = richest.gain(&without, &with);
    // With its prior e0 is always determined.
    let sigma_mm = with.sigma(E0, richest.variance).unwrap_or(f64::INFINITY);
    if gain > LEAST_GAIN || is_wanted {
        let held_out_px = richest.held_out_px(&without, &with);
        if held_out_px[1] <= held_out_px[0] || is_wanted {
            return PupilEvidence::Moves { gain, held_out_px };
        }
        return PupilEvidence::CannotTell { gain, sigma_mm };
    }
    match sigma_mm * LEAST_GAIN.sqrt() > SMALL_PUPIL_MM {
        true => PupilEvidence::CannotTell { gain, sigma_mm },
        false => PupilEvidence::Central { gain, sigma_mm },
    }
}
