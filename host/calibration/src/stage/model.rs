//! The mechanism at the stage poses of a calibration, and its prior.

use nalgebra::{Isometry3, Matrix6xX};
use vergence_rig::{Repeatability, Screw};
use vergence_vision::{Angle, Length};

use crate::extrinsics::Kinematics;
use crate::reprojection::{POSE, difference};
use crate::schur_lm::Equations;
use crate::stage::Tolerance;
use crate::stage::mechanism::{State, direction};
use crate::stage::twist::across;
use crate::stage::unknowns::{Ordinal, Unknown};

/// Constants of the fit: drawing, readings, priors.
#[derive(Clone)]
pub(crate) struct Model {
    pub nominal: State,
    pub unknowns: Vec<Unknown>,
    /// Encoder readings of each stage pose, millimetres or radians.
    pub readings: Vec<Vec<f64>>,
    /// Standard deviation of a reading of each axis.
    pub reading_sigma: Vec<f64>,
    /// Standard deviation of each component of a return to a stage pose, in radians and millimetres; `None` where returns are no unknowns.
    pub return_sigma: Option<[f64; 2]>,
    /// The stage pose of each view.
    pub pose_of_view: Vec<usize>,
    pub tolerance: Option<Tolerance>,
}

impl Model {
    /// The readings of stage pose `pose`, corrected by their errors.
    pub fn corrected(&self, state: &State, pose: usize) -> Vec<f64> {
        let (Some(readings), Some(errors)) = (self.readings.get(pose), state.reading_errors.get(pose)) else {
            return Vec::new();
        };
        readings.iter().zip(errors).map(|(reading, error)| reading + error).collect()
    }

    /// The same stage, whose returns are exact, with returns to its poses that are off by these standard deviations.
    pub fn with_returns(&self, return_sigma: [f64; 2]) -> Self {
        let mut unknowns = self.unknowns.clone();
        unknowns.extend((0..self.readings.len()).flat_map(|pose| [Unknown::Return { pose }; POSE]));
        Self { unknowns, return_sigma: Some(return_sigma), ..self.clone() }
    }

    /// How well the stage returns to its poses, where that is unknown.
    pub fn repeatability(&self) -> Option<Repeatability> {
        let [rotation, translation] = self.return_sigma?;
        Some(Repeatability { rotation: Angle::from_rad(rotation), translation: Length::from_mm(translation) })
    }

    fn pose(&self, view: usize) -> usize {
        self.pose_of_view.get(view).copied().unwrap_or_default()
    }

    /// How far component `nth` of `unknown` is from its nominal value, in standard deviations of what is known of it,
    /// and the derivative by the same component and its neighbour; `None` where nothing is known.
    fn deviation(&self, state: &State, unknown: Unknown, nth: usize) -> Option<(f64, [f64; 2])> {
        let screws = |side, link: usize| {
            let screw = |state: &State| Some(state.links(side).get(link)?.screw);
            Some((screw(state)?, screw(&self.nominal)?))
        };
        match (unknown, self.tolerance) {
            (Unknown::Direction { side, link, .. }, Some(tolerance)) => {
                let (now, nominal) = screws(side, link)?;
                let (w, sigma) = (direction(&now), tolerance.direction.rad());
                // A tilt about one tangent moves the direction along the other.
                let tangent = across(&direction(&nominal))[nth % 2];
                let by = across(&w).map(|e| tangent.dot(&e.cross(&w)) / sigma);
                Some((tangent.dot(&w) / sigma, by))
            }
            (Unknown::Line { side, link, .. }, Some(tolerance)) => {
                let (Screw::Turn { about, through }, Screw::Turn { about: drawn, through: from }) = screws(side, link)?
                else {
                    return None;
                };
                let (tangent, sigma) = (across(&drawn)[nth % 2], tolerance.position.mm());
                let by = across(&about).map(|e| tangent.dot(&e) / sigma);
                Some((tangent.dot(&(through.mm() - from.mm())) / sigma, by))
            }
            (Unknown::Scale { axis }, Some(tolerance)) => {
                Some(((state.scales.get(axis)? - 1.0) / tolerance.scale, [1.0 / tolerance.scale, 0.0]))
            }
            (Unknown::Reading { pose, axis }, _) => {
                let sigma = *self.reading_sigma.get(axis)?;
                Some((state.reading_errors.get(pose)?.get(axis)? / sigma, [1.0 / sigma, 0.0]))
            }
            (Unknown::Return { pose }, _) => {
                let sigma = self.return_sigma?[nth / 3 % 2];
                let away = difference(state.returns.get(pose)?, &Isometry3::identity());
                // Of two neighbours, it is the first or the second.
                let by = if nth.is_multiple_of(2) { [1.0 / sigma, 0.0] } else { [0.0, 1.0 / sigma] };
                Some((away[nth % POSE] / sigma, by))
            }
            _ => None,
        }
    }
}

impl Kinematics for Model {
    type State = State;

    fn dimension(&self) -> usize {
        self.unknowns.len()
    }

    fn plus(&self, state: &State, step: &[f64]) -> State {
        state.plus(&self.unknowns, step)
    }

    fn left_from_right(&self, state: &State, view: usize) -> Isometry3<f64> {
        let pose = self.pose(view);
        state.left_from_right(&self.corrected(state, pose)) * state.returned(Some(pose))
    }

