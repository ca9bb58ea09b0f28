//! The numbers of a rig with screw chains that a calibration determines, and how the relative pose follows them.

use nalgebra::{Isometry3, Matrix6xX, Translation3, UnitQuaternion, Vector3, Vector6};
use vergence_vision::{Frame, LENS_PARAMETER_NAMES, LENS_PARAMETERS, Left, Point, Right, Side, Transform};

use crate::chain::{Chain, Screw};
use crate::pose::difference;
use crate::rig::Rig;

/// A number of a rig. `component` is 0, 1 or 2: along x, y or z of the base frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RigNumber {
    /// A lens parameter, numbered as in [`LENS_PARAMETER_NAMES`].
    Lens {
        /// The camera.
        side: Side,
        /// Its number, below [`LENS_PARAMETERS`].
        parameter: usize,
    },
    /// A turn of the direction of a screw, in radians; the point that a line goes through stays.
    ScrewDirection {
        /// The chain.
        side: Side,
        /// Number of the screw in its chain.
        screw: usize,
        /// Axis of the turn.
        component: usize,
    },
    /// A shift of the line of a screw, in millimetres.
    ScrewLine {
        /// The chain.
        side: Side,
        /// Number of the screw in its chain.
        screw: usize,
        /// Direction of the shift.
        component: usize,
    },
    /// A turn of the right camera with all axes at zero, about its own centre, in radians.
    RightTurn {
        /// Axis of the turn.
        component: usize,
    },
    /// A shift of the right camera with all axes at zero, in millimetres.
    RightShift {
        /// Direction of the shift.
        component: usize,
    },
    /// The ratio of an axis's true position to its stated one, less 1.
    Scale {
        /// Index of the axis.
        axis: usize,
    },
}

/// Names of the components in files.
const COMPONENTS: [&str; 3] = ["x", "y", "z"];

impl RigNumber {
    /// All numbers of `rig` that a file may name: the lenses', and those of its screw chains.
    fn all(rig: &Rig) -> Vec<Self> {
        let sides = [(Side::Left, rig.left_chain.links().len()), (Side::Right, rig.right_chain.links().len())];
        let mut all = Vec::new();
        for (side, screws) in sides {
            all.extend((0..LENS_PARAMETERS).map(|parameter| Self::Lens { side, parameter }));
            for screw in 0..screws {
                all.extend((0..3).map(|component| Self::ScrewDirection { side, screw, component }));
                all.extend((0..3).map(|component| Self::ScrewLine { side, screw, component }));
            }
        }
        if rig.trunk.is_none() {
            all.extend((0..3).map(|component| Self::RightTurn { component }));
            all.extend((0..3).map(|component| Self::RightShift { component }));
            all.extend((0..rig.axes.len()).map(|axis| Self::Scale { axis }));
        }
        all
    }

    /// The number's name in the file of `rig`.
    pub(super) fn name(self, rig: &Rig) -> String {
        let of = |component: usize| COMPONENTS.get(component).copied().unwrap_or("?");
        match self {
            Self::Lens { side, parameter } => {
                format!("{side}.camera.{}", LENS_PARAMETER_NAMES.get(parameter).copied().unwrap_or("?"))
            }
            Self::ScrewDirection { side, screw, component } => {
                format!("{side}.screw.{screw}.direction.{}", of(component))
            }
            Self::ScrewLine { side, screw, component } => format!("{side}.screw.{screw}.line.{}", of(component)),
            Self::RightTurn { component } => format!("right.at_zero.rotation.{}", of(component)),
            Self::RightShift { component } => format!("right.at_zero.origin.{}", of(component)),
            Self::Scale { axis } => {
                format!("axis.{}.scale", rig.axes.get(axis).map_or("?", |axis| axis.name.as_str()))
            }
        }
    }

    /// The number called `name` in the file of `rig`.
    pub(super) fn named(name: &str, rig: &Rig) -> Option<Self> {
        Self::all(rig).into_iter().find(|number| number.name(rig) == name)
    }

