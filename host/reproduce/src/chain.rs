//! Calibration from photographs alone: both lenses from targets all over their fields, then the stage from targets that both
//! cameras see at six stage poses; and for the paper's methods the pair at each mode.

use nalgebra::{UnitQuaternion, Vector3};
use rayon::prelude::*;
use vergence_calibration::{
    IntrinsicsCalibration, IntrinsicsOptions, LensKnowledge, LensModel, StageCalibration, StageOptions, StagePose,
    StereoView, calibrate_intrinsics, calibrate_stage,
};
use vergence_rig::{Provenance, Rig};
use vergence_sim::{HeldTarget, Random};
use vergence_targets::TargetView;
use vergence_vision::{ImageSize, KannalaBrandt, Left, Right, Transform};

use crate::bench::{Bench, scene_target};
use crate::drive::{Drive, Stop};
use crate::error::ReproduceError;
use crate::eyes::Eyes;
use crate::pair::Pair;
use crate::target_shot::{FoundCorners, Photo};

/// Views of each lens's own calibration.
const OWN_VIEWS: u64 = 30;
/// Views at each stage pose.
const SHARED_VIEWS: u64 = 12;

/// A rig that was calibrated.
pub struct Calibrated {
    /// Lenses, mechanism, and how sure they are.
    pub stage: StageCalibration,
    /// The rig file that is written.
    pub file: String,
    /// The rig as that file describes it.
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

/// Calibrates the bench from targets that its `eyes` see held where it was driven, with lenses of this `model`. `returns` draws how far
/// the stage misses its poses.
///
/// # Errors
/// Where the views give no calibration.
pub fn calibrate(
    bench: &Bench,
    drive: &Drive,
    eyes: &Eyes<'_>,
    model: LensModel,
    random: &mut Random,
    returns: &mut Random,
) -> Result<Calibrated, ReproduceError> {
    let mut tally = Tally::default();
    let lenses = [(0, &bench.built.left_camera), (1, &bench.built.right_camera)];
    let [left, right] =
        lenses.map(|(side, lens)| own_calibration(lens, (eyes, side), model, random.seed(), &mut tally));
    let (Own { lens: left, central: central_left }, Own { lens: right, central: central_right }) = (left?, right?);
    let own = [central_left, central_right];
    let mut poses = Vec::new();
    for stop in &drive.calibration {
        let standing = eyes.conditions.returned(&stop.truth, returns);
        let views = shared_views(bench, &standing, &own, eyes, random.seed(), &mut tally);
        poses.push(StagePose { readings: stop.readings.clone(), views });
    }
    let pair = |mode: &Stop| Pair::calibrated(eyes, &mode.truth, &own, returns);
    let pairs = drive.modes.iter().map(pair).collect();
    let rig = Rig { left_camera: left.camera, right_camera: right.camera, ..bench.drawn.clone() };
    let lenses = LensKnowledge::within(left.covariance, right.covariance);
    let stage = calibrate_stage(&rig, &poses, &StageOptions { lenses, ..StageOptions::default() })
        .map_err(|error| ReproduceError::Calibration(format!("the stage: {error}")))?;
    let file = written(&stage.rig(&rig))?;
    let rig = Rig::from_toml(&file).map_err(|error| ReproduceError::Calibration(format!("the rig file: {error}")))?;
    Ok(Calibrated {
        stage,
        file,
        rig,
        own,
        pairs,
        errors_px: tally.errors_px,
        photographs: [tally.taken, tally.missed],
    })
}

/// The file of a calibrated rig.
fn written(rig: &Rig) -> Result<String, ReproduceError> {
    let program = concat!("vergence ", env!("CARGO_PKG_VERSION"), ", from simulated targets").to_owned();
    let provenance = Provenance { program, inputs_sha256: String::new(), date: None };
    rig.to_toml(&provenance).map_err(ReproduceError::Calibration)
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

/// The calibration of a lens by itself.
struct Own {
    /// As the views ask for it.
    lens: IntrinsicsCalibration,
    /// With one centre, as the paper's methods know lenses.
    central: KannalaBrandt,
}

fn own_calibration(
    lens: &KannalaBrandt,
    (eyes, side): (&Eyes<'_>, usize),
    model: LensModel,
    seed: u64,
    tally: &mut Tally,
) -> Result<Own, ReproduceError> {
    let nowhere = Transform::<Left, Right>::new(UnitQuaternion::identity(), Vector3::zeros());
    let held = HeldTarget { left: *lens, right: (*lens, nowhere), both: false, target: scene_target().into(), seed };
    let photos: Vec<Option<Photo>> = (0..OWN_VIEWS)
        .into_par_iter()
        .map(|index| eyes.photograph(side, held.left_from_target(index)?.renamed(), seed ^ index))
        .collect();
    let seen = |known: Option<&KannalaBrandt>| -> Vec<Option<FoundCorners>> {
        photos.par_iter().map(|photo| photo.as_ref()?.found(known)).collect()
    };
    // As 'calibrate intrinsics' does: the corners again with the lens that they give.
    let central = IntrinsicsOptions::central();
    let rough = calibrated(&seen(None), lens.size(), &central)?;
    let seen = seen(Some(&rough.camera));
    seen.iter().for_each(|seen| tally.count(seen));
    let found = calibrated(&seen, lens.size(), &IntrinsicsOptions { model, ..IntrinsicsOptions::default() })?;
    let central = match found.camera.fits_opencv() {
        true => found.camera,
        false => calibrated(&seen, lens.size(), &central)?.camera,
    };
    Ok(Own { lens: found, central })
}

fn calibrated(
    seen: &[Option<FoundCorners>],
    size: ImageSize,
    options: &IntrinsicsOptions,
) -> Result<IntrinsicsCalibration, ReproduceError> {
    let views: Vec<TargetView> = seen.iter().flatten().map(|seen| seen.view.clone()).collect();
    calibrate_intrinsics(&views, size, options).map_err(|error| ReproduceError::Calibration(format!("a lens: {error}")))
}

fn shared_views(
    bench: &Bench,
    left_from_right: &Transform<Left, Right>,
    known: &[KannalaBrandt; 2],
    eyes: &Eyes<'_>,
    seed: u64,
    tally: &mut Tally,
) -> Vec<StereoView> {
    let (left, right) = (bench.built.left_camera, bench.built.right_camera);
    let held = HeldTarget { left, right: (right, *left_from_right), both: true, target: scene_target().into(), seed };
    let seen: Vec<[Option<FoundCorners>; 2]> = (0..SHARED_VIEWS)
        .into_par_iter()
        .filter_map(|index| {
            let left_from_target = held.left_from_target(index)?;
            let photos = eyes.photographs(left_from_right, &left_from_target, seed ^ index);
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
