//! Both boards in lockstep: the same bytes, the same faults of the same mechanics, at the same instants.

use std::collections::VecDeque;

use vergence_control::TICK_US;
use vergence_plant::{NativeBoard, Plant};
use vergence_protocol::management::RebootTo;
use vergence_protocol::{Microseconds, PoseReport, ResetCause};

use super::side::Side;
use crate::chip_board::ChipBoard;
use crate::simulation::Board as _;

/// Time steps of the mechanics: those of the chip's bench while something moves.
const STEP_US: u64 = 20;
/// Duration of a byte of ten bits at 921 600 baud, in nanoseconds.
const BYTE_NS: u64 = 10_851;
/// Time from the last byte of a frame to the node on the chip: the line must be silent for one byte, then a task runs.
const HANDLING_US: u64 = 50;
/// The part of a tick in which frames end, in microseconds after its start: both boards take them in the same tick.
pub const ARRIVALS_US: [u64; 2] = [150, 650];
/// Longest time from a reset to the first tick: boot loader and signature check take some 0.13 s, and a swap of two images 5.5 s
/// (docs/firmware.md).
const LONGEST_START_US: u64 = 15_000_000;
/// Time in which loads come to rest, in microseconds.
const SWINGING_US: u64 = 200_000;
/// Ticks that are kept of the native board: more than the boards may be apart.
const KEPT: usize = 128;

/// The native board just after a tick.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// What it would report; `at` is the tick.
    pub pose: PoseReport,
    /// True positions of the loads, in micro-units.
    pub loads: Vec<f64>,
    /// Steps made by each motor.
    pub steps: Vec<i32>,
    /// Whether the drivers are on.
    pub drivers_on: bool,
}

/// The native board, and the firmware on the chip.
pub struct Pair {
    native: NativeBoard,
    chip: ChipBoard,
    /// What each of them said.
    pub sides: [Side; 2],
    /// Time of the chip since power-on, in microseconds; the time of the session.
    now_us: u64,
    /// When the clock of the native board was zero.
    start_us: u64,
    /// Frames on their way to the native board, and when they are there.
    on_the_wire: VecDeque<(u64, Vec<u8>)>,
    /// When the wire is free again.
    free_us: u64,
    /// The latest ticks of the native board, oldest first.
    pub ticks: VecDeque<Snapshot>,
}

impl Pair {
    /// Two boards with the same mechanics. Both have just got power.
    pub fn new(mut native: NativeBoard, mut chip: ChipBoard) -> Self {
        native.plant_mut().record_steps();
        chip.with_plant(&mut Plant::record_steps);
        Self {
            native,
            chip,
            sides: [Side::default(), Side::default()],
            now_us: 0,
            start_us: 0,
            on_the_wire: VecDeque::new(),
            free_us: 0,
            ticks: VecDeque::new(),
        }
    }

    /// The time of the session, in microseconds.
    pub fn now_us(&self) -> u64 {
        self.now_us
    }

    /// The clock of the native board at a time of the session, both in microseconds.
    pub fn native_clock(&self, at_us: u64) -> u64 {
        at_us.saturating_sub(self.start_us)
    }

    /// The native board, by whose state the session goes on.
    pub fn native(&self) -> &NativeBoard {
        &self.native
    }

    /// The mechanics: those of the native board, and those of the chip.
    pub fn plants(&self) -> [&Plant; 2] {
        [self.native.plant(), self.chip.plant()]
    }

    /// Why the chip works no more.
    pub fn halted(&self) -> Option<String> {
        self.chip.halted()
    }

    /// Does the same to both mechanics.
    pub fn with_plants(&mut self, act: impl Fn(&mut Plant)) {
        act(self.native.plant_mut());
        self.chip.with_plant(&mut |plant| act(plant));
    }

    /// Waits until the firmware on the chip has started, and starts the native board at its first tick. Returns false where
    /// it does not start.
    pub fn start(&mut self) -> bool {
        let give_up = self.now_us + LONGEST_START_US;
        let first_tick = loop {
            self.now_us += TICK_US;
            self.chip.advance(Microseconds(self.now_us));
            match self.chip.first_tick_us() {
                Some(tick) => break tick,
                None if self.now_us > give_up => return false,
                None => {}
            }
        };
        self.chip.advance(Microseconds(first_tick));
        (self.start_us, self.now_us) = (first_tick, first_tick);
        self.ticks.clear();
        self.run_native(first_tick);
        true
    }

    /// Presses the reset button of both boards and waits until they run again. Returns false where one does not.
    pub fn restart(&mut self, boot: u32) -> bool {
        self.chip.restart(boot, Microseconds(self.now_us));
        self.start_again(boot, ResetCause::Pin)
    }

    /// How often the chip was reset.
    pub fn resets(&self) -> u64 {
        self.chip.resets()
    }

