//! Where both cameras were while they exposed a pair.

use vergence_protocol::Counts;
use vergence_rig::{
    AxisPosition, BoardInstant, Exposure, ExposureDelay, ImagePairing, JointTrack, Joints, JointsAt, MiddlePose,
    PairExposure, PairingOutcome, Rig, RigPose, StampedImage, SteadyMotion, TimedEvent, TrackGap, middle_pose,
};
use vergence_vision::Angle;

/// Joint positions of a rig while a pair was exposed, and their uncertainty.
#[derive(Clone, Debug)]
pub enum Motion {
    /// The readings of the encoders around the exposure.
    Read(JointTrack),
    /// Constant speed of every axis.
    Steady(SteadyMotion),
    /// The rig has no axes.
    Fixed,
}

impl Joints for Motion {
    fn at(&self, instant: BoardInstant) -> Result<JointsAt, TrackGap> {
        match self {
            Self::Read(track) => track.at(instant),
            Self::Steady(motion) => motion.at(instant),
            Self::Fixed => Ok(JointsAt::latched(&[])),
        }
    }
}

/// The exposure of a pair by the cameras of `rig` whose middle rows were exposed at `middles` (left, right).
#[must_use]
pub fn pair_exposure(rig: &Rig, middles: [BoardInstant; 2]) -> PairExposure {
    let rows = [rig.left_camera, rig.right_camera].map(|camera| camera.size().height);
    let exposure = |side: usize| Exposure { middle: middles[side], shutter: rig.shutters[side], rows: rows[side] };
    PairExposure { left: exposure(0), right: exposure(1) }
}

/// Where both cameras were while they exposed a pair: in one pose, or in one of its own for every row.
#[derive(Clone, Debug)]
pub struct PairPose {
    middle: MiddlePose,
    rows: Option<(Motion, PairExposure)>,
}

/// The image of a triggered camera belongs to another pulse than was said, or to none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the image belongs to no trigger pulse: it was not exposed when the pulse fired the cameras")]
pub struct UnpairedImage;

/// An image, and the trigger pulse that is said to have fired it.
#[derive(Clone, Copy, Debug)]
pub struct TriggeredImage<'a> {
    /// The pulse, on the host's clock.
    pub pulse: TimedEvent,
    /// Encoder counts of every axis that the board latched at the pulse.
    pub counts: &'a [Counts],
    /// The time stamp of the image, on the host's clock.
    pub stamp: StampedImage,
    /// Range of delays after a pulse in which this camera may expose an image.
    pub delay: ExposureDelay,
}

impl PairPose {
    /// One pose for both whole images: the rig stood still.
    #[must_use]
    pub const fn standing(pose: RigPose) -> Self {
        Self { middle: MiddlePose { pose, sweep: Angle::from_rad(0.0) }, rows: None }
    }

    /// The pose at a single trigger pulse: where the encoders were at its edge.
    ///
    /// # Errors
    /// [`UnpairedImage`] where the time stamps say that the image belongs to another pulse.
    pub fn at_pulse(rig: &Rig, image: &TriggeredImage<'_>) -> Result<Self, UnpairedImage> {
        // The next pulse comes only when somebody asks for it.
        let mut pairing = ImagePairing::new(image.delay, f64::INFINITY);
        pairing.event(image.pulse);
        pairing.image(image.stamp);
        match pairing.take() {
            Some(PairingOutcome::Paired { .. }) => Ok(Self::standing(rig.pose(&JointsAt::latched(image.counts)))),
            _ => Err(UnpairedImage),
        }
    }

    /// A pose for every row: where `motion` had the joints when the row was exposed.
    ///
    /// # Errors
    /// [`TrackGap`] where `motion` does not cover the exposure.
    pub fn in_motion(rig: &Rig, motion: Motion, exposure: PairExposure) -> Result<Self, TrackGap> {
        let middle = middle_pose(rig, &motion, &exposure)?;
        Ok(Self { middle, rows: Some((motion, exposure)) })
    }

    /// A pose for every row, for a pair whose middle rows were exposed with the axes at `positions` while they moved steadily.
    /// `speeds` are in millimetres or radians per second, one for each axis; positions and instants are taken as exact.
    ///
    /// # Errors
    /// As [`Self::in_motion`].
    pub fn at_speed(rig: &Rig, positions: &[AxisPosition], speeds: &[f64]) -> Result<Self, TrackGap> {
        let rates =
            rig.axes.iter().zip(speeds).map(|(axis, speed)| speed * 1e-6 / (axis.direction() * axis.value_per_count()));
        let rates = rates.collect();
        let counts = rig.axes.iter().zip(positions).map(|(axis, at)| axis.counts_at(at.value())).collect();
        let known = vec![0.0; rig.axes.len()];
        let joints = JointsAt { counts, sigma: known.clone(), timing: known };
        let middle = BoardInstant { us: 0.0, error_us: 0.0 };
        let motion = Motion::Steady(SteadyMotion { from_us: 0.0, joints, rates });
        Self::in_motion(rig, motion, pair_exposure(rig, [middle; 2]))
    }

    /// The pose of the left camera at its middle row, and of the right camera at its own.
    #[must_use]
    pub const fn at_middle(&self) -> &RigPose {
        &self.middle.pose
    }

    /// How far the relative rotation turned from the middle rows to the first or the last, whichever is more.
    #[must_use]
    pub const fn sweep(&self) -> Angle {
        self.middle.sweep
    }

    /// Motion and exposure for the pose of every row; `None` where one pose holds for all.
    pub(crate) const fn rows(&self) -> Option<&(Motion, PairExposure)> {
        self.rows.as_ref()
    }

    /// Whether the pose turned by less than it is uncertain while the images were exposed.
    #[must_use]
    pub fn is_steady(&self) -> bool {
        self.rows.is_none() || self.middle.sweep < self.middle.pose.rotation_sigma
    }

    /// Whether any encoder changed by more than two counts in the 5 ms before the middle of the left exposure.
    #[must_use]
    pub fn is_moving(&self) -> bool {
        const BEFORE_US: f64 = 5_000.0;
        const COUNTS: f64 = 2.0;
        let Some((motion, exposure)) = &self.rows else { return false };
        let middle = exposure.left.middle;
        let before = BoardInstant { us: middle.us - BEFORE_US, ..middle };
        let (Ok(before), Ok(now)) = (motion.at(before), motion.at(middle)) else { return false };
        before.counts.iter().zip(&now.counts).any(|(before, now)| (now - before).abs() > COUNTS)
    }
}
