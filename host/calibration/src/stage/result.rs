//! Result of a stage calibration, and the relative pose it predicts.

use nalgebra::{DMatrix, Matrix6, SMatrix};
use vergence_rig::{
    AxisPosition, CalibratedNumbers, Chain, InvalidCovariance, Link, Repeatability, Rig, RigAxis, RigCalibration,
    RigNumber, Screw,
};
use vergence_vision::{
    Angle, KannalaBrandt, LENS_PARAMETERS, Left, Length, Right, SHARED_PARAMETERS, SharedCovariance, Transform,
};

use crate::TargetWarp;
use crate::extrinsics::{
    ExtrinsicsCalibration, Fit, Side, SkippedView, StereoOutlier, StereoView, outliers, refined, rms,
};
use crate::reprojection::POSE;
use crate::schur_lm::Clustered;
use crate::stage::covariance::of_numbers;
use crate::stage::figures::{pose_figures, screws, zero_offsets};
use crate::stage::mechanism::State;
use crate::stage::model::Model;
use crate::stage::start::named;
use crate::stage::twist::Twist;
use crate::stage::unknowns::Unknown;
use crate::stage::{Observability, StageError};
use crate::trunk::play_of;

/// A calibrated stage.
#[derive(Clone, Debug)]
pub struct StageCalibration {
    /// Screws of the left chain, then of the right, in order.
    pub screws: Vec<FittedScrew>,
    /// Zero offset of each axis that drives a screw.
    pub zero_offsets: Vec<ZeroOffset>,
    /// Scale of each axis whose scale was unknown.
    pub scales: Vec<EncoderScale>,
    /// The base extrinsics: the relative pose where all encoders read zero.
    pub at_zero: PredictedPose,
    /// How far the right camera returns beside where the mechanism puts it, where the stage poses show it.
    pub repeatability: Option<Repeatability>,
    /// Figures of each stage pose.
    pub poses: Vec<StagePoseFigures>,
    /// The unknowns that the stage poses determine.
    pub observability: Observability,
    /// How much more the views pull the mechanism and the lenses to and fro than independent noise of their corners
    /// explains: a ratio of standard deviations, at least 1. All standard deviations count it.
    pub view_scatter: f64,
    /// Root mean square distance between corners and reprojections, outliers included, in pixels.
    pub rms_px: f64,
    /// Root mean square distance over the corners used, in pixels.
    pub rms_inlier_px: f64,
    /// Standard deviation of one pixel coordinate, root mean square over the corners used.
    pub sigma_px: f64,
    /// Standard deviation of one pixel coordinate of a corner whose relative sigma is 1; it scales with the relative
    /// sigma.
    pub unit_sigma_px: f64,
    /// Number of corners in all views that took part, both cameras.
    pub corners_total: usize,
    /// Number of corners used: all but the outliers.
    pub corners_inlier: usize,
    /// The corners left out.
    pub outliers: Vec<StereoOutlier>,
    /// The views that did not take part.
    pub skipped: Vec<SkippedView>,
    /// Bow of the target where the views show one.
    pub warp: Option<TargetWarp>,
    /// The left lens, refined unless it was exact.
    pub left: KannalaBrandt,
    /// The right lens, refined unless it was exact.
    pub right: KannalaBrandt,
    axes: Vec<RigAxis>,
    state: State,
    mechanism: Vec<Unknown>,
    /// The lens parameters in the last rows of `covariance`.
    lens_numbers: Vec<RigNumber>,
    /// Of the mechanism's unknowns, then the left and the right lens's where they were refined.
    covariance: DMatrix<f64>,
    reading_sigma: Vec<f64>,
}

/// A calibrated screw.
#[derive(Clone, Debug, PartialEq)]
pub struct FittedScrew {
    /// The camera whose chain it is in.
    pub side: Side,
    /// The axis that drives it.
    pub axis: String,
    /// Its direction and place in the base frame, with all encoders reading zero.
    pub screw: Screw,
    /// Standard deviation of the direction, about the worse of two axes.
    pub direction_sigma: Angle,
    /// Standard deviation of the line's place, along the worse of two axes; `None` for a slide.
    pub position_sigma: Option<Length>,
}

