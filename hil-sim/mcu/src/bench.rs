//! The mechanics of the rig on the pins of the chip: step pulses move motors edge by edge; encoders and switches drive
//! their lines.

mod nucleo_g474;

use vergence_control::{RigIo, StepSchedule};
use vergence_plant::{DriverReply, Plant};
use vergence_protocol::Microseconds;

use crate::encoder_lines::{Lines, Selection, phases};
use crate::pin::{Drive, Pin};
use crate::serial_device::SerialDevice;
use crate::spi::SpiFrame;
use crate::time::Picoseconds;
use crate::uart::{Frame, LineFault, SentByte};
use crate::unit::{SpiId, UartId};
use crate::world::{Instant, PinEdge, Terminals, World};

/// A switch to ground with a pull-up on the line.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SwitchWiring {
    /// The line of the switch.
    pub pin: Pin,
    /// Whether the contact is normally closed (line low): a broken wire then reads as operated.
    pub normally_closed: bool,
}

impl SwitchWiring {
    fn drive(&self, operated: bool) -> Drive {
        if operated == self.normally_closed { Drive::High } else { Drive::Low }
    }
}

/// The pins of one axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AxisWiring {
    /// Step output of the chip: a step at each rising edge.
    pub step: Pin,
    /// Direction output of the chip; high: the raw step count rises.
    pub direction: Pin,
    /// The encoder's lines A and B; A leads while the count rises.
    pub encoder: [Pin; 2],
    /// Home switch, operated at home.
    pub home: SwitchWiring,
    /// Hard limit, operated beyond the range.
    pub hard_limit: SwitchWiring,
    /// The encoder's index line, where it is wired.
    pub index: Option<Pin>,
    /// Low selects the absolute encoder, where it is wired.
    pub select: Option<Pin>,
}

/// The pins of the whole bench.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BenchWiring {
    /// The axes, in the plant's order.
    pub axes: Vec<AxisWiring>,
    /// High switches the drivers off; the drivers' pull-up keeps it high while the chip does not drive it.
    pub drivers_off: Pin,
    /// High asks the drivers for their holding current.
    pub holding: Pin,
    /// Emergency stop, operated while pressed; it also cuts the drivers by itself.
    pub emergency_stop: SwitchWiring,
    /// Camera trigger: a rising edge fires the cameras.
    pub camera_trigger: Pin,
    /// Port of the one wire to TMC2209 drivers.
    pub driver_line: UartId,
    /// Port of a robot's servos.
    pub servo_bus: UartId,
    /// Bus of the absolute encoders.
    pub encoder_bus: SpiId,
}

impl BenchWiring {
    /// Every pin under the name of its signal, for a trace.
    #[must_use]
    pub fn signals(&self) -> Vec<(Pin, String)> {
        let mut signals = vec![
            (self.drivers_off, "drivers_off".to_owned()),
            (self.holding, "holding".to_owned()),
            (self.emergency_stop.pin, "emergency_stop".to_owned()),
            (self.camera_trigger, "camera_trigger".to_owned()),
        ];
        for (index, axis) in self.axes.iter().enumerate() {
            let [a, b] = axis.encoder;
            let names = ["step", "direction", "encoder_a", "encoder_b", "home", "hard_limit"];
            let pins = [axis.step, axis.direction, a, b, axis.home.pin, axis.hard_limit.pin];
            signals.extend(pins.into_iter().zip(names.map(|name| format!("{name}_{index}"))));
            let others = [(axis.index, "encoder_index"), (axis.select, "encoder_select")];
            signals.extend(others.into_iter().filter_map(|(pin, name)| Some((pin?, format!("{name}_{index}")))));
        }
        signals
    }
}

/// Time steps of the mechanics while something moves, and at rest.
const MOVING_STEP: Microseconds = Microseconds(20);
const RESTING_STEP: Microseconds = Microseconds(1_000);
/// Time after the last step pulse in which the load may still creep.
const SETTLING: Microseconds = Microseconds(100_000);
/// The state of one axis on its wires.
#[derive(Clone, Copy, Debug, Default)]
struct AxisState {
    forward: bool,
    lines: Lines,
    home: Option<bool>,
    hard_limit: Option<bool>,
    index: Option<bool>,
    selection: Selection,
}

/// A rising edge of the camera trigger's pin, and what the encoders' lines showed then.
#[derive(Clone, Debug, PartialEq)]
pub struct Fired {
    /// The instant of the edge.
    pub at: Instant,
    /// The count that the lines of each encoder show.
    pub counts: Vec<i32>,
}

