//! The rig's own calibration, from photographs alone: both lenses from boards all over their fields, then the stage from
//! boards that both cameras see at six stage poses.

use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;
use vergence_calibration::{
    BoardView, IntrinsicsCalibration, IntrinsicsOptions, LensKnowledge, StageCalibration, StageOptions, StagePose,
    StereoView, calibrate_intrinsics, calibrate_stage,
};
use vergence_rig::Rig;
use vergence_scene::Board;
use vergence_vision::{Camera, ImageSize, KannalaBrandt, Left, Right, Transform};

use super::bench::{Bench, scene_board};
use super::drive::Stop;
use super::sight::{Eyesight, Photo, Seen, Sight};
use crate::camera::BoardStage;
use crate::failure::Failure;
use crate::sim::Random;

/// Views of each lens's own calibration.
const OWN_VIEWS: u64 = 30;
/// Views at each stage pose.
const SHARED_VIEWS: u64 = 12;

/// A rig that knows itself.
pub struct Calibrated {
    /// Lenses, mechanism, and how sure they are.
    pub stage: StageCalibration,
    /// How far corners were from where they truly are, in pixels.
    pub errors_px: Vec<f64>,
    /// Photographs taken, and those in which no board was found.
    pub photographs: [usize; 2],
}

/// Calibrates the bench from boards held at `stops`.
///
/// # Errors
/// Where the views give no calibration.
pub fn calibrate(
    bench: &Bench,
    stops: &[Stop],
    eyesight: &Eyesight,
    random: &mut Random,
) -> Result<Calibrated, Failure> {
    let mut tally = Tally::default();
    let lenses = [&bench.built.left_camera, &bench.built.right_camera];
    let [left, right] = lenses.map(|lens| own_calibration(lens, eyesight, random.seed(), &mut tally));
    let (left, right) = (left?, right?);
    let mut poses = Vec::new();
    for stop in stops {
        let views =
            shared_views(bench, &stop.truth, [&left.camera, &right.camera], eyesight, random.seed(), &mut tally);
        poses.push(StagePose { readings: stop.readings.clone(), views });
    }
    let rig = Rig { left_camera: left.camera, right_camera: right.camera, ..bench.drawn.clone() };
    let lenses = LensKnowledge::within(left.covariance, right.covariance);
    let stage = calibrate_stage(&rig, &poses, &StageOptions { lenses, ..StageOptions::default() })
        .map_err(|error| Failure::check(format!("the stage is not calibrated: {error}")))?;
    Ok(Calibrated { stage, errors_px: tally.errors_px, photographs: [tally.taken, tally.missed] })
}

/// What photographs came to.
#[derive(Default)]
struct Tally {
    errors_px: Vec<f64>,
    taken: usize,
    missed: usize,
}

impl Tally {
    fn count(&mut self, seen: &Option<Seen>) {
        self.taken += 1;
        match seen {
            Some(seen) => self.errors_px.extend(&seen.errors_px),
            None => self.missed += 1,
        }
    }
}

fn own_calibration(
    lens: &KannalaBrandt,
    eyesight: &Eyesight,
    seed: u64,
    tally: &mut Tally,
) -> Result<IntrinsicsCalibration, Failure> {
    let nowhere = Transform::<Left, Right>::new(UnitQuaternion::identity(), Vector3::zeros());
    let held = BoardStage { left: *lens, right: (*lens, nowhere), both: false, board: scene_board(), seed };
    let photos: Vec<Option<Photo>> = (0..OWN_VIEWS)
        .into_par_iter()
        .map(|index| {
            let place = held.left_from_board(index)?;
            Sight { lens, camera_from_board: place.renamed(), seed: seed ^ index }.photograph(eyesight)
        })
        .collect();
    let seen = |known: Option<&KannalaBrandt>| -> Vec<Option<Seen>> {
        photos.par_iter().map(|photo| photo.as_ref()?.seen(known)).collect()
    };
    // As 'calibrate intrinsics' does: the corners again with the lens that they give.
    let rough = calibrated(&seen(None), lens.size())?;
    let seen = seen(Some(&rough.camera));
    seen.iter().for_each(|seen| tally.count(seen));
    calibrated(&seen, lens.size())
}

fn calibrated(seen: &[Option<Seen>], size: ImageSize) -> Result<IntrinsicsCalibration, Failure> {
    let views: Vec<BoardView> = seen.iter().flatten().map(|seen| seen.view.clone()).collect();
    calibrate_intrinsics(&views, size, &IntrinsicsOptions::default())
        .map_err(|error| Failure::check(format!("a lens is not calibrated: {error}")))
}

fn shared_views(
    bench: &Bench,
    left_from_right: &Transform<Left, Right>,
    known: [&KannalaBrandt; 2],
    eyesight: &Eyesight,
    seed: u64,
    tally: &mut Tally,
) -> Vec<StereoView> {
    let (left, right) = (bench.built.left_camera, bench.built.right_camera);
    let held = BoardStage { left, right: (right, *left_from_right), both: true, board: scene_board(), seed };
    let seen: Vec<[Option<Seen>; 2]> = (0..SHARED_VIEWS)
        .into_par_iter()
        .filter_map(|index| {
            let left_from_board = held.left_from_board(index)?;
            Some(both(bench, left_from_right, &left_from_board, known, eyesight, seed ^ index))
        })
        .collect();
    seen.iter().flatten().for_each(|seen| tally.count(seen));
    let paired = seen.into_iter().filter_map(|[left, right]| Some((left?, right?)));
    paired
        .filter(|(left, right)| left.labelled && right.labelled)
        .enumerate()
        .map(|(index, (left, right))| StereoView {
            name: format!("view {}", index + 1),
            left: left.view,
            right: right.view,
        })
        .collect()
}

/// What both cameras, of which `known` is known, make of a board at `left_from_board`.
pub fn both(
    bench: &Bench,
    left_from_right: &Transform<Left, Right>,
    left_from_board: &Transform<Left, Board>,
    known: [&KannalaBrandt; 2],
    eyesight: &Eyesight,
    seed: u64,
) -> [Option<Seen>; 2] {
    let in_right: Transform<Camera, Board> = (left_from_right.inverse() * *left_from_board).renamed();
    let sight = |lens, camera_from_board, known, seed| {
        Sight { lens, camera_from_board, seed }.photograph(eyesight)?.seen(Some(known))
    };
    [
        sight(&bench.built.left_camera, left_from_board.renamed(), known[0], seed.wrapping_mul(2)),
        sight(&bench.built.right_camera, in_right, known[1], seed.wrapping_mul(2).wrapping_add(1)),
    ]
}
