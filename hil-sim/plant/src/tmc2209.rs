//! A simulated TMC2209 stepper driver: serial line, registers, outputs, and its failures (datasheet rev. 1.09).
//!
//! Written from the datasheet and apart from the controller's own code for the line, so that the two check each other.

use vergence_protocol::Microseconds;

use crate::stall_guard::StallGuard;
pub use crate::stall_guard::Turning;

/// Bytes of a reply, and the time that the line rests before it, in bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriverReply {
    /// The reply.
    pub bytes: [u8; 8],
    /// Time from the end of the request, in bits (section 4.1.2).
    pub after_bits: u32,
}

/// Failures of the driver and its line.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DriverFaults {
    /// Whether the serial wire is broken.
    pub is_mute: bool,
    /// Number of replies still to come with a wrong bit.
    pub garbled_replies: u32,
    /// Number of writes still to come that arrive with a wrong bit.
    pub garbled_writes: u32,
    /// Whether an output is shorted to ground.
    pub is_shorted: bool,
}

const GCONF: usize = 0x00;
const GSTAT: usize = 0x01;
const IFCNT: usize = 0x02;
const NODECONF: usize = 0x03;
const IOIN: usize = 0x06;
const IHOLD_IRUN: usize = 0x10;
const TPOWERDOWN: usize = 0x11;
const TSTEP: usize = 0x12;
const TPWMTHRS: usize = 0x13;
const TCOOLTHRS: usize = 0x14;
const SGTHRS: usize = 0x40;
const SG_RESULT: usize = 0x41;
const CHOPCONF: usize = 0x6C;
const DRV_STATUS: usize = 0x6F;
const PWMCONF: usize = 0x70;

/// Registers that can be read (section 5): others read as zero.
const READABLE: [usize; 9] = [GCONF, GSTAT, IFCNT, IOIN, TSTEP, SG_RESULT, CHOPCONF, DRV_STATUS, PWMCONF];
/// Registers that can be written: a write to another counts, and changes nothing.
const WRITABLE: [usize; 9] = [GCONF, NODECONF, IHOLD_IRUN, TPOWERDOWN, TPWMTHRS, TCOOLTHRS, SGTHRS, CHOPCONF, PWMCONF];

/// Temperatures at which the driver warns and switches off, in degrees Celsius (section 5.5.3, OTTRIM 00).
const WARNS_AT: f64 = 120.0;
const SWITCHES_OFF_AT: f64 = 143.0;
/// Bits of DRV_STATUS.
const OTPW: u32 = 1;
const OT: u32 = 1 << 1;
const S2GA: u32 = 1 << 2;
const STST: u32 = 1 << 31;
/// Clock cycles of the unit of TPOWERDOWN in microseconds: 2^18 at 12 MHz.
const POWER_DOWN_US: u64 = 21_845;
/// Time without a step after which the motor counts as standing, in microseconds: 2^20 clocks (section 5.5.3).
const STANDSTILL_US: u64 = 87_381;

/// A TMC2209 with its motor supply on.
#[derive(Clone, Debug)]
pub struct Tmc2209 {
    /// Its serial address, set by MS1 and MS2.
    address: u8,
    registers: [u32; 128],
    received: Vec<u8>,
    /// Whether the motor supply is on.
    is_supplied: bool,
    /// Whether ENN is low.
    is_enabled: bool,
    celsius: f64,
    is_overheated: bool,
    is_shut_down: bool,
    faults: DriverFaults,
    now: Microseconds,
    stepped_at: Microseconds,
    stall_guard: StallGuard,
}

impl Tmc2209 {
    /// A driver with this serial address, after power-on.
    #[must_use]
    pub fn new(address: u8) -> Self {
        let mut driver = Self {
            address,
            registers: [0; 128],
            received: Vec::new(),
            is_supplied: true,
            is_enabled: false,
            celsius: 40.0,
            is_overheated: false,
            is_shut_down: false,
            faults: DriverFaults::default(),
            now: Microseconds(0),
            stepped_at: Microseconds(0),
            stall_guard: StallGuard::default(),
        };
        driver.reset();
        driver
    }

    /// Sets all registers as after power-on (section 5).
    fn reset(&mut self) {
        self.registers = [0; 128];
        self.registers[GCONF] = 0x101;
        self.registers[GSTAT] = 1;
        self.registers[CHOPCONF] = 0x1000_0053;
        self.registers[PWMCONF] = 0xC10D_0024;
        self.registers[IHOLD_IRUN] = 1 << 16 | 31 << 8 | 16;
        self.registers[TPOWERDOWN] = 20;
        self.received.clear();
    }

