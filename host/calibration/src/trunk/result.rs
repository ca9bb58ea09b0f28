//! Result of a trunk's calibration: its numbers with how much of each the images told, and the rig that it makes.

use nalgebra::{DMatrix, Matrix3, Matrix6};
use vergence_rig::{
    AxisPosition, CalibratedNumbers, Rig, RigAxis, RigCalibration, RigNumber, RigTrunk, TRUNK_AXES,
    TRUNK_PARAMETER_NAMES, TRUNK_PARAMETERS, TrunkCovariance, TrunkParameterKind, TrunkParameters,
};
use vergence_vision::{Angle, KannalaBrandt, Left, Length, Right, Transform};

use crate::extrinsics::{
    ExtrinsicsCalibration, Fit, Kinematics, Side, SkippedView, StereoOutlier, StereoView, outliers, refined, rms,
};
use crate::stage::{StageError, StagePose};
use crate::trunk::model::{Model, State};
use crate::trunk::play::PlayFound;

/// A calibrated trunk.
#[derive(Clone, Debug)]
pub struct TrunkCalibration {
    /// The numbers found, in the order of [`TRUNK_PARAMETER_NAMES`].
    pub parameters: Vec<TrunkParameterFigures>,
    /// The play of the corners and of the folds.
    pub play: [PlayFound; 2],
    /// Figures of each stage pose.
    pub poses: Vec<TrunkPoseFigures>,
    /// Root mean square distance between corners and reprojections, outliers included, in pixels.
    pub rms_px: f64,
    /// Root mean square distance over the corners used, in pixels.
    pub rms_inlier_px: f64,
    /// Standard deviation of one pixel coordinate, root mean square over the corners used.
    pub sigma_px: f64,
    /// Number of corners in all views that took part, both cameras.
    pub corners_total: usize,
    /// Number of corners used: all but the outliers.
    pub corners_inlier: usize,
    /// The corners left out.
    pub outliers: Vec<StereoOutlier>,
    /// The views that did not take part.
    pub skipped: Vec<SkippedView>,
    /// The left lens, refined unless it was exact.
    pub left: KannalaBrandt,
    /// The right lens, refined unless it was exact.
    pub right: KannalaBrandt,
    /// Covariance of the numbers, in radians and millimetres.
    pub covariance: TrunkCovariance,
    /// Covariance of both lenses, where they were refined. Its correlation with that of the trunk is left out.
    pub lenses: Option<CalibratedNumbers>,
    found: TrunkParameters,
}

/// One number of a trunk.
#[derive(Clone, Debug, PartialEq)]
pub struct TrunkParameterFigures {
    /// Its name.
    pub name: &'static str,
    /// Its kind, which tells its unit.
    pub kind: TrunkParameterKind,
    /// By the drawing, in radians or millimetres; zero for the zero of a joint.
    pub drawn: f64,
    /// As found.
    pub value: f64,
    /// Standard deviation of what was found.
    pub sigma: f64,
    /// Standard deviation of the drawing.
    pub tolerance: f64,
}

impl TrunkParameterFigures {
    /// The share of what is known of the number that the images told, from 0 to 1; the rest is the drawing's tolerance.
    #[must_use]
    pub fn from_images(&self) -> f64 {
        (1.0 - (self.sigma / self.tolerance).powi(2)).clamp(0.0, 1.0)
    }
}

/// Residuals of one stage pose.
#[derive(Clone, Debug, PartialEq)]
pub struct TrunkPoseFigures {
    /// Encoder readings.
    pub readings: Vec<AxisPosition>,
    /// The relative pose calibrated from this stage pose alone.
    pub alone: Transform<Left, Right>,
    /// Angle between that orientation and the one of the calibrated trunk at this stage pose.
    pub rotation_difference: Angle,
    /// Distance between the right camera's positions of both.
    pub translation_difference: Length,
    /// How far the reading of each axis is from its joint, in the order of the axes: play, and what strains the links.
    pub reading_errors: Vec<Angle>,
    /// Whether its joints are further off than play explains, see [`PlayFound::strained`].
    pub is_strained: bool,
    /// Over the corners of this stage pose that are not gross.
    pub rms_inlier_px: f64,
}

