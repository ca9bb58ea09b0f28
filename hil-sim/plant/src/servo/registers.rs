//! The control table of a simulated servo: bytes, who may write them, and what they may hold.

use vergence_dynamixel::StatusError;
use vergence_dynamixel::table::{self, Access, Area, INDIRECT, Register, TABLE_BYTES};
use vergence_dynamixel::units::OperatingMode;

use super::limits::{Limits, WRITABLE};
use super::model::ServoModel;

/// The registers of one servo.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Registers {
    bytes: Vec<u8>,
}

/// What only the servo itself shows, with the bus watchdog's error.
const BITTEN: i64 = -1;

impl Registers {
    /// As from the factory.
    #[must_use]
    pub fn new(model: &ServoModel) -> Self {
        let mut registers = Self { bytes: vec![0; usize::from(TABLE_BYTES)] };
        for limits in WRITABLE {
            registers.set(&limits.register, limits.initial);
        }
        for number in 1..=INDIRECT {
            if let (Some(address), Some(data)) = (table::indirect_address(number), table::indirect_data(number)) {
                registers.set(&address, i64::from(data.address));
            }
        }
        registers.set(&table::MODEL_NUMBER, i64::from(model.number));
        registers.set(&table::FIRMWARE_VERSION, i64::from(model.firmware));
        registers
    }

    /// As after a start: the EEPROM keeps its values.
    pub fn restart(&mut self, model: &ServoModel) {
        let fresh = Self::new(model);
        let kept = usize::from(table::TORQUE_ENABLE.address);
        self.bytes.truncate(kept);
        self.bytes.extend(fresh.bytes.iter().skip(kept));
        self.set(&table::GOAL_CURRENT, self.get(&table::CURRENT_LIMIT));
        self.set(&table::GOAL_PWM, self.get(&table::PWM_LIMIT));
    }

    /// The value of a register.
    #[must_use]
    pub fn get(&self, register: &Register) -> i64 {
        let from = usize::from(register.address);
        let bytes = self.bytes.get(from..from + usize::from(register.width)).unwrap_or_default();
        value(bytes, register.signed)
    }

    /// Sets a register as the servo itself does, without any check.
    pub fn set(&mut self, register: &Register, value: i64) {
        let from = usize::from(register.address);
        if let Some(bytes) = self.bytes.get_mut(from..from + usize::from(register.width)) {
            bytes.iter_mut().zip(value.to_le_bytes()).for_each(|(to, byte)| *to = byte);
        }
    }

    /// Reads bytes, through indirect registers where these are read. Gaps of the table read as zero.
    ///
    /// # Errors
    /// [`StatusError::Access`] beyond the end of the table.
    pub fn read(&self, address: u16, length: u16) -> Result<Vec<u8>, StatusError> {
        let end = address.checked_add(length).filter(|end| *end <= TABLE_BYTES).ok_or(StatusError::Access)?;
        let byte = |address| self.bytes.get(usize::from(self.meant(address))).copied().unwrap_or_default();
        Ok((address..end).map(byte).collect())
    }

    /// Writes bytes as a master does: whole registers, none of which may refuse; nothing is written if one does.
    ///
    /// # Errors
    /// The [`StatusError`] that the servo answers with.
    pub fn write(&mut self, address: u16, data: &[u8]) -> Result<(), StatusError> {
        let length = u16::try_from(data.len()).map_err(|_| StatusError::DataLength)?;
        address.checked_add(length).filter(|end| *end <= TABLE_BYTES).ok_or(StatusError::Access)?;
        let mut tried = self.clone();
        let mut rest = data;
        let mut address = address;
        while let Some(&first) = rest.first() {
            let meant = self.meant(address);
            // A register behind an indirect one is reached byte by byte, so only its first byte is judged as a whole.
            let taken = if meant == address {
                tried.write_register(self, meant, rest)?
            } else {
                tried.write_indirect(self, meant, first)?;
                1
            };
            rest = rest.get(taken..).unwrap_or_default();
            address = address.saturating_add(u16::try_from(taken).unwrap_or(u16::MAX));
        }
        *self = tried;
        Ok(())
    }

