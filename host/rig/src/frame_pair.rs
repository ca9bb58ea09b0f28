//! Which camera frame belongs to which trigger pulse.
//!
//! A pulse is known exactly on the board's clock, and where the axes were at its edge. A frame carries the time stamp of
//! the camera's driver, later than the pulse by exposure, readout and transfer: by a delay that varies, but within
//! limits. Frames and pulses are both lost at times, so counting does not pair them; time does, as long as the delay is
//! known to less than the time between two pulses.

use vergence_protocol::{FrameMark, Microseconds};

use crate::clock::ClockMap;

/// A frame as its driver stamped it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StampedFrame {
    /// The driver's number; it grows by one for each frame that the camera took, lost ones included.
    pub seq: u32,
    /// The driver's stamp, host clock.
    pub at: Microseconds,
}

/// How long after its pulse a frame is stamped, in microseconds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TriggerDelay {
    /// At least.
    pub least_us: u64,
    /// At most.
    pub most_us: u64,
}

/// A frame and its pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FramePair {
    /// Index into the frames.
    pub frame: usize,
    /// Index into the marks.
    pub mark: usize,
    /// How long after the pulse the frame was stamped, in microseconds.
    pub delay_us: f64,
    /// How far that may be off, by the clock map.
    pub error_us: f64,
}

/// What became of frames and marks.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Pairing {
    /// In the order of the frames.
    pub pairs: Vec<FramePair>,
    /// Frames without a pulse: the mark was lost, or something else fired the camera.
    pub frames_without_mark: Vec<usize>,
    /// Pulses without a frame: the camera missed it, or the frame was lost.
    pub marks_without_frame: Vec<usize>,
    /// Pulses whose marks never arrived, by the gaps in their numbers.
    pub marks_lost: u32,
    /// Frames that the camera took and that never arrived, by the gaps in their numbers.
    pub frames_lost: u32,
}

/// Why nothing can be paired.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PairingError {
    /// The clocks were never compared.
    #[error("the board's clock is not known yet")]
    NoClock,
    /// Two pulses fit one frame.
    #[error(
        "pulses {apart_us:.0} us apart cannot be told apart by frames whose delay is uncertain by {uncertain_us:.0} us"
    )]
    Ambiguous {
        /// Between the two closest pulses.
        apart_us: f64,
        /// Width of the delay, the clock's error on both sides included.
        uncertain_us: f64,
    },
}

/// Pairs `frames` with `marks`, both in order of time. `marks` belong to one setting of the trigger.
///
/// # Errors
/// [`PairingError`] where the answer would be a guess.
pub fn pair_frames(
    frames: &[StampedFrame],
    marks: &[FrameMark],
    clock: &ClockMap,
    delay: TriggerDelay,
) -> Result<Pairing, PairingError> {
    let pulses: Vec<_> =
        marks.iter().map(|mark| clock.host_at(mark.at).ok_or(PairingError::NoClock)).collect::<Result<_, _>>()?;
    let width = delay.most_us.saturating_sub(delay.least_us) as f64;
    for neighbours in pulses.windows(2) {
        let [first, second] = neighbours else { continue };
        let (apart_us, uncertain_us) = (second.us - first.us, width + first.error_us + second.error_us);
        if apart_us <= uncertain_us {
            return Err(PairingError::Ambiguous { apart_us, uncertain_us });
        }
    }
    let mut pairing = Pairing {
        marks_lost: missing(marks.iter().map(|mark| mark.seq)),
        frames_lost: missing(frames.iter().map(|frame| frame.seq)),
        ..Pairing::default()
    };
    let mut next = 0;
    for (frame, stamped) in frames.iter().enumerate() {
        // Whatever the error of the clock, pulses that are too long ago fit no later frame either.
        while let Some(pulse) = pulses.get(next)
            && stamped.at.0 as f64 - pulse.us > delay.most_us as f64 + pulse.error_us
        {
            pairing.marks_without_frame.push(next);
            next += 1;
        }
        let fitting = pulses.get(next).map(|pulse| (stamped.at.0 as f64 - pulse.us, pulse.error_us));
        match fitting {
            Some((delay_us, error_us)) if delay_us >= delay.least_us as f64 - error_us => {
                pairing.pairs.push(FramePair { frame, mark: next, delay_us, error_us });
                next += 1;
            }
            _ => pairing.frames_without_mark.push(frame),
        }
    }
    pairing.marks_without_frame.extend(next..pulses.len());
    Ok(pairing)
}

/// How many numbers are left out; one that goes back begins anew.
fn missing(numbers: impl Iterator<Item = u32> + Clone) -> u32 {
    let next = numbers.clone().skip(1);
    numbers.zip(next).map(|(before, after)| after.checked_sub(before).map_or(0, |step| step.saturating_sub(1))).sum()
}