/// The mechanics, wired to the chip.
#[derive(Clone, Debug)]
pub struct Bench {
    wiring: BenchWiring,
    plant: Plant,
    axes: Vec<AxisState>,
    emergency_stop: Option<bool>,
    next_step: Picoseconds,
    moving_until: Microseconds,
    pulses: Vec<u64>,
    fired: Option<Fired>,
    /// End of the last byte from the chip to the drivers, and what a driver will answer when, at which speed.
    spoken_at: Picoseconds,
    reply: Option<(Picoseconds, u32, DriverReply)>,
}

impl Bench {
    /// Mechanics at rest with their drivers off.
    #[must_use]
    pub fn new(wiring: BenchWiring, plant: Plant) -> Self {
        let axes: Vec<_> = (0..wiring.axes.len())
            .map(|axis| {
                let count = plant.encoder(axis);
                let lines = Lines::at(count);
                AxisState { lines, ..AxisState::default() }
            })
            .collect();
        let pulses = vec![0; axes.len()];
        Self {
            wiring,
            plant,
            axes,
            emergency_stop: None,
            next_step: Picoseconds(0),
            moving_until: Microseconds(0),
            pulses,
            fired: None,
            spoken_at: Picoseconds(0),
            reply: None,
        }
    }

    /// The simulated mechanics, which know the true positions.
    #[must_use]
    pub fn plant(&self) -> &Plant {
        &self.plant
    }

    /// The mechanics, to change them; their lines follow at once.
    pub fn plant_mut(&mut self) -> &mut Plant {
        self.next_step = Picoseconds(0);
        &mut self.plant
    }

    /// Step pulses that each axis has received.
    #[must_use]
    pub fn pulses(&self) -> &[u64] {
        &self.pulses
    }

    /// The count that the lines of each encoder show: what a counter without error has counted.
    #[must_use]
    pub fn counts_on_lines(&self) -> Vec<i32> {
        self.axes.iter().map(|axis| axis.lines.shown).collect()
    }

    /// The latest rising edge of the camera trigger.
    #[must_use]
    pub fn fired(&self) -> Option<&Fired> {
        self.fired.as_ref()
    }

    fn advance_plant(&mut self, now: Microseconds, terminals: &mut Terminals) {
        self.plant.advance(now);
        let moves = now.0 < self.moving_until.0;
        let step = if moves { MOVING_STEP } else { RESTING_STEP };
        let begin = Picoseconds::microseconds(now.0);
        self.next_step = begin + Picoseconds::microseconds(step.0);
        for (axis, (state, wiring)) in self.axes.iter_mut().zip(&self.wiring.axes).enumerate() {
            state.lines.aim(self.plant.encoder(axis), begin, Picoseconds::microseconds(MOVING_STEP.0));
            let home = self.plant.home_switch(axis);
            if state.home.replace(home) != Some(home) {
                terminals.drive(wiring.home.pin, wiring.home.drive(home));
            }
            let limit = self.plant.hard_limit(axis);
            if state.hard_limit.replace(limit) != Some(limit) {
                terminals.drive(wiring.hard_limit.pin, wiring.hard_limit.drive(limit));
            }
        }
        (0..self.wiring.axes.len()).for_each(|axis| self.show_index(axis, terminals));
        let pressed = self.plant.emergency_stop();
        match self.emergency_stop.replace(pressed) {
            None => self.connect(terminals),
            Some(before) if before == pressed => return,
            Some(_) => {}
        }
        let wiring = self.wiring.emergency_stop;
        terminals.drive(wiring.pin, wiring.drive(pressed));
    }

    /// Drives the lines at the start: encoders at rest show their level.
    fn connect(&mut self, terminals: &mut Terminals) {
        terminals.drive(self.wiring.drivers_off, Drive::High);
        for (state, wiring) in self.axes.iter().zip(&self.wiring.axes) {
            let [a, b] = phases(state.lines.shown);
            terminals.drive(wiring.encoder[0], Drive::level(a));
            terminals.drive(wiring.encoder[1], Drive::level(b));
        }
    }

    /// Sets the index line of an axis to its level at the count that the encoder's lines show.
    fn show_index(&mut self, axis: usize, terminals: &mut Terminals) {
        let (Some(state), Some(wiring)) = (self.axes.get_mut(axis), self.wiring.axes.get(axis)) else { return };
        let level = self.plant.index_line(axis, state.lines.shown);
        if let (Some(pin), Some(high)) = (wiring.index, level)
            && state.index.replace(high) != Some(high)
        {
            terminals.drive(pin, Drive::level(high));
        }
    }

    fn step(&mut self, axis: usize, at: Instant) {
        if let Some(pulses) = self.pulses.get_mut(axis) {
            *pulses += 1;
        }
        let forward = self.axes.get(axis).is_some_and(|state| state.forward);
        let now = microseconds(at);
        let past_ns = at.time.0 / 1_000 - now.0 * 1_000;
        let at_ns = [past_ns as u32].into_iter().collect();
        self.plant.schedule_steps(axis, &StepSchedule { start: now, forward, at_ns });
        self.wake(now);
    }

