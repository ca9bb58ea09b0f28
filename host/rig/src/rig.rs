//! A rig whose description has been checked.

use nalgebra::Isometry3;
use vergence_protocol::{AxisList, Micro};
use vergence_vision::{Angle, KannalaBrandt, Left, Length, Right, Side, Transform};

use crate::axis::{AxisPosition, RigAxis};
use crate::chain::Chain;
use crate::moving::Shutter;

/// The rig: axes, modes, cameras and how the axes carry the cameras.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// What it is called.
    pub name: String,
    /// In the order of the controller's axes; none for a pair whose pose is fixed.
    pub axes: Vec<RigAxis>,
    /// By name.
    pub modes: Vec<Mode>,
    /// The left camera.
    pub left_camera: KannalaBrandt,
    /// The right camera.
    pub right_camera: KannalaBrandt,
    /// How the left and the right camera expose their rows.
    pub shutters: [Shutter; 2],
    /// From the base to the left camera.
    pub left_chain: Chain<Left>,
    /// From the base to the right camera.
    pub right_chain: Chain<Right>,
    /// How far the calibrated relative pose may be off: one standard deviation of rotation and translation.
    pub calibration_sigma: (Angle, Length),
}

/// A named pose.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// Such as `herbivore`.
    pub name: String,
    /// Its number on the wire, from 1.
    pub number: vergence_protocol::Mode,
    /// Where each axis goes.
    pub targets: Vec<AxisPosition>,
}

impl Rig {
    /// Two cameras whose pose is fixed: no axes, the base is where the left camera is. `sigma` is the standard deviation
    /// of rotation and translation of `left_from_right`.
    #[must_use]
    pub fn fixed_pair(
        name: &str,
        (left_camera, right_camera): (KannalaBrandt, KannalaBrandt),
        left_from_right: Transform<Left, Right>,
        sigma: (Angle, Length),
    ) -> Self {
        Self {
            name: name.to_owned(),
            axes: Vec::new(),
            modes: Vec::new(),
            left_camera,
            right_camera,
            shutters: [Shutter::Global; 2],
            left_chain: Chain::new(Vec::new(), Transform::from_isometry(Isometry3::identity())),
            right_chain: Chain::new(Vec::new(), left_from_right.renamed()),
            calibration_sigma: sigma,
        }
    }

    /// The camera on `side`.
    #[must_use]
    pub const fn camera(&self, side: Side) -> &KannalaBrandt {
        match side {
            Side::Left => &self.left_camera,
            Side::Right => &self.right_camera,
        }
    }

    /// The mode called `name`.
    #[must_use]
    pub fn mode(&self, name: &str) -> Option<&Mode> {
        self.modes.iter().find(|mode| mode.name == name)
    }

    /// The name of a mode number of the wire; `None` for zero and for numbers the rig does not name.
    #[must_use]
    pub fn mode_name(&self, number: vergence_protocol::Mode) -> Option<&str> {
        self.modes.iter().find(|mode| mode.number == number).map(|mode| mode.name.as_str())
    }

    /// The index of the axis called `name`.
    #[must_use]
    pub fn axis_index(&self, name: &str) -> Option<usize> {
        self.axes.iter().position(|axis| axis.name == name)
    }

    /// A sentence for each axis whose position lies beyond what was calibrated.
    #[must_use]
    pub fn extrapolations(&self, positions: &[AxisPosition]) -> Vec<String> {
        self.axes.iter().zip(positions).filter_map(|(axis, &position)| axis.extrapolation(position)).collect()
    }

    /// Positions as they go over the wire.
    #[must_use]
    pub fn wire_targets(&self, positions: &[AxisPosition]) -> AxisList<Micro> {
        positions.iter().take(vergence_protocol::MAX_AXES).map(|position| position.micro()).collect()
    }
}
