//! The figures of a calibrated stage: screws, zeros and stage poses.

use nalgebra::{DMatrix, Isometry3};
use vergence_rig::{AxisPosition, Link, Rig, RigAxis, Screw};
use vergence_vision::{Angle, Length};

use crate::extrinsics::{ExtrinsicsCalibration, Fit, Side, rms};
use crate::reprojection::difference;
use crate::stage::mechanism::State;
use crate::stage::model::Model;
use crate::stage::unknowns::Unknown;
use crate::stage::{FittedScrew, StagePoseFigures, ZeroOffset};

pub(crate) fn screws(
    state: &State,
    mechanism: &[Unknown],
    sigma: &dyn Fn(usize) -> f64,
    names: &[String],
) -> Vec<FittedScrew> {
    let worst = |wanted: Unknown| {
        let of = mechanism.iter().enumerate().filter(|(_, unknown)| **unknown == wanted);
        of.map(|(index, _)| sigma(index)).fold(0.0, f64::max)
    };
    let of_side = |side: Side, links: &[Link]| -> Vec<FittedScrew> {
        let fitted = |(link, Link { axis, screw, .. }): (usize, &Link)| FittedScrew {
            side,
            axis: names.get(*axis).cloned().unwrap_or_default(),
            screw: *screw,
            direction_sigma: Angle::from_rad(worst(Unknown::Direction { side, link, axis: *axis })),
            position_sigma: matches!(screw, Screw::Turn { .. })
                .then(|| Length::from_mm(worst(Unknown::Line { side, link, axis: *axis }))),
        };
        links.iter().enumerate().map(fitted).collect()
    };
    [of_side(Side::Left, &state.left), of_side(Side::Right, &state.right)].concat()
}

/// The right camera's displacement at zero along the twist that each axis would make there, by least squares.
pub(crate) fn zero_offsets(
    rig: &Rig,
    nominal: &State,
    state: &State,
    mechanism: &[Unknown],
    covariance: &DMatrix<f64>,
) -> Vec<ZeroOffset> {
    let zero = vec![0.0; rig.axes.len()];
    let displacement = difference(&state.left_from_right(&zero), &nominal.left_from_right(&zero));
    let derivative = state.derivative(&zero, mechanism, None);
    let spread = &derivative * covariance * derivative.transpose();
    let offset = |(index, axis): (usize, &RigAxis)| {
        let mut along = state.by_reading(&zero, index);
        // A slide moves the position only; the position's part of a turn depends on where the mount is.
        if matches!(axis.range[0], AxisPosition::Rotary(_)) {
            along.fixed_rows_mut::<3>(3).fill(0.0);
        }
        let gain = along / along.norm_squared();
        let sigma = (gain.transpose() * spread * gain)[(0, 0)].max(0.0).sqrt();
        gain.iter().all(|g| g.is_finite()).then(|| ZeroOffset {
            axis: axis.name.clone(),
            offset: AxisPosition::from_value(axis.kind, gain.dot(&displacement)),
            sigma: AxisPosition::from_value(axis.kind, sigma),
        })
    };
    rig.axes.iter().enumerate().filter_map(offset).collect()
}

pub(crate) fn pose_figures(
    rig: &Rig,
    model: &Model,
    fit: &Fit<State>,
    alone: &[ExtrinsicsCalibration],
) -> Vec<StagePoseFigures> {
    let figures = |(pose, alone): (usize, &ExtrinsicsCalibration)| {
        let of_pose = |list: &[Vec<f64>]| -> Vec<Vec<f64>> {
            let views = list.iter().zip(&model.pose_of_view).filter(|(_, of)| **of == pose);
            views.map(|(errors, _)| errors.clone()).collect()
        };
        let inliers: Vec<Vec<bool>> = fit
            .inliers
            .iter()
            .zip(&model.pose_of_view)
            .filter(|(_, of)| **of == pose)
            .map(|(inliers, _)| inliers.clone())
            .collect();
        let stage: Isometry3<f64> = fit.shared.state.left_from_right(&model.corrected(&fit.shared.state, pose));
        let own = alone.joint.left_from_right;
        let readings = model.readings.get(pose).into_iter().flatten();
        StagePoseFigures {
            readings: readings.zip(&rig.axes).map(|(&v, axis)| AxisPosition::from_value(axis.kind, v)).collect(),
            alone: own,
            rotation_difference: Angle::from_rad(stage.rotation.angle_to(&own.rotation())),
            translation_difference: Length::from_mm((stage.translation.vector - own.origin().mm()).norm()),
            rms_inlier_px: rms(&of_pose(&fit.errors_px), &inliers).unwrap_or_default(),
        }
    };
    alone.iter().enumerate().map(figures).collect()
}
