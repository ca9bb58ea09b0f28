//! The seam between the controller and a board.

use vergence_protocol::Microseconds;

/// What the controller needs of a board. A real board, the native simulation and tests implement it.
///
/// Raw steps and raw counts start at any value at power-on and never jump; the controller keeps its own zero.
pub trait RigIo {
    /// Switches the motor drivers of all axes.
    fn set_drivers(&mut self, on: bool);
    /// Makes steps on `axis`, evenly, so that the raw step count is `steps` at `by`.
    fn step_to(&mut self, axis: usize, steps: i32, by: Microseconds);
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
}
