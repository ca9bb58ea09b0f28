//! From an exposure to points, or to bearings where one camera is dead: develop the pictures, match, triangulate.

use image::RgbImage;
use vergence_matching::Matcher;
use vergence_rig::{BoardInstant, Exposure, JointTrack, Joints, JointsAt, PairExposure, Rig, RigPose, TrackGap};
use vergence_vision::Side;

use super::exposures::{Exposed, Shot};
use crate::failure::Failure;
use crate::look::{Bearing, Eyes, Look, bearings, look_exposed};
use crate::stopwatch::Stopwatch;

/// What came of one exposure. It holds nothing of any other.
pub struct Measured {
    /// Points or bearings.
    pub seen: Seen,
    /// The middle of the exposure.
    pub middle: BoardInstant,
    /// How long developing the pictures took: rendering, where they are simulated.
    pub develop_seconds: f64,
    /// How long matching and triangulation took.
    pub seconds: f64,
}

/// What was seen.
pub enum Seen {
    /// By both cameras.
    Points {
        /// In the frame of the left camera at its middle row.
        look: Box<Look>,
        /// Where the cameras were then.
        pose: Box<RigPose>,
        /// Whether the stages moved.
        moving: bool,
    },
    /// By one camera, because the other is dead.
    Bearings {
        /// The living one.
        side: Side,
        /// In its frame.
        bearings: Vec<Bearing>,
        /// Why the other is dead.
        why: String,
    },
}

/// The joints of a rig while a pair was exposed.
pub enum Motion {
    /// As the encoders told.
    Read(JointTrack),
    /// The rig has no axes.
    Fixed,
}

impl Joints for Motion {
    fn at(&self, instant: BoardInstant) -> Result<JointsAt, TrackGap> {
        match self {
            Self::Read(track) => track.at(instant),
            Self::Fixed => Ok(JointsAt::latched(&[])),
        }
    }
}

impl Motion {
    /// Whether any encoder told more at `middle` than just before.
    fn moves(&self, middle: BoardInstant) -> bool {
        const BEFORE_US: f64 = 5_000.0;
        const COUNTS: f64 = 2.0;
        let before = BoardInstant { us: middle.us - BEFORE_US, ..middle };
        let (Ok(before), Ok(now)) = (self.at(before), self.at(middle)) else { return false };
        before.counts.iter().zip(&now.counts).any(|(before, now)| (now - before).abs() > COUNTS)
    }
}

/// The exposure of a pair by `rig`'s cameras with these middles.
#[must_use]
pub fn pair_exposure(rig: &Rig, middles: [BoardInstant; 2]) -> PairExposure {
    let rows = [rig.left_camera, rig.right_camera].map(|camera| camera.size().height);
    let exposure = |side: usize| Exposure { middle: middles[side], shutter: rig.shutters[side], rows: rows[side] };
    PairExposure { left: exposure(0), right: exposure(1) }
}

/// Develops and measures `exposed`.
///
/// # Errors
/// A picture that is none or not of its camera's size, joints that are not known, cameras that share no field.
pub fn measure(exposed: Exposed, rig: &Rig, motion: &Motion, matcher: &dyn Matcher) -> Result<Measured, Failure> {
    let developing = Stopwatch::start();
    match exposed {
        Exposed::Pair(shots) => {
            let [left, right] = *shots;
            let exposure = pair_exposure(rig, [left.middle, right.middle]);
            let middle = left.middle;
            let (left, right) = rayon::join(|| develop(left), || develop(right));
            let (left, right) = (left?, right?);
            let develop_seconds = developing.seconds();
            let working = Stopwatch::start();
            let eyes = Eyes { left: &left, right: &right };
            let (look, placed) = look_exposed(eyes, rig, motion, &exposure, matcher)
                .map_err(|error| Failure::device(format!("the pair cannot be measured: {error}")))?;
            let seen = Seen::Points { look: Box::new(look), pose: Box::new(placed.pose), moving: motion.moves(middle) };
            Ok(Measured { seen, middle, develop_seconds, seconds: working.seconds() })
        }
        Exposed::One { side, shot, why } => {
            let middle = shot.middle;
            let image = develop(*shot)?;
            let develop_seconds = developing.seconds();
            let working = Stopwatch::start();
            let seen = Seen::Bearings { side, bearings: bearings(&image, rig.camera(side)), why };
            Ok(Measured { seen, middle, develop_seconds, seconds: working.seconds() })
        }
    }
}

fn develop(shot: Shot) -> Result<RgbImage, Failure> {
    (shot.frame.picture)()
}