    /// Switches to short time steps, because something begins to move.
    fn wake(&mut self, now: Microseconds) {
        self.moving_until = Microseconds(now.0 + SETTLING.0);
        self.next_step = self.next_step.min(Picoseconds::microseconds(now.0 + MOVING_STEP.0));
    }
}

impl World for Bench {
    fn watched(&self) -> Vec<Pin> {
        let axes =
            self.wiring.axes.iter().flat_map(|axis| [Some(axis.step), Some(axis.direction), axis.select]).flatten();
        axes.chain([self.wiring.drivers_off, self.wiring.holding, self.wiring.camera_trigger]).collect()
    }

    fn next_event(&self) -> Picoseconds {
        let replies = self.reply.map_or(Picoseconds::NEVER, |(at, ..)| at);
        let servos = SerialDevice::next_event(self.plant.joints().servos());
        let others = self.next_step.min(replies).min(servos);
        self.axes.iter().filter_map(|axis| axis.lines.next).fold(others, Picoseconds::min)
    }

    fn act(&mut self, now: Instant, terminals: &mut Terminals) {
        for axis in 0..self.wiring.axes.len() {
            while let Some((line, high)) = self.axes[axis].lines.edge(now.time) {
                terminals.drive(self.wiring.axes[axis].encoder[line], Drive::level(high));
                self.show_index(axis, terminals);
            }
        }
        if let Some((_, baud, reply)) = self.reply.take_if(|(at, ..)| *at <= now.time) {
            for byte in reply.bytes {
                terminals.send(self.wiring.driver_line, Frame { byte, baud, fault: LineFault::None });
            }
        }
        if SerialDevice::next_event(self.plant.joints().servos()) <= now.time {
            for frame in SerialDevice::speak(self.plant.joints_mut().servos_mut(), now.time) {
                terminals.send(self.wiring.servo_bus, frame);
            }
        }
        if self.next_step <= now.time {
            self.advance_plant(microseconds(now), terminals);
        }
    }

    fn frame_exchanged(&mut self, port: SpiId, frame: SpiFrame) -> Option<u16> {
        let axis = self.axes.iter().position(|state| state.selection.is_selected())?;
        if port != self.wiring.encoder_bus || !self.axes[axis].selection.understands(&frame) {
            return None;
        }
        self.plant.advance(Microseconds(frame.to.0 / 1_000_000));
        self.plant.axis_mut(axis)?.magnet_frame(frame.word)
    }

    fn byte_sent(&mut self, port: UartId, sent: SentByte, _terminals: &mut Terminals) {
        if port == self.wiring.servo_bus {
            SerialDevice::receive(self.plant.joints_mut().servos_mut(), sent);
        }
        if port != self.wiring.driver_line {
            return;
        }
        // A datagram begins after twelve bits of rest (section 4.1.1 of the TMC2209's datasheet); a byte takes ten.
        let bit = Picoseconds(1_000_000_000_000 / u64::from(sent.baud.max(1)));
        let begins = sent.at.0 > self.spoken_at.0 + 22 * bit.0;
        self.spoken_at = sent.at;
        if let Some(reply) = self.plant.drivers_mut().hear_byte(sent.byte, begins) {
            let at = Picoseconds(sent.at.0 + u64::from(reply.after_bits) * bit.0);
            self.reply = Some((at, sent.baud, reply));
        }
    }

    fn pin_changed(&mut self, edge: PinEdge, _terminals: &mut Terminals) {
        let now = microseconds(edge.at);
        if edge.pin == self.wiring.drivers_off {
            self.plant.advance(now);
            self.plant.set_drivers(!edge.high);
            self.wake(now);
        }
        if edge.pin == self.wiring.holding {
            self.plant.set_holding(edge.high);
        }
        if edge.pin == self.wiring.camera_trigger && edge.high {
            self.plant.fire_trigger(now);
            self.plant.advance(now);
            // The chip latches its own counters.
            while self.plant.take_trigger_edge().is_some() {}
            self.fired = Some(Fired { at: edge.at, counts: self.counts_on_lines() });
        }
        for axis in 0..self.wiring.axes.len() {
            let wiring = self.wiring.axes[axis];
            if edge.pin == wiring.direction {
                self.axes[axis].forward = edge.high;
            } else if wiring.select == Some(edge.pin) {
                self.axes[axis].selection.select(edge);
            } else if edge.pin == wiring.step && edge.high {
                self.step(axis, edge.at);
            }
        }
    }
}

fn microseconds(at: Instant) -> Microseconds {
    Microseconds(at.time.0 / 1_000_000)
}