impl TrunkCalibration {
    /// `drawn` with links, mounts, zeros, play and lenses as found, and the covariances of its trunk and, where they were refined,
    /// of its lenses.
    #[must_use]
    pub fn rig(&self, drawn: &Rig) -> Rig {
        let Some(trunk) = &drawn.trunk else { return drawn.clone() };
        let [corners, folds] = &self.play;
        let found = RigTrunk {
            links: self.found.links,
            cameras: self.found.cameras,
            passive_play: trunk.passive_play * corners.factor,
            covariance: Some(Box::new(self.covariance)),
            ..(**trunk).clone()
        };
        let mut axes = drawn.axes.clone();
        for (joint, &index) in trunk.axes.iter().enumerate() {
            let factor = if joint < 3 { corners.factor } else { folds.factor };
            let sigma = factor * trunk.reading_sigma(joint, &drawn.axes);
            if let Some(axis) = axes.get_mut(index) {
                let passive = if joint < 3 { 0.5 * found.passive_play } else { 0.0 };
                axis.play = play_of(axis, sigma, passive);
                axis.zero += self.found.zeros[joint];
                axis.calibrated = self.calibrated(index, axis, self.found.zeros[joint]);
            }
        }
        let mut rig = Rig {
            left_camera: self.left,
            right_camera: self.right,
            trunk: Some(Box::new(found)),
            axes,
            ..drawn.clone()
        };
        rig.calibration = self.lenses.clone().map_or(RigCalibration::Unknown, RigCalibration::Covariance);
        rig
    }

    /// The true positions of the axes, in radians, where the axes of `drawn` read `readings`: the zeros found are added.
    #[must_use]
    pub fn values(&self, drawn: &Rig, readings: &[AxisPosition]) -> Vec<f64> {
        let mut values: Vec<f64> = readings.iter().map(|reading| reading.value()).collect();
        for (&axis, zero) in drawn.trunk.iter().flat_map(|trunk| &trunk.axes).zip(self.found.zeros) {
            values.get_mut(axis).into_iter().for_each(|value| *value += zero);
        }
        values
    }

    /// Between the lowest and the highest position of all stage poses, with the zero found.
    fn calibrated(&self, index: usize, axis: &RigAxis, zero: f64) -> Option<[AxisPosition; 2]> {
        let readings =
            self.poses.iter().filter_map(|pose| pose.readings.get(index)).map(|reading| reading.value() + zero);
        let (low, high) = readings.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        (low < high).then(|| [low, high].map(|value| AxisPosition::from_value(axis.kind, value)))
    }
}

/// The play with which a reading of `axis` has this standard deviation in millimetres or radians, beside that of passive joints and of its step.
pub(crate) fn play_of(axis: &RigAxis, sigma: f64, passive: f64) -> f64 {
    let step = axis.value_per_count() / 12f64.sqrt();
    2.0 * (sigma.powi(2) - step.powi(2) - passive.powi(2)).max(0.0).sqrt()
}

/// The largest standard deviations of rotation and translation, along the worst direction, by the covariance of a calibrated trunk,
/// over its modes that are not near a dead centre.
#[must_use]
pub fn largest_trunk_sigma(rig: &Rig) -> (Angle, Length) {
    let (mut rotation, mut translation) = (0.0f64, 0.0f64);
    let near = |values: &[f64]| rig.trunk.as_ref().is_some_and(|trunk| trunk.is_near_dead_centre(values));
    let mut places: Vec<Vec<f64>> =
        rig.modes.iter().map(|mode| mode.targets.iter().map(|target| target.value()).collect()).collect();
    if places.iter().any(|values| !near(values)) {
        places.retain(|values| !near(values));
    }
    for values in places {
        let covariance: Matrix6<f64> = rig.trunk_calibration_covariance(&values).unwrap_or_default();
        let worst = |first: usize| {
            let part: Matrix3<f64> = covariance.fixed_view::<3, 3>(first, first).into_owned();
            part.symmetric_eigenvalues().max().max(0.0).sqrt()
        };
        rotation = rotation.max(worst(0));
        translation = translation.max(worst(3));
    }
    (Angle::from_rad(rotation), Length::from_mm(translation))
}

/// Inputs of [`calibration`].
pub(crate) struct Material<'a> {
    pub rig: &'a Rig,
    pub poses: &'a [StagePose],
    pub model: &'a Model,
    pub fit: &'a Fit<State>,
    pub play: [PlayFound; 2],
    pub alone: &'a [ExtrinsicsCalibration],
    pub views: &'a [StereoView],
    pub usable: &'a [Vec<bool>],
}

