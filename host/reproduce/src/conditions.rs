//! The errors under which the bench is calibrated and measures, together and each alone.

use nalgebra::UnitQuaternion;
use vergence_lens::BuiltIn;
use vergence_scene::LensChoice;
use vergence_sim::Random;
use vergence_vision::{Angle, Left, Length, Right, Transform};

use crate::target_shot::Corners;

/// Noise of a corner's u or v in pixels, of the class that the goals are for.
pub const NOISE_PX: f64 = 0.1;
/// The lens of the simulation that no calibration knows: a published fisheye of 197°.
pub const TRUE_LENS: LensChoice = LensChoice::Traced(BuiltIn::Sigma8);
/// How far the right camera returns from where it stood before, unseen by the encoders.
const RETURN: Repeatability = Repeatability { shift: Length::from_mm(0.05), turn: Angle::from_deg(0.05) };

/// What the corners and the cameras of a simulated rig suffer from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conditions {
    /// Where corners come from.
    pub corners: Corners,
    /// Intended standard deviation of a corner's u or v, in pixels; the real one is measured.
    pub noise_px: f64,
    /// Of both cameras.
    pub lens: LensChoice,
    /// Of the right camera.
    pub repeatability: Repeatability,
    /// How far the middle line of a target stands out of the plane of its short sides, towards its back: it is bent about a line across its long
    /// side. Photographs that are rendered show flat targets alone: none where it is not zero.
    pub bow: Length,
}

/// How much a pose differs each time the stage returns to it: standard deviations along and about each axis of the camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Repeatability {
    /// Of the position.
    pub shift: Length,
    /// Of the direction.
    pub turn: Angle,
}

/// A kind of error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Noise of the corners.
    Corners,
    /// Lenses that are of another kind than the calibration assumes.
    Lens,
    /// Poses that the encoders do not see.
    Pose,
    /// All of them.
    All,
}

impl Conditions {
    /// Noise of the corners alone.
    #[must_use]
    pub fn noise(corners: Corners, noise_px: f64) -> Self {
        Self {
            corners,
            noise_px,
            lens: LensChoice::Ideal,
            repeatability: Repeatability::default(),
            bow: Length::from_mm(0.0),
        }
    }

    /// Where the right camera comes to stand when it returns to a pose.
    pub fn returned(&self, to: &Transform<Left, Right>, random: &mut Random) -> Transform<Left, Right> {
        let turn = UnitQuaternion::from_scaled_axis(random.vector(self.repeatability.turn.rad()));
        let shift = random.vector(self.repeatability.shift.mm());
        Transform::new(to.rotation() * turn, to.origin().mm() + to.rotation() * shift)
    }
}

impl Cause {
    /// In the order of the columns.
    pub const ALL: [Self; 4] = [Self::Corners, Self::Lens, Self::Pose, Self::All];

    /// The name of its column.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Corners => "corner noise",
            Self::Lens => "lens misfit",
            Self::Pose => "pose error",
            Self::All => "all together",
        }
    }

    /// How large it is here, on a bench with such lenses.
    #[must_use]
    pub fn size(self, lens: LensChoice) -> String {
        match self {
            Self::Corners => format!("{NOISE_PX} px in u and v"),
            Self::Lens => {
                format!("lenses traced from a published design, {} in the place of ideal ones", traced(lens))
            }
            Self::Pose => format!(
                "{:.2} mm and {:.2}° along and about each axis of the right camera, anew at every return",
                RETURN.shift.mm(),
                RETURN.turn.deg()
            ),
            Self::All => "the three of them".into(),
        }
    }

    /// The conditions in which it alone is present, on a bench with such lenses: only where it is the cause are they other than ideal.
    #[must_use]
    pub fn alone(self, corners: Corners, lens: LensChoice) -> Conditions {
        let mut conditions = Conditions::noise(corners, 0.0);
        if matches!(self, Self::Corners | Self::All) {
            conditions.noise_px = NOISE_PX;
        }
        if matches!(self, Self::Lens | Self::All) {
            conditions.lens = traced(lens);
        }
        if matches!(self, Self::Pose | Self::All) {
            conditions.repeatability = RETURN;
        }
        conditions
    }
}

/// The lens of a bench where it is a misfit: that of the paper's experiments where the bench's are ideal.
fn traced(lens: LensChoice) -> LensChoice {
    if lens == LensChoice::Ideal { TRUE_LENS } else { lens }
}
