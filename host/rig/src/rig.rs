//! The rig's description after its checks.

use std::path::Path;

use nalgebra::Isometry3;
use vergence_protocol::{AxisList, Micro, PoseReport};
use vergence_vision::{InvalidLens, KannalaBrandt, Left, Right, Side, Transform};

use crate::axis::{AxisPosition, RigAxis};
use crate::calibration::RigCalibration;
use crate::chain::Chain;
use crate::exposure::Shutter;
use crate::mask::CameraMask;
use crate::mode::{Mode, ReportedMode};
use crate::repeatability::Repeatability;
use crate::trunk::RigTrunk;

/// A rig: its axes, modes and cameras, and the screw chains or the trunk by which the axes move the cameras.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// Name of the rig in its file.
    pub name: String,
    /// The axes, in the order of the board's; empty for a pair whose pose is fixed.
    pub axes: Vec<RigAxis>,
    /// The modes, sorted by name.
    pub modes: Vec<Mode>,
    /// The lens of the left camera.
    pub left_camera: KannalaBrandt,
    /// The lens of the right camera.
    pub right_camera: KannalaBrandt,
    /// The shutters of the left and the right camera.
    pub shutters: [Shutter; 2],
    /// What is left out of the images of the left and the right camera. Names of files are as the rig file states them.
    pub masks: [Option<CameraMask>; 2],
    /// The screw chain from the base to the left camera.
    pub left_chain: Chain<Left>,
    /// The screw chain from the base to the right camera.
    pub right_chain: Chain<Right>,
    /// The folding trunk that carries the cameras, in place of the screw chains, which then are empty.
    pub trunk: Option<Box<RigTrunk>>,
    /// How far its numbers may be off.
    pub calibration: RigCalibration,
    /// How far the right camera returns beside where the axes put it; `None` where that is not known, and counts as nothing.
    pub repeatability: Option<Repeatability>,
}

impl Rig {
    /// Makes a rig without axes, of two cameras whose relative pose is fixed. The base frame is that of the left
    /// camera. Nothing is known of its calibration.
    #[must_use]
    pub fn fixed_pair(
        name: &str,
        (left_camera, right_camera): (KannalaBrandt, KannalaBrandt),
        left_from_right: Transform<Left, Right>,
    ) -> Self {
        Self {
            name: name.to_owned(),
            axes: Vec::new(),
            modes: Vec::new(),
            left_camera,
            right_camera,
            shutters: [Shutter::Global; 2],
            masks: [None, None],
            left_chain: Chain::new(Vec::new(), Transform::from_isometry(Isometry3::identity())),
            right_chain: Chain::new(Vec::new(), left_from_right.renamed()),
            trunk: None,
            calibration: RigCalibration::Unknown,
            repeatability: None,
        }
    }

    /// The rig with sensors of the same size that have `width` pixels across, without masks: those are drawn in pixels of its own.
    ///
    /// # Errors
    /// Fails if `width` leaves no pixels.
    pub fn with_sensors(self, width: u32) -> Result<Self, InvalidLens> {
        let (left_camera, right_camera) = (self.left_camera.resampled(width)?, self.right_camera.resampled(width)?);
        let factors = [(&self.left_camera, &left_camera), (&self.right_camera, &right_camera)]
            .map(|(before, after)| f64::from(after.size().width) / f64::from(before.size().width));
        let calibration = match self.calibration {
            RigCalibration::Covariance(found) => RigCalibration::Covariance(found.resampled(factors)),
            other => other,
        };
        Ok(Self { left_camera, right_camera, masks: [None, None], calibration, ..self })
    }

    /// The rig whose masks, where they are files, have their names from `folder`.
    #[must_use]
    pub fn with_masks_from(self, folder: &Path) -> Self {
        let from_folder = |mask| match mask {
            CameraMask::File(file) => CameraMask::File(folder.join(file)),
            shapes @ CameraMask::Shapes(_) => shapes,
        };
        Self { masks: self.masks.map(|mask| mask.map(from_folder)), ..self }
    }

    /// The lens of the camera on `side`.
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

    /// The mode that `pose` reports; `None` while the board reports none.
    #[must_use]
    pub fn reported_mode(&self, pose: &PoseReport) -> Option<ReportedMode<'_>> {
        if pose.mode == vergence_protocol::Mode(0) {
            return None;
        }
        let Some(mode) = self.modes.iter().find(|mode| mode.number == pose.mode) else {
            return Some(ReportedMode::Unknown(pose.mode));
        };
        let known = mode.is_at(&self.axes, pose);
        Some(if known { ReportedMode::Known(mode) } else { ReportedMode::Elsewhere(mode) })
    }

    /// The index of the axis called `name`.
    #[must_use]
    pub fn axis_index(&self, name: &str) -> Option<usize> {
        self.axes.iter().position(|axis| axis.name == name)
    }

    /// The warnings of [`RigAxis::extrapolation`] for all axes at `positions`.
    #[must_use]
    pub fn extrapolations(&self, positions: &[AxisPosition]) -> Vec<String> {
        self.axes.iter().zip(positions).filter_map(|(axis, &position)| axis.extrapolation(position)).collect()
    }

    /// Converts positions of all axes to the wire's micrometres and microradians, by the axes' encoders.
    #[must_use]
    pub fn wire_targets(&self, positions: &[AxisPosition]) -> AxisList<Micro> {
        let axes = self.axes.iter().take(vergence_protocol::MAX_AXES);
        axes.zip(positions).map(|(axis, &position)| axis.wire_position(position)).collect()
    }

    /// Converts distances to the wire's micrometres and microradians.
    #[must_use]
    pub fn wire_distances(&self, distances: &[AxisPosition]) -> AxisList<Micro> {
        let axes = self.axes.iter().take(vergence_protocol::MAX_AXES);
        let by_encoder = |(axis, distance): (&RigAxis, &AxisPosition)| {
            let Micro(micro) = distance.micro();
            Micro(if axis.reversed { micro.saturating_neg() } else { micro })
        };
        axes.zip(distances).map(by_encoder).collect()
    }
}