pub(crate) fn calibration(material: &Material<'_>) -> Result<TrunkCalibration, StageError> {
    let Material { rig, model, fit, views, usable, .. } = material;
    // The drawing's tolerances determine every number, so that there is a covariance wherever there is a fit.
    let all = &fit.covariance.as_ref().ok_or(StageError::Diverged)?.covariance;
    let covariance = all.fixed_view::<TRUNK_PARAMETERS, TRUNK_PARAMETERS>(0, 0).into_owned();
    let state = &fit.shared.state;
    let parameters = TRUNK_PARAMETER_NAMES.iter().enumerate().map(|(index, &(name, kind))| TrunkParameterFigures {
        name,
        kind,
        drawn: model.drawn[index],
        value: state.parameters[index],
        sigma: covariance[(index, index)].max(0.0).sqrt(),
        tolerance: model.tolerance.of(kind),
    });
    Ok(TrunkCalibration {
        parameters: parameters.collect(),
        play: material.play.clone(),
        poses: pose_figures(material),
        rms_px: rms(&fit.errors_px, usable).unwrap_or_default(),
        rms_inlier_px: rms(&fit.errors_px, &fit.inliers).unwrap_or_default(),
        sigma_px: fit.sigma_px(views),
        corners_total: usable.iter().map(Vec::len).sum(),
        corners_inlier: fit.inliers.iter().flatten().filter(|&&inlier| inlier).count(),
        outliers: outliers(views, usable, fit),
        skipped: material.alone.iter().flat_map(|pose| pose.skipped.iter().cloned()).collect(),
        left: refined(&fit.shared.lenses.left, &rig.left_camera, Side::Left).map_err(StageError::Joint)?,
        right: refined(&fit.shared.lenses.right, &rig.right_camera, Side::Right).map_err(StageError::Joint)?,
        covariance,
        lenses: refined_lenses(&fit.lens_numbers, all, model.dimension()),
        found: TrunkParameters::from_array(&state.parameters),
    })
}

/// The part of the lenses in the covariance of a fit, which begins with `others` unknowns.
fn refined_lenses(numbers: &[RigNumber], all: &DMatrix<f64>, others: usize) -> Option<CalibratedNumbers> {
    let refined = all.nrows().checked_sub(others).filter(|&refined| refined > 0 && refined == numbers.len())?;
    CalibratedNumbers::new(numbers.to_vec(), all.view((others, others), (refined, refined)).into_owned()).ok()
}

fn pose_figures(material: &Material<'_>) -> Vec<TrunkPoseFigures> {
    let Material { rig, poses, model, fit, alone, .. } = material;
    let state = &fit.shared.state;
    let figures = |(index, (pose, alone)): (usize, (&StagePose, &ExtrinsicsCalibration))| {
        let of_pose = |view: &usize| model.pose_of_view.get(*view) == Some(&index);
        let own: Vec<usize> = (0..fit.errors_px.len()).filter(of_pose).collect();
        let errors: Vec<Vec<f64>> = own.iter().filter_map(|&view| fit.errors_px.get(view).cloned()).collect();
        let inliers: Vec<Vec<bool>> = own.iter().filter_map(|&view| fit.inliers.get(view).cloned()).collect();
        let by_joint = model.readings.get(index).map_or([0.0; TRUNK_AXES], |read| state.reading_errors(index, read));
        let mut reading_errors = vec![Angle::from_rad(0.0); rig.axes.len()];
        for (&axis, error) in rig.trunk.iter().flat_map(|trunk| &trunk.axes).zip(by_joint) {
            if let Some(slot) = reading_errors.get_mut(axis) {
                *slot = Angle::from_rad(error);
            }
        }
        let (found, own) = (state.left_from_right(index), alone.joint.left_from_right);
        TrunkPoseFigures {
            readings: pose.readings.clone(),
            alone: own,
            rotation_difference: Angle::from_rad(found.rotation.angle_to(&own.rotation())),
            translation_difference: Length::from_mm((found.translation.vector - own.origin().mm()).norm()),
            reading_errors,
            is_strained: material.play.iter().any(|found| found.strained.get(index) == Some(&true)),
            rms_inlier_px: rms(&errors, &inliers).unwrap_or_default(),
        }
    };
    poses.iter().zip(*alone).enumerate().map(figures).collect()
}
