//! The TMC2209 drivers of all axes on their serial line.

use vergence_protocol::Microseconds;

use crate::tmc2209::{DriverReply, Tmc2209, Turning};

/// A driver, and the microsteps that the scale of its motor counts.
#[derive(Clone, Debug)]
struct Driver {
    chip: Tmc2209,
    microsteps: u32,
}

/// The drivers of all axes, each with the number of its axis as address. An axis without one has a plain driver.
#[derive(Clone, Debug, Default)]
pub struct Drivers {
    of_axes: Vec<Option<Driver>>,
}

impl Drivers {
    /// Gives an axis a TMC2209 that has just got its supply. The scale of its motor counts `microsteps` of a full step.
    pub fn attach(&mut self, axis: u8, microsteps: u32) {
        let index = usize::from(axis);
        if self.of_axes.len() <= index {
            self.of_axes.resize(index + 1, None);
        }
        self.of_axes[index] = Some(Driver { chip: Tmc2209::new(axis), microsteps });
    }

    /// The driver of an axis; `None` for a plain one.
    #[must_use]
    pub fn chip(&self, axis: usize) -> Option<&Tmc2209> {
        self.of_axes.get(axis)?.as_ref().map(|driver| &driver.chip)
    }

    /// The driver of an axis, to change it; `None` for a plain one.
    pub fn chip_mut(&mut self, axis: usize) -> Option<&mut Tmc2209> {
        self.of_axes.get_mut(axis)?.as_mut().map(|driver| &mut driver.chip)
    }

    fn chips(&mut self) -> impl Iterator<Item = &mut Tmc2209> {
        self.of_axes.iter_mut().flatten().map(|driver| &mut driver.chip)
    }

    /// Switches the motor supply of all drivers.
    pub fn supply(&mut self, on: bool) {
        self.chips().for_each(|chip| chip.supply(on));
    }

    /// Switches the outputs of all drivers.
    pub fn enable(&mut self, on: bool) {
        self.chips().for_each(|chip| chip.enable(on));
    }

    /// Lets time pass for the driver of an axis, whose motor did this meanwhile.
    pub fn advance(&mut self, axis: usize, now: Microseconds, motor: Turning) {
        if let Some(chip) = self.chip_mut(axis) {
            chip.advance(now, motor);
        }
    }

    /// Way of a step pulse of an axis, in steps of its motor's scale.
    #[must_use]
    pub fn step_size(&self, axis: usize) -> f64 {
        match self.of_axes.get(axis) {
            Some(Some(Driver { chip, microsteps })) if chip.drives() => {
                f64::from(*microsteps) / f64::from(chip.microsteps())
            }
            Some(Some(_)) => 0.0,
            _ => 1.0,
        }
    }

    /// A whole datagram from the board; the line rested before it.
    pub fn hear(&mut self, datagram: &[u8]) -> Option<DriverReply> {
        let mut bytes = datagram.iter().enumerate();
        bytes.find_map(|(index, &byte)| self.hear_byte(byte, index == 0))
    }

    /// A byte from the board; `begins` says that the line rested before it.
    pub fn hear_byte(&mut self, byte: u8, begins: bool) -> Option<DriverReply> {
        // Every driver hears every byte; at most one has the address.
        self.chips().fold(None, |reply, chip| reply.or(chip.hear(byte, begins)))
    }
}
