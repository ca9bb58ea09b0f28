//! Whether the pupil of the lens moves, as the views tell.
//!
//! A lens whose pupil moves ([`vergence_vision::pupil_shift`]) leaves a central fit with residuals that hardly grow, and with poses of the
//! targets and a baseline that are wrong. Therefore the fit is made with and without the pupil's coefficient e0, and e0 is kept where
//! chi-squared falls by more than noise explains and views that were held out do not get worse.
//!
//! The prior of any lens goes with e0. Without it a lens that is not of the model's family borrows a pupil of centimetres from views that
//! hardly determine one. Targets that are all far away, or near the axis, show no pupil of ordinary size; then e0 is kept as an unknown
//! with that prior, so that it makes the covariance as large as the ignorance is.

use std::fmt;
use std::str::FromStr;

use super::adjust::{Adjusted, PupilPrior, State, free_parameters, inlier_fit};
use super::bundle::{Bundle, Shared};
use super::lens::CENTRAL;
use super::observations::ObservedView;
use super::{IntrinsicsError, IntrinsicsOptions};
use crate::schur_lm::{SchurOptions, solve};

/// Chi-squared of one unknown by which a richer lens must fit better: 5.5 standard deviations.
const LEAST_GAIN: f64 = 30.0;
/// A pupil with this e0 in millimetres is as small as one gets in lenses for cameras: twice a focal length of half a millimetre.
const SMALL_PUPIL_MM: f64 = 1.0;
/// Standard deviation of e0 before anything is known of the lens, in millimetres: twice the focal length of common lenses.
const PRIOR_MM: f64 = 3.0;

/// Whether a lens has a pupil that moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LensModel {
    /// All rays go through one point.
    Central,
    /// The pupil moves, whatever the views say.
    MovingPupil,
    /// As the views say.
    #[default]
    ByEvidence,
}

/// A word that names no model of a lens.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is no model of a lens: central, moving-pupil or by-evidence")]
pub struct UnknownLensModel(String);

impl fmt::Display for LensModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Central => "central",
            Self::MovingPupil => "moving-pupil",
            Self::ByEvidence => "by-evidence",
        })
    }
}

impl FromStr for LensModel {
    type Err = UnknownLensModel;

    fn from_str(text: &str) -> Result<Self, UnknownLensModel> {
        [Self::Central, Self::MovingPupil, Self::ByEvidence]
            .into_iter()
            .find(|model| model.to_string() == text)
            .ok_or_else(|| UnknownLensModel(text.to_owned()))
    }
}

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

/// The adjustment with the lens that the options or the views ask for.
pub(super) fn fit(
    views: Vec<ObservedView>,
    state: State,
    options: &IntrinsicsOptions,
) -> Result<(Adjusted, PupilEvidence), IntrinsicsError> {
    let free = |pupil: bool| free_parameters(pupil, options.warp);
    let central = inlier_fit(views, state, free(false), None, options)?;
    if options.model == LensModel::Central {
        return Ok((central, PupilEvidence::NotAsked));
    }
    let Some(Trial { gain, sigma_mm, state, prior }) = Trial::of(&central, free(true)) else {
        // With its prior e0 is always determined: the views do not determine the lens, which the report of it will say.
        return Ok((central, PupilEvidence::NotAsked));
    };
    let cannot_tell = sigma_mm * LEAST_GAIN.sqrt() > SMALL_PUPIL_MM;
    let evidence = if gain > LEAST_GAIN || options.model == LensModel::MovingPupil {
        let held_out_px = held_out(&central, &state, [free(false), free(true)]);
        let is_kept = held_out_px[1] <= held_out_px[0] || options.model == LensModel::MovingPupil;
        is_kept.then_some(PupilEvidence::Moves { gain, held_out_px })
    } else {
        cannot_tell.then_some(PupilEvidence::CannotTell { gain, sigma_mm })
    };
    let Some(evidence) = evidence else { return Ok((central, PupilEvidence::Central { gain, sigma_mm })) };
    let adjusted = inlier_fit(central.views, state, free(true), Some(prior), options)?;
    // Views that the central fit dropped stay dropped.
    let outliers = central.outliers.into_iter().chain(adjusted.outliers).collect();
    Ok((Adjusted { outliers, ..adjusted }, evidence))
}

/// A fit with the pupil to the corners that the central fit used.
struct Trial {
    /// By how much chi-squared falls, in units of the scatter of the views, which a lens of another family makes larger than noise.
    gain: f64,
    /// Standard deviation of e0, with the prior, in the same units.
    sigma_mm: f64,
    state: State,
    prior: PupilPrior,
}

impl Trial {
    fn of(central: &Adjusted, free: &[usize]) -> Option<Self> {
        let references: Vec<_> = central.views.iter().collect();
        let start = central.state();
        let scatter = central.normal.clustered(central.normal.variance()?)?.scatter;
        let prior = PupilPrior { sigma_mm: PRIOR_MM, scatter };
        let pupil_pull = prior.pull(&central.views, &start);
        let problem = Bundle { pupil_pull, ..Bundle::of(&references, free) };
        let solution = solve(&problem, start.shared, start.poses, &SchurOptions::default());
        let variance = solution.normal.variance()? * scatter * scatter;
        let pupil = free.iter().position(|&parameter| parameter == CENTRAL)?;
        let sigma_mm = (solution.normal.shared_covariance()?[(pupil, pupil)] * variance).sqrt();
        let gain = 2.0 * (central.normal.cost() - solution.cost) / variance;
        let state = State { shared: solution.shared, poses: solution.blocks };
        (sigma_mm.is_finite() && gain.is_finite()).then_some(Self { gain, sigma_mm, state, prior })
    }
}

/// Root mean square residuals in pixels of each half of the views, by the lens that the other half gives with the parameters in `frees`.
/// The poses of the targets are fitted to the half that is judged.
fn held_out(central: &Adjusted, moving: &State, frees: [&[usize]; 2]) -> [f64; 2] {
    let starts = [central.shared, moving.shared];
    let half = |odd: usize| {
        let chosen = central.views.iter().zip(&central.poses).enumerate().filter(move |(index, _)| index % 2 == odd);
        chosen.map(|(_, (view, pose))| (view, *pose)).unzip::<_, _, Vec<_>, Vec<_>>()
    };
    let halves = [half(0), half(1)];
    let of = |(free, start): (&[usize], Shared)| {
        let (mut squares, mut count) = (0.0, 0);
        for (fitted, judged) in [(0, 1), (1, 0)] {
            let [(views, poses), (others, other_poses)] = [&halves[fitted], &halves[judged]];
            let lens = solve(&Bundle::of(views, free), start, poses.clone(), &SchurOptions::default()).shared;
            let seen = solve(&Bundle::of(others, &[]), lens, other_poses.clone(), &SchurOptions::default());
            squares += 2.0 * seen.cost;
            count += others.iter().map(|view| view.used().count()).sum::<usize>();
        }
        (squares / count as f64).sqrt()
    };
    [0, 1].map(|i| of((frees[i], starts[i])))
}
