//! The seam between the controller and a board.

use heapless::Vec;
use vergence_protocol::{AxisList, Microseconds};

/// The most steps of one axis in one tick: 100 kHz and some slack.
pub const MAX_STEPS_PER_TICK: usize = 104;

/// The steps of one axis in one tick.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StepSchedule {
    /// When the tick begins: one tick ahead at most, so that a board has its steps before they are due.
    pub start: Microseconds,
    /// Whether the raw step count rises.
    pub forward: bool,
    /// When each step is due: nanoseconds after `start`, rising, less than one tick.
    pub at_ns: Vec<u32, MAX_STEPS_PER_TICK>,
}

/// A pulse of the camera trigger.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TriggerEdge {
    /// When the pulse began.
    pub at: Microseconds,
    /// Every raw encoder count at that instant.
    pub counts: AxisList<i32>,
}

/// What the controller needs of a board. A real board, the native simulation and tests implement it.
///
/// Raw steps and raw counts start at any value at power-on and never jump; the controller keeps its own zero.
pub trait RigIo {
    /// Switches the motor drivers of all axes. Steps not made yet are forgotten, whether on or off.
    fn set_drivers(&mut self, on: bool);
    /// Makes steps on `axis` at their instants, after those ordered before.
    fn schedule_steps(&mut self, axis: usize, steps: &StepSchedule);
    /// The raw step count reached so far.
    fn steps(&self, axis: usize) -> i32;
    /// The raw encoder count.
    fn encoder(&self, axis: usize) -> i32;
    /// Whether the home switch is closed.
    fn home_switch(&self, axis: usize) -> bool;
    /// Whether a hard limit switch is closed.
    fn hard_limit(&self, axis: usize) -> bool;
    /// Whether the emergency stop is pressed. Hardware has already cut the drivers; software only observes.
    fn emergency_stop(&self) -> bool;
    /// Fires the cameras once at `at`, at once where that has passed. A board without trigger does nothing.
    fn fire_trigger(&mut self, at: Microseconds) {
        let _ = at;
    }
    /// The oldest trigger pulse not yet taken, its encoders latched at the edge.
    fn take_trigger_edge(&mut self) -> Option<TriggerEdge> {
        None
    }
}