/// Offset of an axis from the drawing when its encoder reads zero: the part of the right camera's displacement at zero
/// that moving this axis would cause. It is not separable from an error of the mount.
#[derive(Clone, Debug, PartialEq)]
pub struct ZeroOffset {
    /// The axis.
    pub axis: String,
    /// Offset to add to a reading.
    pub offset: AxisPosition,
    /// Standard deviation of the offset.
    pub sigma: AxisPosition,
}

/// Factor to multiply an encoder's reading with.
#[derive(Clone, Debug, PartialEq)]
pub struct EncoderScale {
    /// The axis.
    pub axis: String,
    /// The factor; 1 if the encoder is as stated.
    pub scale: f64,
    /// Standard deviation of the value.
    pub sigma: f64,
}

/// A relative pose that the stage predicts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PredictedPose {
    /// The right camera in the left frame.
    pub left_from_right: Transform<Left, Right>,
    /// In local coordinates `[ω, δ]`: rotation vector about the left axes in radians, then the position of the right
    /// camera in the left frame in millimetres.
    pub covariance: Matrix6<f64>,
}

/// Residuals of one stage pose.
#[derive(Clone, Debug, PartialEq)]
pub struct StagePoseFigures {
    /// Encoder readings.
    pub readings: Vec<AxisPosition>,
    /// The relative pose calibrated from this stage pose alone.
    pub alone: Transform<Left, Right>,
    /// Angle between that orientation and the one that the calibrated stage predicts.
    pub rotation_difference: Angle,
    /// Distance between the right camera's positions of both.
    pub translation_difference: Length,
    /// Over the corners of this stage pose that are not gross.
    pub rms_inlier_px: f64,
}

impl StageCalibration {
    /// The relative pose where the encoders read `readings` (in the order of the rig's axes; a missing one reads zero),
    /// with the covariance of the calibration and of the readings.
    #[must_use]
    pub fn predict(&self, readings: &[AxisPosition]) -> PredictedPose {
        let values: Vec<f64> = readings.iter().map(|reading| reading.value()).collect();
        let mut pose = predict(&self.state, &self.mechanism, &self.of_mechanism(), &self.reading_sigma, &values);
        pose.covariance += self.of_return();
        pose
    }

    /// Covariance that all points of a pair share at the encoder readings `readings`: lenses and pose with their
    /// correlations.
    #[must_use]
    pub fn shared(&self, readings: &[AxisPosition]) -> SharedCovariance {
        let values: Vec<f64> = readings.iter().map(|reading| reading.value()).collect();
        let (unknowns, pose) = (self.mechanism.len(), 2 * LENS_PARAMETERS);
        // The shared parameters by the unknowns: lenses are themselves, the pose is what the mechanism makes of its own.
        let mut by_unknowns = DMatrix::zeros(SHARED_PARAMETERS, self.covariance.nrows());
        for (column, number) in (unknowns..).zip(&self.lens_numbers) {
            if let Some(row) = number.shared_row() {
                by_unknowns[(row, column)] = 1.0;
            }
        }
        by_unknowns.rows_mut(pose, POSE).columns_mut(0, unknowns).copy_from(&self.state.derivative(
            &values,
            &self.mechanism,
            None,
        ));
        let mut total = &by_unknowns * &self.covariance * by_unknowns.transpose();
        let mut of_pose = total.view_mut((pose, pose), (POSE, POSE));
        of_pose += of_readings(&self.state, &self.reading_sigma, &values) + self.of_return();
        SharedCovariance::joint(SMatrix::from_fn(|row, column| total[(row, column)]))
    }

    /// The left camera's chain: the scales of the encoders are in the shares.
    #[must_use]
    pub fn left_chain(&self) -> Chain<Left> {
        Chain::new(self.scaled(&self.state.left), named(&self.state.left_at_zero))
    }

    /// The right camera's chain: the scales of the encoders are in the shares, their zeros in the pose at zero.
    #[must_use]
    pub fn right_chain(&self) -> Chain<Right> {
        Chain::new(self.scaled(&self.state.right), named(&self.state.right_at_zero))
    }

    /// The numbers of the rig file with their covariance.
    ///
    /// # Errors
    /// [`InvalidCovariance`] where rounding made it none.
    pub fn numbers(&self) -> Result<CalibratedNumbers, InvalidCovariance> {
        of_numbers(&self.state, &self.mechanism, &self.lens_numbers, &self.covariance)
    }

