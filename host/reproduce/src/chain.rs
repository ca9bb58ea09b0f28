//! Calibration from photographs alone: both lenses from targets all over their fields, then the stage from targets that both
//! cameras see at six stage poses; and for the paper's methods the pair at each mode.

use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;
use vergence_calibration::{
    IntrinsicsCalibration, IntrinsicsOptions, LensKnowledge, StageCalibration, StageOptions, StagePose, StereoView,
    calibrate_intrinsics, calibrate_stage,
};
use vergence_rig::{Provenance, Rig};
use vergence_scene::Target;
use vergence_sim::{HeldTarget, Random};
use vergence_targets::TargetView;
use vergence_vision::{Camera, ImageSize, KannalaBrandt, Left, Right, Transform};

use crate::bench::{Bench, scene_target};
use crate::conditions::Conditions;
use crate::drive::{Drive, Stop};
use crate::error::ReproduceError;
use crate::pair::Pair;
use crate::target_shot::{FoundCorners, Photo, TargetShot};

/// Views of each lens's own calibration.
const OWN_VIEWS: u64 = 30;
/// Views at each stage pose.
const SHARED_VIEWS: u64 = 12;

/// A rig that was calibrated.
pub struct Calibrated {
    /// Lenses, mechanism, and how sure they are.
    pub stage: StageCalibration,
    /// The rig as its written file describes it.
    pub rig: Rig,
    /// The left and the right lens by their own targets.
    pub own: [KannalaBrandt; 2],
    /// The pair of each mode, calibrated there.
    pub pairs: Vec<Pair>,
    /// How far corners were from where they truly are, in pixels.
    pub errors_px: Vec<f64>,
    /// Photographs taken, and those in which no target was found.
    pub photographs: [usize; 2],
}

/// Calibrates the bench from targets held where it was driven. `returns` draws how far the stage misses its poses.
///
/// # Errors
/// Where the views give no calibration.
pub fn calibrate(
    bench: &Bench,
    drive: &Drive,
    conditions: &Conditions,
    random: &mut Random,
    returns: &mut Random,
) -> Result<Calibrated, ReproduceError> {
    let mut tally = Tally::default();
    let lenses = [&bench.built.left_camera, &bench.built.right_camera];
    let [left, right] = lenses.map(|lens| own_calibration(lens, conditions, random.seed(), &mut tally));
    let (left, right) = (left?, right?);
    let own = [left.camera, right.camera];
    let mut poses = Vec::new();
    for stop in &drive.calibration {
        let standing = conditions.returned(&stop.truth, returns);
        let views = shared_views(bench, &standing, &own, conditions, random.seed(), &mut tally);
        poses.push(StagePose { readings: stop.readings.clone(), views });
    }
    let pair = |mode: &Stop| Pair::calibrated(bench, &mode.truth, &own, conditions, returns);
    let pairs = drive.modes.iter().map(pair).collect();
    let rig = Rig { left_camera: left.camera, right_camera: right.camera, ..bench.drawn.clone() };
    let lenses = LensKnowledge::within(left.covariance, right.covariance);
    let stage = calibrate_stage(&rig, &poses, &StageOptions { lenses, ..StageOptions::default() })
        .map_err(|error| ReproduceError::Calibration(format!("the stage: {error}")))?;
    let rig = through_file(&stage.rig(&rig))?;
    Ok(Calibrated { stage, rig, own, pairs, errors_px: tally.errors_px, photographs: [tally.taken, tally.missed] })
}

/// The rig as a user of its file has it.
fn through_file(rig: &Rig) -> Result<Rig, ReproduceError> {
    let provenance = Provenance { program: "vergence reproduce".into(), inputs_sha256: String::new(), date: None };
    let written = rig.to_toml(&provenance).map_err(ReproduceError::Calibration)?;
    Rig::from_toml(&written).map_err(|error| ReproduceError::Calibration(format!("the rig file: {error}")))
}

/// What photographs came to.
#[derive(Default)]
struct Tally {
    errors_px: Vec<f64>,
    taken: usize,
    missed: usize,
}

impl Tally {
    fn count(&mut self, seen: &Option<FoundCorners>) {
        self.taken += 1;
        match seen {
            Some(seen) => self.errors_px.extend(&seen.errors_px),
            None => self.missed += 1,
        }
    }
}

fn own_calibration(
    lens: &KannalaBrandt,
    conditions: &Conditions,
    seed: u64,
    tally: &mut Tally,
) -> Result<IntrinsicsCalibration, ReproduceError> {
    let nowhere = Transform::<Left, Right>::new(UnitQuaternion::identity(), Vector3::zeros());
    let held = HeldTarget { left: *lens, right: (*lens, nowhere), both: false, target: scene_target().into(), seed };
    let photos: Vec<Option<Photo>> = (0..OWN_VIEWS)
        .into_par_iter()
        .map(|index| {
            let place = held.left_from_target(index)?;
            let camera_from_target = place.renamed();
            TargetShot { lens, pupil: conditions.pupil, camera_from_target, seed: seed ^ index }.photograph(conditions)
        })
        .collect();
    let seen = |known: Option<&KannalaBrandt>| -> Vec<Option<FoundCorners>> {
        photos.par_iter().map(|photo| photo.as_ref()?.found(known)).collect()
    };
    // As 'calibrate intrinsics' does: the corners again with the lens that they give.
    let rough = calibrated(&seen(None), lens.size())?;
    let seen = seen(Some(&rough.camera));
    seen.iter().for_each(|seen| tally.count(seen));
    calibrated(&seen, lens.size())
}

fn calibrated(seen: &[Option<FoundCorners>], size: ImageSize) -> Result<IntrinsicsCalibration, ReproduceError> {
    let views: Vec<TargetView> = seen.iter().flatten().map(|seen| seen.view.clone()).collect();
    calibrate_intrinsics(&views, size, &IntrinsicsOptions::default())
        .map_err(|error| ReproduceError::Calibration(format!("a lens: {error}")))
}

fn shared_views(
    bench: &Bench,
    left_from_right: &Transform<Left, Right>,
    known: &[KannalaBrandt; 2],
    conditions: &Conditions,
    seed: u64,
    tally: &mut Tally,
) -> Vec<StereoView> {
    let (left, right) = (bench.built.left_camera, bench.built.right_camera);
    let held = HeldTarget { left, right: (right, *left_from_right), both: true, target: scene_target().into(), seed };
    let seen: Vec<[Option<FoundCorners>; 2]> = (0..SHARED_VIEWS)
        .into_par_iter()
        .filter_map(|index| {
            let left_from_target = held.left_from_target(index)?;
            let photos = photographs(bench, left_from_right, &left_from_target, conditions, seed ^ index);
            Some([0, 1].map(|side| photos[side].as_ref()?.found(Some(&known[side]))))
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

/// What both cameras photograph of a target at `left_from_target`.
pub fn photographs(
    bench: &Bench,
    left_from_right: &Transform<Left, Right>,
    left_from_target: &Transform<Left, Target>,
    conditions: &Conditions,
    seed: u64,
) -> [Option<Photo>; 2] {
    let in_right: Transform<Camera, Target> = (left_from_right.inverse() * *left_from_target).renamed();
    let shot = |lens, camera_from_target, seed| {
        TargetShot { lens, pupil: conditions.pupil, camera_from_target, seed }.photograph(conditions)
    };
    [
        shot(&bench.built.left_camera, left_from_target.renamed(), seed.wrapping_mul(2)),
        shot(&bench.built.right_camera, in_right, seed.wrapping_mul(2).wrapping_add(1)),
    ]
}
