//! The interface between the controller and a board's inputs and outputs.

use heapless::Vec;
use vergence_protocol::{AxisList, DriverState, EncoderState, Microseconds};

use crate::driver::DriverSettings;
use crate::encoder::EncoderKind;
use crate::joints::BusSettings;

/// Largest number of steps of one axis in one tick: 100 at 100 kHz, and some slack.
pub const MAX_STEPS_PER_TICK: usize = 104;

/// The steps of one axis in one tick.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StepSchedule {
    /// Start of the tick: at most one tick ahead, so that the board has the steps before they are due.
    pub start: Microseconds,
    /// Whether the raw step count rises.
    pub forward: bool,
    /// Time of each step in nanoseconds after `start`: rising, less than one tick.
    pub at_ns: Vec<u32, MAX_STEPS_PER_TICK>,
}

/// A rising edge of the camera trigger.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TriggerEdge {
    /// Time of the edge.
    pub at: Microseconds,
    /// Raw encoder count of each axis at the edge.
    pub counts: AxisList<i32>,
}

/// An edge of an encoder's index line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IndexEdge {
    /// Raw encoder count at the edge.
    pub count: i32,
    /// Whether the line rises.
    pub rises: bool,
}

/// The first rise and the first fall of an index line in a tick, in their order.
pub type IndexEdges = Vec<IndexEdge, 2>;

/// Inputs and outputs of a board. The real board, the native simulation and tests implement it.
///
/// Raw steps and raw counts have any value at power-on and never jump; the controller keeps its own zero.
pub trait RigIo {
    /// Switches the motor drivers of all axes on or off. Steps not made yet are dropped in both cases.
    fn set_drivers(&mut self, on: bool);
    /// Asks the drivers of all axes for their holding current (true) or for the full one. A board whose drivers cannot
    /// reduce their current does nothing.
    fn set_holding(&mut self, holding: bool) {
        let _ = holding;
    }
    /// Orders steps of `axis` at their times, after those ordered before.
    fn schedule_steps(&mut self, axis: usize, steps: &StepSchedule);
    /// Sets where the joint of `axis` shall be, in raw counts of its encoder. Its servo goes there and holds it while the drivers
    /// are on. A board without such a joint does nothing.
    fn set_goal(&mut self, axis: usize, counts: i32) {
        let _ = (axis, counts);
    }
    /// The raw count of steps made so far.
    fn steps(&self, axis: usize) -> i32;
    /// The raw encoder count.
    fn encoder(&self, axis: usize) -> i32;
    /// Names the highest rate at which the encoder of `axis` will count, in counts a second, so that a board can ignore shorter
    /// pulses of its lines. A board without a filter does nothing.
    fn expect_counts(&mut self, axis: usize, per_second: u32) {
        let _ = (axis, per_second);
    }
    /// Names the kind of encoder of `axis`, which [`Self::encoder`] reads from now on. A board without such encoders does
    /// nothing.
    fn use_encoder(&mut self, axis: usize, kind: EncoderKind) {
        let _ = (axis, kind);
    }
    /// What an absolute encoder says of itself; of another one nothing.
    fn encoder_state(&self, axis: usize) -> EncoderState {
        let _ = axis;
        EncoderState::Plain
    }
    /// Takes the edges of the index line since the last call, in their order: the first rise and the first fall. A board without
    /// index lines has none.
    fn take_index(&mut self, axis: usize) -> IndexEdges {
        let _ = axis;
        IndexEdges::new()
    }
    /// When the encoders were read that [`Self::encoder`] gives in the tick of `now`. A board that reads them at another
    /// instant than that at which the tick was due says so: at 80 mm/s a pose is off by 80 nm for each microsecond.
    fn encoders_read_at(&self, now: Microseconds) -> Microseconds {
        now
    }
    /// Whether the line of the home switch is low: a switch to ground is closed, or a driver on that line reports no stall.
    fn home_switch(&self, axis: usize) -> bool;
    /// Whether the line of the hard limit is high: a switch to ground is open, or its wire is broken.
    fn hard_limit(&self, axis: usize) -> bool;
    /// Whether the emergency stop is pressed, or its wire is broken. Hardware has already cut the drivers; the controller
    /// only observes.
    fn emergency_stop(&self) -> bool;
    /// Sets the motor drivers of all axes that have a serial line, from now on; until that is done [`Self::driver`] does not
    /// call them usable. A board without such a line does nothing.
    fn configure_drivers(&mut self, drivers: &AxisList<DriverSettings>) {
        let _ = drivers;
    }
    /// Sets the bus of the joints up, of which each is an axis, from now on; `None` for a machine without joints. A board without
    /// such a bus does nothing.
    fn configure_joints(&mut self, bus: Option<&BusSettings>) {
        let _ = bus;
    }
    /// State of the motor driver of an axis.
    fn driver(&self, axis: usize) -> DriverState {
        let _ = axis;
        DriverState::Plain
    }
    /// Fires the cameras once at the time `at`, or at once if that has passed. A board without trigger does nothing.
    fn fire_trigger(&mut self, at: Microseconds) {
        let _ = at;
    }
    /// Takes the oldest trigger edge, with the encoders latched at the edge.
    fn take_trigger_edge(&mut self) -> Option<TriggerEdge> {
        None
    }
}