    /// The row of a lens parameter in [`vergence_vision::SharedCovariance`]; `None` for all others.
    #[must_use]
    pub const fn shared_row(self) -> Option<usize> {
        match self {
            Self::Lens { side: Side::Left, parameter } => Some(parameter),
            Self::Lens { side: Side::Right, parameter } => Some(LENS_PARAMETERS + parameter),
            _ => None,
        }
    }

    /// A step for differences: small against the curvature of the kinematics, large against rounding.
    const fn step(self) -> f64 {
        match self {
            Self::ScrewLine { .. } | Self::RightShift { .. } => 1e-2,
            _ => 1e-5,
        }
    }
}

impl Rig {
    /// Derivative of the relative pose by each of `numbers`, as a turn ω about the left axes in radians and a shift δ of the right
    /// camera in the left frame in millimetres.
    pub(super) fn pose_by_numbers(&self, numbers: &[RigNumber], left: &[f64], right: &[f64]) -> Matrix6xX<f64> {
        let columns: Vec<Vector6<f64>> = numbers
            .iter()
            .map(|&number| {
                if matches!(number, RigNumber::Lens { .. }) {
                    return Vector6::zeros();
                }
                let [less, more] = [-number.step(), number.step()].map(|by| self.moved(number, by, left, right));
                difference(&less, &more) / (2.0 * number.step())
            })
            .collect();
        Matrix6xX::from_columns(&columns)
    }

    /// `left_from_right` with one number off by `by`.
    fn moved(&self, number: RigNumber, by: f64, left: &[f64], right: &[f64]) -> Transform<Left, Right> {
        let scaled = |values: &[f64]| match number {
            RigNumber::Scale { axis } => values
                .iter()
                .enumerate()
                .map(|(index, value)| value * if index == axis { 1.0 + by } else { 1.0 })
                .collect(),
            _ => values.to_vec(),
        };
        let (left, right): (Vec<f64>, Vec<f64>) = (scaled(left), scaled(right));
        let base_from_left = self.left_chain.base_from_camera_off(Side::Left, number, by, &left);
        let base_from_right = self.right_chain.base_from_camera_off(Side::Right, number, by, &right);
        base_from_left.inverse() * base_from_right
    }
}

impl<C: Frame> Chain<C> {
    /// [`Self::base_from_camera`] with one number off by `by`.
    fn base_from_camera_off(
        &self,
        side: Side,
        number: RigNumber,
        by: f64,
        values: &[f64],
    ) -> Transform<vergence_vision::Base, C> {
        let along = |component: usize| Vector3::ith(component % 3, by);
        let mut pose = Isometry3::identity();
        for (index, link) in self.links().iter().enumerate() {
            let mut screw = link.screw;
            match (number, &mut screw) {
                (
                    RigNumber::ScrewDirection { side: of, screw: at, component },
                    Screw::Slide { along: direction } | Screw::Turn { about: direction, .. },
                ) if (of, at) == (side, index) => {
                    *direction = UnitQuaternion::from_scaled_axis(along(component)) * *direction;
                }
                (RigNumber::ScrewLine { side: of, screw: at, component }, Screw::Turn { through, .. })
                    if (of, at) == (side, index) =>
                {
                    *through = Point::from_mm(through.mm() + along(component));
                }
                _ => {}
            }
            pose *= screw.displacement(link.share * values.get(link.axis).copied().unwrap_or(0.0));
        }
        let mut at_zero = *self.at_zero().isometry();
        match number {
            RigNumber::RightTurn { component } if side == Side::Right => {
                at_zero.rotation = UnitQuaternion::from_scaled_axis(along(component)) * at_zero.rotation;
            }
            RigNumber::RightShift { component } if side == Side::Right => {
                at_zero = Translation3::from(along(component)) * at_zero;
            }
            _ => {}
        }
        Transform::from_isometry(pose * at_zero)
    }
}
