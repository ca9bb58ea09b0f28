//! Pairs calibrated at the pose where they measure, as the paper's methods need them: from targets before the rig, once by the
//! rays of the fisheye pictures and once on undistorted pictures.

use rayon::prelude::*;
use vergence_calibration::{ExtrinsicsOptions, FEWEST_VIEWS, StereoView, calibrate_extrinsics, target_pose};
use vergence_sim::Random;
use vergence_targets::TargetView;
use vergence_vision::{KannalaBrandt, Left, Right, Transform};

use crate::eyes::Eyes;
use crate::pinhole_pair::{PinholePair, PinholeView};
use crate::target_shot::{FoundCorners, in_both};
use crate::targets::{Spread, targets};
use crate::undistort::Pinhole;

/// Targets that the pair of a mode is calibrated from.
pub const PAIR_VIEWS: usize = 10;
/// They are held about where the bench measures, turned more.
const SPREAD: Spread = Spread { targets: PAIR_VIEWS, depth_mm: [300.0, 450.0], tilt_rad: 0.5 };

/// The calibrations of a pair at one pose.
#[derive(Clone, Debug)]
pub struct Pair {
    /// By bundles of rays (K. Arun et al., 1987); `None` where fewer than three targets were seen by both cameras.
    pub bundles: Option<Transform<Left, Right>>,
    /// On undistorted pictures; `None` likewise.
    pub pinholes: Option<PinholePair>,
    /// Targets whose labelled corners both cameras have: in the fisheye pictures, and in the undistorted ones.
    pub views: [usize; 2],
}

/// Fewest corners that a picture must have in common with the other for the target to count.
const FEWEST_CORNERS: usize = 12;

/// One target as both cameras have it: in the fisheye and in the undistorted pictures.
struct Seen {
    fisheye: [Option<FoundCorners>; 2],
    undistorted: [Option<FoundCorners>; 2],
}

impl Pair {
    /// Calibrates the pair where the stage stands, with the lenses that are `known`.
    pub fn calibrated(
        eyes: &Eyes<'_>,
        left_from_right: &Transform<Left, Right>,
        known: &[KannalaBrandt; 2],
        random: &mut Random,
    ) -> Self {
        let standing = eyes.conditions.returned(left_from_right, random);
        let seed = random.seed();
        let seen: Vec<Seen> = targets(left_from_right, &SPREAD, random)
            .par_iter()
            .enumerate()
            .map(|(index, target)| {
                let photos = eyes.photographs(&standing, target, seed ^ index as u64);
                let photo = |side: usize| photos[side].as_ref();
                Seen {
                    fisheye: [0, 1].map(|side| photo(side)?.found(Some(&known[side]))),
                    undistorted: [0, 1].map(|side| photo(side)?.undistorted(&Pinhole::of(&known[side]))),
                }
            })
            .collect();
        let bundles = by_bundles(&seen, known);
        let (views, pinholes) = on_undistorted(&seen, known, bundles.as_ref());
        Self { bundles, pinholes, views: [seen.iter().filter(|seen| both(&seen.fisheye).is_some()).count(), views] }
    }
}

/// Both, where their labels are certain.
fn both(found: &[Option<FoundCorners>; 2]) -> Option<[&TargetView; 2]> {
    let labelled = |side: usize| found[side].as_ref().filter(|found: &&FoundCorners| found.labelled);
    Some([&labelled(0)?.view, &labelled(1)?.view])
}

fn by_bundles(seen: &[Seen], known: &[KannalaBrandt; 2]) -> Option<Transform<Left, Right>> {
    let views: Vec<StereoView> = seen
        .iter()
        .filter_map(|seen| both(&seen.fisheye))
        .enumerate()
        .map(|(index, [left, right])| StereoView {
            name: format!("view {}", index + 1),
            left: left.clone(),
            right: right.clone(),
        })
        .collect();
    let pair = calibrate_extrinsics(&known[0], &known[1], &views, &ExtrinsicsOptions::default()).ok()?;
    Some(pair.arun.left_from_right)
}

/// How many targets both undistorted pictures show, and the pair that they give. `start` and the poses of the targets in the
/// fisheye pictures are where the fit begins.
fn on_undistorted(
    seen: &[Seen],
    known: &[KannalaBrandt; 2],
    start: Option<&Transform<Left, Right>>,
) -> (usize, Option<PinholePair>) {
    let view = |seen: &Seen| {
        let corners = both(&seen.undistorted)?.map(|view| view.corners.clone());
        if in_both(&corners[0], &corners[1]).count() < FEWEST_CORNERS {
            return None;
        }
        let left_from_target = target_pose(&known[0], &seen.fisheye[0].as_ref()?.view).ok()?.camera_from_target;
        Some(PinholeView { left_from_target, corners })
    };
    let views: Vec<PinholeView> = seen.iter().filter_map(view).collect();
    let focal_px = [0, 1].map(|side| Pinhole::of(&known[side]).focal_px);
    let enough = views.len() >= FEWEST_VIEWS;
    let pair = start.filter(|_| enough).map(|start| PinholePair::calibrated(&views, focal_px, start));
    (views.len(), pair)
}