    /// Switches the motor supply, by which the chip's own supply lives, off or on; without it the driver forgets
    /// everything.
    pub fn supply(&mut self, on: bool) {
        if on && !self.is_supplied {
            self.reset();
        }
        self.is_supplied = on;
        self.look();
    }

    /// Switches the outputs by ENN.
    pub fn enable(&mut self, on: bool) {
        self.is_enabled = on;
        self.look();
    }

    /// Sets the temperature of the chip in degrees Celsius.
    pub fn heat(&mut self, celsius: f64) {
        self.celsius = celsius;
        self.look();
    }

    /// Sets what fails from now on.
    pub fn fail(&mut self, faults: DriverFaults) {
        self.faults = faults;
        self.look();
    }

    /// Flips a bit of the microsteps' register, as a spark may do.
    pub fn flip_microsteps(&mut self) {
        self.registers[CHOPCONF] ^= 1 << 24;
    }

    /// Notes that time has passed, and what the motor did meanwhile.
    pub fn advance(&mut self, now: Microseconds, motor: Turning) {
        self.now = now;
        if motor.steps > 0 {
            self.stepped_at = now;
        }
        let microsteps = self.microsteps();
        self.stall_guard.advance(now, motor, microsteps);
        (self.registers[TSTEP], self.registers[SG_RESULT]) = (self.stall_guard.tstep(), self.stall_guard.result());
    }

    /// Whether the output DIAG is high: a driver error, or a stall. The driver reports stalls with StealthChop only, and only
    /// while TCOOLTHRS >= TSTEP > TPWMTHRS (section 5.3, SGTHRS).
    #[must_use]
    pub fn diag(&self) -> bool {
        let [tstep, fastest, slowest, result, threshold] =
            [TSTEP, TPWMTHRS, TCOOLTHRS, SG_RESULT, SGTHRS].map(|register| self.registers[register]);
        let stealth_chop = self.registers[GCONF] >> 2 & 1 == 0;
        let is_on = self.drives() && stealth_chop && slowest >= tstep && tstep > fastest;
        let error = self.registers[GSTAT] & 1 << 1 != 0;
        self.is_supplied && (error || is_on && result <= 2 * (threshold & 0xFF))
    }

    /// The StallGuard value of the last full step: the higher, the less load.
    #[must_use]
    pub fn sg_result(&self) -> u32 {
        self.registers[SG_RESULT]
    }

    /// Microsteps of a full step: by register, or by the address pins (section 3.3).
    #[must_use]
    pub fn microsteps(&self) -> u32 {
        if self.registers[GCONF] >> 7 & 1 == 1 {
            256 >> (self.registers[CHOPCONF] >> 24 & 0xF).min(8)
        } else {
            [8, 32, 64, 16][usize::from(self.address & 3)]
        }
    }

    /// Whether the outputs drive the motor.
    #[must_use]
    pub fn drives(&self) -> bool {
        let chops = self.registers[CHOPCONF] & 0xF != 0;
        self.is_supplied && self.is_enabled && chops && !self.is_overheated && !self.is_shut_down
    }

    /// Effective current in the motor in milliamperes, with sense resistors of `sense_mohm` (section 9).
    #[must_use]
    pub fn current_ma(&self, sense_mohm: u32) -> f64 {
        let volts = if self.registers[CHOPCONF] >> 17 & 1 == 1 { 0.180 } else { 0.325 };
        let scale = f64::from(self.current_scale() + 1) / 32.0;
        let ohms = f64::from(sense_mohm + 20) * 1e-3;
        if self.drives() { scale * volts / ohms / std::f64::consts::SQRT_2 * 1e3 } else { 0.0 }
    }

    /// CS_ACTUAL: IRUN, or IHOLD when the motor has stood for TPOWERDOWN.
    fn current_scale(&self) -> u32 {
        let currents = self.registers[IHOLD_IRUN];
        let delay = STANDSTILL_US + u64::from(self.registers[TPOWERDOWN]) * POWER_DOWN_US;
        let rests = self.now.0 >= self.stepped_at.0 + delay;
        if rests { currents & 31 } else { currents >> 8 & 31 }
    }