    /// Restarts the native board beside a chip that has restarted by itself, and waits until both run. Returns false where
    /// the host has not asked the native board for it, or one does not run.
    pub fn follow_reboot(&mut self, boot: u32) -> bool {
        self.native.take_reboot() == Some(RebootTo::Application) && self.start_again(boot, ResetCause::Software)
    }

    fn start_again(&mut self, boot: u32, cause: ResetCause) -> bool {
        let reset_at = self.now_us;
        // Half a frame may have been on the wire.
        let _ = self.chip.transmit();
        self.on_the_wire.clear();
        self.sides.iter_mut().for_each(Side::forget);
        // What still swings comes to rest while the chip starts. The boot loader runs once.
        let plant = self.native.plant_mut();
        plant.restart_clock();
        for us in (0..SWINGING_US).step_by(STEP_US as usize) {
            plant.advance(Microseconds(us));
        }
        self.native.restart(cause, boot).is_ok() && self.start() && self.now_us > reset_at
    }

    /// Sends each board its frame, of the same length, so that it ends `phase_us` after the beginning of a tick, the first one
    /// in which it can end.
    pub fn send(&mut self, [native, chip]: [Vec<u8>; 2], phase_us: u64) {
        let takes = (chip.len() as u64 * BYTE_NS).div_ceil(1_000);
        let soonest = self.now_us.max(self.free_us) + takes;
        let ticks = self.native_clock(soonest).saturating_sub(phase_us).div_ceil(TICK_US);
        let end = self.start_us + ticks * TICK_US + phase_us;
        self.run_to(end - takes);
        self.chip.receive(&chip);
        self.free_us = end;
        self.on_the_wire.push_back((end + HANDLING_US, native));
    }

    /// Delays the next tick of both boards by `us` microseconds.
    pub fn delay_tick(&mut self, us: u64) {
        self.native.delay_tick(us);
        self.chip.delay_tick(us);
        self.catch_up();
    }

    /// Lets time pass for both.
    pub fn run_to(&mut self, time_us: u64) {
        if time_us > self.now_us {
            self.chip.advance(Microseconds(time_us));
            self.catch_up();
        }
    }

    /// Lets time pass until a tenth of a tick before the next one.
    pub fn turn(&mut self) {
        let ticks = (self.native_clock(self.now_us) + TICK_US / 10) / TICK_US + 1;
        self.run_to(self.start_us + ticks * TICK_US - TICK_US / 10);
    }

    /// Brings the native board to the time of the chip, and takes what both have said.
    fn catch_up(&mut self) {
        let now_us = self.chip.now_us();
        self.run_native(now_us);
        self.now_us = now_us;
        let said = [self.native.transmit(), self.chip.transmit()];
        for (side, said) in self.sides.iter_mut().zip(said) {
            side.hear(now_us, &said);
        }
        let start_ns = self.start_us * 1_000;
        let axes = self.native.plant().loads().len();
        for axis in 0..axes {
            let made = self.native.plant_mut().axis_mut(axis).map(|axis| axis.take_steps()).unwrap_or_default();
            self.sides[0].steps[axis].extend(made.iter().map(|step| (step.at_ns + start_ns, step.forward)));
            let mut made = Vec::new();
            self.chip.with_plant(&mut |plant| {
                made = plant.axis_mut(axis).map(|axis| axis.take_steps()).unwrap_or_default();
            });
            self.sides[1].steps[axis].extend(made.iter().map(|step| (step.at_ns, step.forward)));
        }
    }

    fn run_native(&mut self, to_us: u64) {
        loop {
            let clock = self.native.now().0;
            let grid = self.start_us + (clock / STEP_US + 1) * STEP_US;
            let arrival = self.on_the_wire.front().map_or(u64::MAX, |(at, _)| *at);
            let next = grid.min(arrival).min(to_us).max(self.start_us + clock);
            self.native.advance(Microseconds(next - self.start_us));
            if self.native.now().0.is_multiple_of(TICK_US) {
                self.remember();
            }
            if let Some((_, frame)) = self.on_the_wire.pop_front_if(|(at, _)| *at <= next) {
                self.native.receive(&frame);
            } else if next >= to_us {
                return;
            }
        }
    }

    /// Keeps the state after a tick.
    fn remember(&mut self) {
        use vergence_control::RigIo;
        let (pose, plant) = (self.native.pose(), self.native.plant());
        if self.ticks.back().is_some_and(|last| last.pose.at == pose.at) {
            return;
        }
        let loads = plant.loads();
        let steps = (0..loads.len()).map(|axis| plant.steps(axis)).collect();
        self.ticks.push_back(Snapshot { pose, loads, steps, drivers_on: plant.drivers_on() });
        if self.ticks.len() > KEPT {
            self.ticks.pop_front();
        }
    }
}
