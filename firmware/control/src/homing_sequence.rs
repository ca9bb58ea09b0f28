//! Homing of several axes, one after the other, so that a switch wired to the wrong axis is noticed.

use vergence_protocol::{AxisList, AxisMask, Counts, FaultCode};

use crate::axis::Axis;
use crate::contact::Contact;
use crate::follow::Lost;
use crate::homing::{Homing, Progress};
use crate::io::RigIo;
use crate::stall_homing::StallHoming;

/// Ticks in which axes with an absolute encoder are watched instead of homed: long enough for hosts to hear of it.
const WATCH_TICKS: u8 = 50;

/// The axes still to be homed, and the state of the present one.
#[derive(Clone, Debug, Default)]
pub struct HomingSequence {
    left: AxisMask,
    present: Option<(usize, Way)>,
    /// Ticks left of [`WATCH_TICKS`].
    watch: u8,
    /// The home switches of all axes.
    contacts: AxisList<Contact>,
}

/// How an axis finds its end.
#[derive(Clone, Copy, Debug)]
enum Way {
    Switch(Homing),
    Stall(StallHoming),
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
        let Some((index, way)) = &mut self.present else { return Ok(self.begin_next(axes)) };
        let index = *index;
        let Some(axis) = axes.get_mut(index) else { return Ok(true) };
        let progress = match way {
            Way::Switch(homing) => homing.poll(axis, io),
            Way::Stall(homing) => homing.poll(axis, io),
        };
        match progress {
            Progress::Running => {}
            Progress::Done => self.present = None,
            Progress::Failed { code, detail } => return Err(HomingFailure { code, axis: index, detail }),
        }
        match self.stranger(index, axes, io) {
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
            let by_stall = axes.get(index).is_some_and(|axis| axis.settings.switches.stall_guard());
            let way = if by_stall { Way::Stall(StallHoming::start()) } else { Way::Switch(Homing::start()) };
            self.present = Some((index, way));
        }
        if next.is_none() && self.watch > 0 {
            self.watch -= 1;
            return false;
        }
        next.is_none()
    }

    /// Takes a disagreement of encoder and command of an axis; returns whether homing expects it.
    pub fn takes(&mut self, axis: usize, lost: &Lost) -> bool {
        match &mut self.present {
            Some((present, Way::Stall(homing))) if *present == axis => homing.takes(lost),
            _ => false,
        }
    }

    /// An axis other than `present` whose switch has closed while `present` moved.
    fn stranger(&mut self, present: usize, axes: &[Axis], io: &impl RigIo) -> Option<usize> {
        let mut stranger = None;
        let switches = self.contacts.iter_mut().zip(axes).enumerate();
        for (index, (contact, axis)) in switches.filter(|(_, (_, axis))| !axis.settings.switches.stall_guard()) {
            let was_open = contact.is_closed() == Some(false);
            contact.read(axis.home_switch(io), Counts(0));
            if was_open && contact.is_closed() == Some(true) && index != present {
                stranger = stranger.or(Some(index));
            }
        }
        stranger
    }
}