    /// `drawn` with the chains and lenses calibrated, and the covariance of its numbers.
    #[must_use]
    pub fn rig(&self, drawn: &Rig) -> Rig {
        Rig {
            left_camera: self.left,
            right_camera: self.right,
            left_chain: self.left_chain(),
            right_chain: self.right_chain(),
            // A covariance of the solver is one: only rounding could refuse it, and then nothing is known.
            calibration: self.numbers().map_or(RigCalibration::Unknown, RigCalibration::Covariance),
            axes: drawn.axes.iter().enumerate().map(|(index, axis)| self.calibrated(index, axis)).collect(),
            repeatability: self.repeatability.or(drawn.repeatability),
            ..drawn.clone()
        }
    }

    /// The play of each axis whose readings are off by more than a step of its encoder, as it is stated in the file.
    #[must_use]
    pub fn plays(&self) -> Vec<(String, AxisPosition)> {
        let play = |(axis, sigma): (&RigAxis, &f64)| {
            let play = play_of(axis, *sigma, 0.0);
            // Rounding leaves less.
            (play > 1e-3 * axis.value_per_count())
                .then(|| (axis.name.clone(), AxisPosition::from_value(axis.kind, play)))
        };
        self.axes.iter().zip(&self.reading_sigma).filter_map(play).collect()
    }

    /// The pose's covariance by how far the stage returns beside it.
    fn of_return(&self) -> Matrix6<f64> {
        self.repeatability.map_or_else(Matrix6::zeros, |found| found.covariance())
    }

    /// The axis with its play, calibrated between the lowest and the highest reading of all stage poses.
    fn calibrated(&self, index: usize, axis: &RigAxis) -> RigAxis {
        let found = self.plays().into_iter().find(|(name, _)| *name == axis.name);
        let play = found.map_or(axis.play, |(_, play)| play.value());
        let readings = self.poses.iter().filter_map(|pose| pose.readings.get(index)).map(|reading| reading.value());
        let (low, high) = readings.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
        let calibrated = (low < high).then(|| [low, high].map(|value| AxisPosition::from_value(axis.kind, value)));
        RigAxis { calibrated, play, ..axis.clone() }
    }

    /// The largest standard deviations of rotation and translation by the calibration, along the worst direction, over the corners
    /// and the middle of the axes' ranges.
    #[must_use]
    pub fn largest_sigma(&self) -> (Angle, Length) {
        let worst = |matrix: SMatrix<f64, 3, 3>| matrix.symmetric_eigenvalues().max().max(0.0).sqrt();
        let (mut rotation, mut translation) = (0.0f64, 0.0f64);
        let of_mechanism = self.of_mechanism();
        for values in grid(&self.axes) {
            let exact = vec![0.0; values.len()];
            let pose = predict(&self.state, &self.mechanism, &of_mechanism, &exact, &values);
            rotation = rotation.max(worst(pose.covariance.fixed_view::<3, 3>(0, 0).into_owned()));
            translation = translation.max(worst(pose.covariance.fixed_view::<3, 3>(3, 3).into_owned()));
        }
        (Angle::from_rad(rotation), Length::from_mm(translation))
    }

    fn of_mechanism(&self) -> DMatrix<f64> {
        let unknowns = self.mechanism.len();
        self.covariance.view((0, 0), (unknowns, unknowns)).into_owned()
    }

    fn scaled(&self, links: &[Link]) -> Vec<Link> {
        let scale = |axis: usize| self.state.scales.get(axis).copied().unwrap_or(1.0);
        links.iter().map(|link| Link { share: link.share * scale(link.axis), ..*link }).collect()
    }
}

/// The lowest, middle and highest positions of all axes, each with each; of many axes only the first few vary.
pub(crate) fn grid(axes: &[RigAxis]) -> Vec<Vec<f64>> {
    const MOST_AXES: usize = 4;
    let mut grid: Vec<Vec<f64>> = vec![Vec::new()];
    for (index, axis) in axes.iter().enumerate() {
        let [low, high] = axis.range.map(AxisPosition::value);
        let middle = 0.5 * (low + high);
        let levels = if index < MOST_AXES { vec![low, middle, high] } else { vec![middle] };
        grid =
            grid.iter().flat_map(|start| levels.iter().map(|&level| [start.as_slice(), &[level]].concat())).collect();
    }
    grid
}

