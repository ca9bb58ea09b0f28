//! Homing of several axes, one after the other, so that a switch wired to the wrong axis is noticed.

use vergence_protocol::{AxisList, AxisMask, Counts, FaultCode};

use crate::axis::Axis;
use crate::contact::Contact;
use crate::homing::{Homing, Progress};
use crate::io::RigIo;

/// Ticks in which axes with an absolute encoder are watched instead of homed: long enough for hosts to hear of it.
const WATCH_TICKS: u8 = 50;

/// The axes still to be homed, and the state of the present one.
#[derive(Clone, Debug, Default)]
pub struct HomingSequence {
    left: AxisMask,
    present: Option<(usize, Homing)>,
    /// Ticks left of [`WATCH_TICKS`].
    watch: u8,
    /// The home switches of all axes.
    contacts: AxisList<Contact>,
}

/// Why homing ended without a reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HomingFailure {
    pub code: FaultCode,
    pub axis: usize,
    pub detail: i32,
}

impl HomingSequence {
    /// Starts homing of the axes `which`, the lowest first. They lose their references, but for those with an absolute
    /// encoder, which need no homing.
    pub fn start(which: AxisMask, axes: &mut [Axis]) -> Self {
        let mut left = AxisMask::default();
        let needs = |axis: &Axis| !axis.settings.feedback.is_absolute();
        for (index, axis) in axes.iter_mut().enumerate().filter(|(index, axis)| which.contains(*index) && needs(axis)) {
            axis.forget_reference();
            left = left.with(index);
        }
        let watch = if left == which { 0 } else { WATCH_TICKS };
        Self { left, watch, present: None, contacts: axes.iter().map(|_| Contact::default()).collect() }
    }

    /// Runs one tick; returns true when all axes have their reference.
    pub fn poll(&mut self, axes: &mut [Axis], io: &impl RigIo) -> Result<bool, HomingFailure> {
        let Some((index, homing)) = &mut self.present else { return Ok(self.begin_next(axes)) };
        let index = *index;
        let Some(axis) = axes.get_mut(index) else { return Ok(true) };
        match homing.poll(axis, io) {
            Progress::Running => {}
            Progress::Done => self.present = None,
            Progress::Failed { code, detail } => return Err(HomingFailure { code, axis: index, detail }),
        }
        match self.stranger(index, io) {
            Some(stranger) => {
                let detail = i32::try_from(stranger).unwrap_or(i32::MAX);
                Err(HomingFailure { code: FaultCode::HomeSwitchWrong, axis: index, detail })
            }
            None => Ok(false),
        }
    }

    fn begin_next(&mut self, axes: &[Axis]) -> bool {
        let next = (0..axes.len()).find(|&index| self.left.contains(index));
        if let Some(index) = next {
            self.left.0 &= !(1 << index);
            self.present = Some((index, Homing::start()));
        }
        if next.is_none() && self.watch > 0 {
            self.watch -= 1;
            return false;
        }
        next.is_none()
    }

    /// An axis other than `present` whose switch has closed while `present` moved.
    fn stranger(&mut self, present: usize, io: &impl RigIo) -> Option<usize> {
        let mut stranger = None;
        for (index, contact) in self.contacts.iter_mut().enumerate() {
            let was_open = contact.is_closed() == Some(false);
            contact.read(io.home_switch(index), Counts(0));
            if was_open && contact.is_closed() == Some(true) && index != present {
                stranger = stranger.or(Some(index));
            }
        }
        stranger
    }
}