    fn derivative(&self, state: &State, view: usize) -> Matrix6xX<f64> {
        let pose = self.pose(view);
        state.derivative(&self.corrected(state, pose), &self.unknowns, Some(pose))
    }

    fn add_prior(&self, state: &State, sigma: f64, equations: &mut Equations<POSE>) {
        let mut ordinal = Ordinal::default();
        for (column, &unknown) in self.unknowns.iter().enumerate() {
            let nth = ordinal.next(unknown);
            let Some((deviation, by)) = self.deviation(state, unknown, nth) else { continue };
            let first = column - nth % 2;
            let mut shared = vec![[0.0]; first + 2];
            shared[first..].copy_from_slice(&by.map(|by| [by * sigma]));
            if !matches!(unknown, Unknown::Direction { .. } | Unknown::Line { .. }) {
                shared.truncate(column + 1);
            }
            equations.add_plain(&[deviation * sigma], &shared, &[[0.0]; POSE]);
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};
    use vergence_rig::{BENCH_TOML, Link, Rig};
    use vergence_vision::Point;

    use super::*;
    use crate::stage::{StageOptions, StagePose, start};

    fn model() -> Model {
        let mut rig = Rig::from_toml(BENCH_TOML).unwrap();
        // Nothing parallel, nothing through the origin.
        let tilted = |link: &Link, by: f64| {
            let tilt = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.2, 0.5) * by);
            let screw = match link.screw {
                Screw::Slide { along } => Screw::Slide { along: tilt * along },
                Screw::Turn { about, .. } => {
                    Screw::Turn { about: tilt * about, through: Point::from_mm(Vector3::new(7.0, 20.0, -11.0) * by) }
                }
            };
            Link { screw, ..*link }
        };
        let links: Vec<Link> = rig.left_chain.links().iter().map(|link| tilted(link, 0.7)).collect();
        rig.left_chain = vergence_rig::Chain::new(links, rig.left_chain.at_zero());
        let links: Vec<Link> = rig.right_chain.links().iter().map(|link| tilted(link, -1.1)).collect();
        let mount = Isometry3::new(Vector3::new(3.0, -2.0, 5.0), Vector3::new(0.1, 0.2, -0.1));
        rig.right_chain = vergence_rig::Chain::new(links, vergence_vision::Transform::from_isometry(mount));
        let readings = vec![
            vergence_rig::AxisPosition::Linear(vergence_vision::Length::from_mm(145.0)),
            vergence_rig::AxisPosition::Rotary(vergence_vision::Angle::from_deg(100.0)),
        ];
        let model = start::model(&rig, &[StagePose { readings, views: Vec::new() }], &StageOptions::default()).unwrap();
        let mut model = model.with_returns([0.01, 2.0]);
        model.nominal.returns.push(Isometry3::identity());
        model
    }

    /// By central differences, from a point away from the drawing.
    #[test]
    fn derivatives_are_those_of_the_relative_pose() {
        let model = model();
        let away: Vec<f64> = (0..model.dimension()).map(|i| 0.01 * ((i * 7 % 5) as f64 - 2.0)).collect();
        let state = model.plus(&model.nominal, &away);
        let derivative = model.derivative(&state, 0);
        let here = model.left_from_right(&state, 0);
        for component in 0..model.dimension() {
            let shifted = |step: f64| {
                let mut by = vec![0.0; model.dimension()];
                by[component] = step;
                difference(&model.left_from_right(&model.plus(&state, &by), 0), &here)
            };
            const STEP: f64 = 1e-5;
            let error = (shifted(STEP) - shifted(-STEP)) / (2.0 * STEP) - derivative.column(component);
            let unknown = model.unknowns[component];
            assert!(error.norm() < 1e-6 * (1.0 + derivative.column(component).norm()), "{unknown:?}: {error}");
        }
    }

    #[test]
    fn the_prior_pulls_towards_the_drawing() {
        let model = model();
        let away: Vec<f64> = (0..model.dimension()).map(|i| 0.004 * ((i * 7 % 5) as f64 - 2.0)).collect();
        let state = model.plus(&model.nominal, &away);
        let mut ordinal = Ordinal::default();
        for (column, &unknown) in model.unknowns.iter().enumerate() {
            let nth = ordinal.next(unknown);
            let Some((deviation, by)) = model.deviation(&state, unknown, nth) else {
                assert!(matches!(unknown, Unknown::Rotation | Unknown::Position));
                continue;
            };
            for (neighbour, derivative) in by.iter().enumerate().take(if nth == 0 && by[1] == 0.0 { 1 } else { 2 }) {
                let first = column - nth % 2;
                let mut step = vec![0.0; model.dimension()];
                step[first + neighbour] = 1e-6;
                let (moved, _) = model.deviation(&model.plus(&state, &step), unknown, nth).unwrap();
                let error = (moved - deviation) / 1e-6 - derivative;
                // Returns are small: their derivative is that at none.
                let returns =
                    if matches!(unknown, Unknown::Return { .. }) { 1e-2 * by[0].abs().max(by[1].abs()) } else { 0.0 };
                assert!(
                    error.abs() < 1e-3 * (1.0 + derivative.abs()) + returns,
                    "{unknown:?} {nth} {neighbour}: {error}"
                );
            }
        }
    }
}
