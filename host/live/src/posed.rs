//! Where the cameras were at an exposure, by the encoder readings that have come so far, or by the last ones where the link to the board ended.

use std::time::Duration;

use vergence_board::{BoardKnowledge, LastReading, LostAxis, Told};
use vergence_camera::PendingImage;
use vergence_pipeline::limits::FLICKER_COUNTS;
use vergence_pipeline::{Exposed, ExposedImage, Motion, PairPose, SkipReason, UntoldAxes, pair_exposure};
use vergence_rig::{BoardInstant, JointTrack, Joints, Rig, TrackGap};

use crate::measure::PosedExposure;

/// Longest wait for the encoder readings of an exposure.
pub const READINGS: Duration = Duration::from_millis(300);
/// Longest time for which the last readings are used after the link ended.
pub const LONGEST_UNSEEN: Duration = Duration::from_secs(10);
/// A board that was moving when the link ended has come to rest after this time: its lease has run out, and it has braked.
pub const AT_REST: Duration = Duration::from_secs(3);
/// Encoder readings this long before and after an exposure are kept with it, in microseconds.
const MARGIN_US: f64 = 250_000.0;

/// An exposure, and what is known of its pose.
pub enum Posed {
    /// The pose is known.
    Ready(PosedExposure),
    /// The readings that cover it have not come yet.
    NotYet(Exposed<PendingImage>),
    /// It will not be known.
    Skipped(SkipReason),
}

/// The exposure with its pose, by what `board` knows now; without a board the rig does not move.
#[must_use]
pub fn pose(exposed: Exposed<PendingImage>, rig: &Rig, board: Option<&BoardKnowledge>) -> Posed {
    let images = match exposed {
        Exposed::Pair(images) => images,
        Exposed::One { side, image, why } => return Posed::Ready(PosedExposure::One { side, image, why }),
    };
    let middles = images.each_ref().map(|image| image.middle);
    let exposure = pair_exposure(rig, middles);
    let Some(board) = board else {
        return match PairPose::in_motion(rig, Motion::Fixed, exposure) {
            Ok(pose) => Posed::Ready(PosedExposure::Pair(images, Box::new(pose))),
            Err(_) => Posed::Skipped(SkipReason::EncodersUnknown),
        };
    };
    let (first, last) = (middles[0].us.min(middles[1].us), middles[0].us.max(middles[1].us));
    let track = board.track_between(first - MARGIN_US, last + MARGIN_US);
    match PairPose::in_motion(rig, Motion::Read(track.clone()), exposure) {
        Ok(pose) => match board.told_at(first) {
            Told::All => Posed::Ready(PosedExposure::Pair(images, Box::new(pose))),
            Told::AllBut(lost) => untold(images, &track, &lost),
            Told::Nothing => Posed::Skipped(SkipReason::EncodersUnknown),
        },
        Err(TrackGap::NotYet) => match board.last_reading() {
            Some(last) => unseen(images, rig, board, last),
            None => Posed::NotYet(Exposed::Pair(images)),
        },
        Err(_) => Posed::Skipped(SkipReason::EncodersUnknown),
    }
}

/// The exposure of a rig whose board says nothing any more: where the axes stood at the `last` reading, less and less surely. Axes that moved
/// then came to rest somewhere, which the images must tell.
fn unseen(images: Box<[ExposedImage<PendingImage>; 2]>, rig: &Rig, board: &BoardKnowledge, last: LastReading) -> Posed {
    let LastReading { mut joints, at, moving } = last;
    let middle = images[0].middle;
    let unseen = Duration::from_secs_f64(((middle.us - at.0 as f64) * 1e-6).max(0.0));
    let lost = match board.told_at(middle.us) {
        Told::All => Vec::new(),
        Told::AllBut(lost) => lost.iter().map(|lost| lost.axis).collect(),
        Told::Nothing => return Posed::Skipped(SkipReason::LinkEnded),
    };
    if unseen > LONGEST_UNSEEN || moving && unseen < AT_REST {
        return Posed::Skipped(SkipReason::LinkEnded);
    }
    for (sigma, axis) in joints.sigma.iter_mut().zip(&rig.axes) {
        *sigma = axis.sigma_unseen(unseen);
    }
    let untold = if moving { (0..rig.axes.len()).collect() } else { lost };
    if untold.is_empty() {
        let pose = Box::new(PairPose::standing(rig.pose(&joints)));
        return Posed::Ready(PosedExposure::Unseen(images, pose, unseen));
    }
    Posed::Ready(PosedExposure::Untold(images, UntoldAxes { joints, axes: untold }, Some(unseen)))
}

/// The exposure of a rig that stands, with the last readings of the axes that no encoder tells.
fn untold(images: Box<[ExposedImage<PendingImage>; 2]>, track: &JointTrack, lost: &[LostAxis]) -> Posed {
    const BEFORE_US: f64 = 5_000.0;
    let middle = images[0].middle;
    let read = |us| track.at(BoardInstant { us, ..middle });
    let (before, mut joints) = match (read(middle.us - BEFORE_US), read(middle.us)) {
        (Ok(before), Ok(joints)) => (before, joints),
        (Err(TrackGap::NotYet), _) | (_, Err(TrackGap::NotYet)) => return Posed::NotYet(Exposed::Pair(images)),
        _ => return Posed::Skipped(SkipReason::EncodersUnknown),
    };
    let axes: Vec<usize> = lost.iter().map(|lost| lost.axis).collect();
    let readings = before.counts.iter().zip(&joints.counts).enumerate();
    let mut told = readings.filter(|(index, _)| !axes.contains(index));
    if told.any(|(_, (before, now))| (now - before).abs() > FLICKER_COUNTS) {
        return Posed::Skipped(SkipReason::EncodersUnknown);
    }
    for lost in lost {
        joints.counts.iter_mut().skip(lost.axis).take(1).for_each(|counts| *counts = f64::from(lost.last.0));
    }
    Posed::Ready(PosedExposure::Untold(images, UntoldAxes { joints, axes }, None))
}