fn predict(
    state: &State,
    mechanism: &[Unknown],
    covariance: &DMatrix<f64>,
    reading_sigma: &[f64],
    readings: &[f64],
) -> PredictedPose {
    let derivative = state.derivative(readings, mechanism, None);
    let of_mechanism: Matrix6<f64> = &derivative * covariance * derivative.transpose();
    let covariance = of_mechanism + of_readings(state, reading_sigma, readings);
    PredictedPose { left_from_right: named(&state.left_from_right(readings)), covariance }
}

/// The pose's covariance by the errors of the readings alone.
fn of_readings(state: &State, reading_sigma: &[f64], readings: &[f64]) -> Matrix6<f64> {
    let by_axis = reading_sigma.iter().enumerate().map(|(axis, sigma)| {
        let by: Twist = state.by_reading(readings, axis) * *sigma;
        by * by.transpose()
    });
    by_axis.sum()
}

/// Inputs of [`calibration`].
pub(crate) struct Material<'a> {
    pub rig: &'a Rig,
    pub model: Model,
    pub fit: Fit<State>,
    pub observability: Observability,
    pub alone: &'a [ExtrinsicsCalibration],
    pub views: &'a [StereoView],
    pub usable: &'a [Vec<bool>],
}

pub(crate) fn calibration(material: Material<'_>) -> Result<StageCalibration, StageError> {
    let Material { rig, model, fit, observability, alone, views, usable } = material;
    let Clustered { covariance, scatter } =
        fit.covariance.as_ref().ok_or_else(|| StageError::Unobservable(observability.clone()))?;
    // The mechanism's unknowns come first.
    let mechanism: Vec<Unknown> = model.unknowns.iter().copied().filter(|unknown| unknown.is_mechanical()).collect();
    let covariance = without_readings(covariance, mechanism.len(), model.unknowns.len());
    let state = &fit.shared.state;
    let of_mechanism = covariance.view((0, 0), (mechanism.len(), mechanism.len())).into_owned();
    let names: Vec<String> = rig.axes.iter().map(|axis| axis.name.clone()).collect();
    let sigma = |index: usize| covariance[(index, index)].max(0.0).sqrt();
    let scales = mechanism.iter().enumerate().filter_map(|(index, unknown)| match unknown {
        Unknown::Scale { axis } => {
            Some(EncoderScale { axis: names[*axis].clone(), scale: state.scales[*axis], sigma: sigma(index) })
        }
        _ => None,
    });
    Ok(StageCalibration {
        screws: screws(state, &mechanism, &sigma, &names),
        zero_offsets: zero_offsets(rig, &model.nominal, state, &mechanism, &of_mechanism),
        scales: scales.collect(),
        at_zero: predict(state, &mechanism, &of_mechanism, &model.reading_sigma, &vec![0.0; rig.axes.len()]),
        repeatability: model.repeatability(),
        poses: pose_figures(rig, &model, &fit, alone),
        observability,
        view_scatter: *scatter,
        rms_px: rms(&fit.errors_px, usable).unwrap_or_default(),
        rms_inlier_px: rms(&fit.errors_px, &fit.inliers).unwrap_or_default(),
        sigma_px: fit.sigma_px(views),
        unit_sigma_px: fit.sigma,
        corners_total: usable.iter().map(Vec::len).sum(),
        corners_inlier: fit.inliers.iter().flatten().filter(|&&inlier| inlier).count(),
        outliers: outliers(views, usable, &fit),
        skipped: alone.iter().flat_map(|pose| pose.skipped.iter().cloned()).collect(),
        warp: fit.warp,
        left: refined(&fit.shared.lenses.left, &rig.left_camera, Side::Left).map_err(StageError::Joint)?,
        right: refined(&fit.shared.lenses.right, &rig.right_camera, Side::Right).map_err(StageError::Joint)?,
        axes: rig.axes.clone(),
        state: state.clone(),
        mechanism,
        lens_numbers: fit.lens_numbers.clone(),
        covariance,
        reading_sigma: model.reading_sigma,
    })
}

/// The rows and columns of the mechanism's unknowns and of the lenses'; those of the readings at the stage poses, which
/// nobody asks for later, lie between.
fn without_readings(covariance: &DMatrix<f64>, mechanism: usize, kinematics: usize) -> DMatrix<f64> {
    let readings = kinematics - mechanism;
    covariance.clone().remove_rows(mechanism, readings).remove_columns(mechanism, readings)
}