    /// Lets the protections act.
    fn look(&mut self) {
        // Off at the limit, on again only below the warning (section 11.1).
        self.is_overheated = self.celsius >= SWITCHES_OFF_AT || self.is_overheated && self.celsius >= WARNS_AT;
        // A short is noticed by current that flows; the flags stay until the driver is disabled (section 5.5.3).
        if !self.is_enabled || !self.is_supplied {
            self.is_shut_down = false;
        } else if self.drives() && self.faults.is_shorted {
            self.is_shut_down = true;
        }
        if self.is_overheated || self.is_shut_down {
            self.registers[GSTAT] |= 1 << 1;
        }
    }

    /// Takes a byte from the line; `begins` says that the line rested before it, so that a datagram begins. Returns the
    /// reply if the byte completes a request for this driver.
    pub fn hear(&mut self, byte: u8, begins: bool) -> Option<DriverReply> {
        if !self.is_supplied || self.faults.is_mute {
            return None;
        }
        if begins {
            self.received.clear();
        }
        self.received.push(byte);
        let is_write = self.received.get(2).is_some_and(|register| register & 0x80 != 0);
        if self.received.len() < if is_write { 8 } else { 4 } {
            return None;
        }
        let datagram = std::mem::take(&mut self.received);
        let (&crc, body) = datagram.split_last()?;
        let &[sync, address, register, ..] = body else { return None };
        if sync & 0xF != 5 || address != self.address || crc != crc8(body) {
            return None;
        }
        if is_write {
            self.write(usize::from(register & 0x7F), body);
            return None;
        }
        Some(self.reply(usize::from(register)))
    }

    fn write(&mut self, register: usize, body: &[u8]) {
        if self.faults.garbled_writes > 0 {
            self.faults.garbled_writes -= 1;
            return;
        }
        let value = body[3..].iter().fold(0, |value, &byte| value << 8 | u32::from(byte));
        self.registers[IFCNT] = (self.registers[IFCNT] + 1) & 0xFF;
        if register == GSTAT {
            self.registers[GSTAT] &= !value;
        } else if WRITABLE.contains(&register) {
            self.registers[register] = value;
        }
        self.look();
    }

    fn reply(&mut self, register: usize) -> DriverReply {
        let value = match register {
            DRV_STATUS => self.status(),
            IOIN => 0x2100_0040 | u32::from(!self.is_enabled),
            _ if READABLE.contains(&register) => self.registers[register],
            _ => 0,
        };
        let [a, b, c, d] = value.to_be_bytes();
        let mut bytes = [5, 0xFF, register as u8, a, b, c, d, 0];
        bytes[7] = crc8(&bytes[..7]);
        if self.faults.garbled_replies > 0 {
            self.faults.garbled_replies -= 1;
            bytes[5] ^= 0x10;
        }
        // SENDDELAY: 0 and 1 for 8 bits, 2 and 3 for three times as many, and so on (section 5.1).
        let delay = self.registers[NODECONF] >> 8 & 0xF;
        DriverReply { bytes, after_bits: 8 * (delay | 1) }
    }

    fn status(&self) -> u32 {
        let mut status = self.current_scale() << 16;
        if self.celsius >= WARNS_AT {
            status |= OTPW;
        }
        if self.is_overheated {
            status |= OT;
        }
        if self.is_shut_down {
            status |= S2GA;
        }
        if self.now.0 >= self.stepped_at.0 + STANDSTILL_US {
            status |= STST;
        }
        status
    }
}

/// The shift register of section 4.2: each bit of a byte from the lowest on.
fn crc8(bytes: &[u8]) -> u8 {
    let mut crc = 0u8;
    for byte in bytes {
        for bit in 0..8 {
            let feedback = ((crc >> 7) ^ (byte >> bit)) & 1;
            crc = (crc << 1) ^ (feedback * 7);
        }
    }
    crc
}

#[cfg(test)]
mod tests {
    use super::crc8;

    /// From Trinamic's support and users: GCONF read, IOIN answered, CHOPCONF written.
    #[test]
    fn the_checksum_is_that_of_published_datagrams() {
        assert_eq!(crc8(&[0x05, 0x00, 0x00]), 0x48);
        assert_eq!(crc8(&[0x05, 0xFF, 0x06, 0x21, 0x00, 0x02, 0x41]), 0x9D);
        assert_eq!(crc8(&[0x05, 0x00, 0xEC, 0x10, 0x00, 0x00, 0x53]), 0x9C);
    }
}