    /// Writes the register at `address` with the first of `data`; how many bytes it took.
    fn write_register(&mut self, before: &Self, address: u16, data: &[u8]) -> Result<usize, StatusError> {
        let torque = before.get(&table::TORQUE_ENABLE) != 0;
        if let Some(register) = indirect_address_at(address) {
            let bytes = data.get(..2).ok_or(StatusError::DataLength)?;
            let meant = value(bytes, false);
            if torque {
                return Err(StatusError::Access);
            }
            if !(64..661).contains(&meant) {
                return Err(StatusError::DataRange);
            }
            self.set(&register, meant);
            return Ok(2);
        }
        let register = table::ALL.iter().find(|register| register.address == address).ok_or(StatusError::Access)?;
        let locked = register.area == Area::Eeprom && torque;
        if register.access == Access::Read || locked {
            return Err(StatusError::Access);
        }
        let width = usize::from(register.width);
        let bytes = data.get(..width).ok_or(StatusError::DataLength)?;
        let wanted = value(bytes, register.signed);
        let limits = WRITABLE.iter().find(|limits| limits.register.address == address).ok_or(StatusError::Access)?;
        self.judge(limits, wanted)?;
        self.set(register, wanted);
        Ok(width)
    }

    /// Writes one byte of a register behind an indirect one.
    fn write_indirect(&mut self, before: &Self, address: u16, byte: u8) -> Result<(), StatusError> {
        let register = table::ALL.iter().find(|register| (register.address..register.end()).contains(&address));
        let register = register.ok_or(StatusError::Access)?;
        let locked = register.area == Area::Eeprom && before.get(&table::TORQUE_ENABLE) != 0;
        if register.access == Access::Read || locked || self.is_goal(register) && self.has_bitten() {
            return Err(StatusError::Access);
        }
        if let Some(place) = self.bytes.get_mut(usize::from(address)) {
            *place = byte;
        }
        Ok(())
    }

    /// Whether a value may be written.
    fn judge(&self, limits: &Limits, wanted: i64) -> Result<(), StatusError> {
        let register = &limits.register;
        if self.is_goal(register) && self.has_bitten() {
            return Err(StatusError::DataRange);
        }
        if !(limits.least..=limits.largest).contains(&wanted) {
            return Err(StatusError::DataRange);
        }
        let own = |limit: &Register| self.get(limit);
        let inside = match *register {
            table::OPERATING_MODE => {
                let known = u8::try_from(wanted).ok().and_then(OperatingMode::of_register);
                return known.map(|_| ()).ok_or(StatusError::DataRange);
            }
            table::GOAL_POSITION if own(&table::OPERATING_MODE) == i64::from(OperatingMode::Position.register()) => {
                (own(&table::MIN_POSITION_LIMIT)..=own(&table::MAX_POSITION_LIMIT)).contains(&wanted)
            }
            table::GOAL_CURRENT => wanted.abs() <= own(&table::CURRENT_LIMIT),
            table::GOAL_PWM => wanted.abs() <= own(&table::PWM_LIMIT),
            table::GOAL_VELOCITY => wanted.abs() <= own(&table::VELOCITY_LIMIT),
            _ => true,
        };
        if inside { Ok(()) } else { Err(StatusError::DataLimit) }
    }

    fn is_goal(&self, register: &Register) -> bool {
        [table::GOAL_PWM, table::GOAL_CURRENT, table::GOAL_VELOCITY, table::GOAL_POSITION].contains(register)
    }

    /// Whether the bus watchdog has bitten.
    #[must_use]
    pub fn has_bitten(&self) -> bool {
        self.get(&table::BUS_WATCHDOG) == BITTEN
    }

    /// The bus watchdog bites.
    pub fn bite(&mut self) {
        self.set(&table::BUS_WATCHDOG, BITTEN);
    }

    /// The address that a byte stands for: another one for indirect data.
    fn meant(&self, address: u16) -> u16 {
        let number = match address {
            224..=251 => address - 223,
            634..=661 => address - 605,
            _ => return address,
        };
        let meant = table::indirect_address(number).map_or(i64::from(address), |register| self.get(&register));
        u16::try_from(meant).unwrap_or(address)
    }
}

/// The indirect address register that begins here.
fn indirect_address_at(address: u16) -> Option<Register> {
    (1..=INDIRECT).filter_map(table::indirect_address).find(|register| register.address == address)
}

fn value(bytes: &[u8], signed: bool) -> i64 {
    let unsigned = bytes.iter().rev().fold(0_i64, |value, byte| value << 8 | i64::from(*byte));
    let bits = 8 * bytes.len();
    if signed && bits > 0 && unsigned >> (bits - 1) & 1 == 1 { unsigned - (1 << bits) } else { unsigned }
}
