//! The port of a USB adapter on the servos' bus.

use std::io::{ErrorKind, Read, Write};
use std::time::Duration;

use serialport::{ClearBuffer, SerialPort};
use tokio::time::Instant;
use vergence_dynamixel::table::Register;
use vergence_dynamixel::units::Baud;
use vergence_dynamixel::{Id, Receiver, Status, StatusError, encode};

use super::error::ServoError;

/// Time that an answer may take beyond its bytes: the adapter's buffer (16 ms as delivered, FTDI), and the servo's delay.
const PATIENCE: Duration = Duration::from_millis(40);
/// How often a question without answer is repeated.
const TRIES: u32 = 3;
/// How long the port is asked for bytes at once.
const READ: Duration = Duration::from_millis(2);

/// The answer of a servo.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Heard {
    /// Who answers.
    pub id: Id,
    /// What it refuses.
    pub error: Option<StatusError>,
    /// Whether it has found an error of its hardware.
    pub alert: bool,
    /// Its data.
    pub data: Vec<u8>,
}

/// An open adapter.
pub struct ServoPort {
    name: String,
    port: Box<dyn SerialPort>,
    baud: Baud,
    garbled: u32,
}

impl ServoPort {
    /// Opens an adapter, such as `/dev/ttyUSB0`.
    ///
    /// # Errors
    /// [`ServoError::Port`].
    pub fn open(name: &str, baud: Baud) -> Result<Self, ServoError> {
        let port = serialport::new(name, baud.bits_per_second()).timeout(READ).open();
        let port = port.map_err(|why| ServoError::Port { port: name.to_owned(), why: why.to_string() })?;
        Ok(Self { name: name.to_owned(), port, baud, garbled: 0 })
    }

    /// Speed of the port.
    #[must_use]
    pub fn baud(&self) -> Baud {
        self.baud
    }

    /// Packets with a wrong CRC since the port was opened, and questions to which nothing but noise came back.
    #[must_use]
    pub fn garbled(&self) -> u32 {
        self.garbled
    }

    /// Changes the speed of the port.
    ///
    /// # Errors
    /// [`ServoError::Port`].
    pub fn set_baud(&mut self, baud: Baud) -> Result<(), ServoError> {
        let set = self.port.set_baud_rate(baud.bits_per_second());
        set.map_err(|why| self.failed(&why))?;
        self.baud = baud;
        Ok(())
    }

    fn failed(&self, why: &impl ToString) -> ServoError {
        ServoError::Port { port: self.name.clone(), why: why.to_string() }
    }

    /// Time of so many bytes on the line.
    #[must_use]
    pub fn time_of(&self, bytes: u32) -> Duration {
        Duration::from_secs_f64(f64::from(bytes) * 10.0 / f64::from(self.baud.bits_per_second()))
    }

    /// Sends a packet and takes the answers for so long, or until `is_enough`.
    ///
    /// # Errors
    /// [`ServoError::Port`].
    pub fn ask(
        &mut self,
        packet: &[u8],
        longest: Duration,
        is_enough: impl Fn(&[Heard]) -> bool,
    ) -> Result<Vec<Heard>, ServoError> {
        // What came late answers no new question.
        self.port.clear(ClearBuffer::Input).map_err(|why| self.failed(&why))?;
        self.port.write_all(packet).map_err(|why| self.failed(&why))?;
        self.port.flush().map_err(|why| self.failed(&why))?;
        let sent = self.time_of(packet.len() as u32);
        let (end, mut receiver, mut heard) = (Instant::now() + sent + longest, Receiver::default(), Vec::new());
        let (mut buffer, mut bytes, mut packets) = ([0; 256], 0, 0);
        while Instant::now() < end && !is_enough(&heard) {
            match self.port.read(&mut buffer) {
                Ok(count) => {
                    bytes += count;
                    packets += hear(&mut receiver, buffer.get(..count).unwrap_or_default(), &mut heard);
                }
                Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::Interrupted) => {}
                Err(error) => return Err(self.failed(&error)),
            }
        }
        let is_noise = bytes > 0 && packets == 0 && receiver.counters().crc_errors == 0;
        self.garbled = self.garbled.saturating_add(receiver.counters().crc_errors + u32::from(is_noise));
        Ok(heard)
    }

    /// Asks one servo, again where no answer comes.
    ///
    /// # Errors
    /// [`ServoError`]: no answer, a garbled one, a refusal.
    pub fn ask_one(&mut self, id: Id, packet: &[u8]) -> Result<Heard, ServoError> {
        let before = self.garbled;
        for _ in 0..TRIES {
            let longest = PATIENCE + self.time_of(64);
            let heard = self.ask(packet, longest, |heard| heard.iter().any(|heard| heard.id == id))?;
            if let Some(heard) = heard.into_iter().find(|heard| heard.id == id) {
                return match heard.error {
                    Some(why) => Err(ServoError::Refused { id: id.get(), why }),
                    None => Ok(heard),
                };
            }
        }
        let baud = self.baud.bits_per_second();
        Err(if self.garbled > before { ServoError::Garbled(baud) } else { ServoError::Silent { id: id.get(), baud } })
    }

    /// Reads a register.
    ///
    /// # Errors
    /// Those of [`Self::ask_one`].
    pub fn read(&mut self, id: Id, register: &Register) -> Result<i64, ServoError> {
        let heard = self.ask_one(id, &encode::read(id, register.address, register.width)?)?;
        let mut bytes = [0; 8];
        for (slot, byte) in bytes.iter_mut().zip(&heard.data) {
            *slot = *byte;
        }
        let value = i64::from_le_bytes(bytes);
        let bits = 8 * u32::from(register.width);
        let is_negative = register.signed && bits < 64 && value >> (bits - 1) != 0;
        Ok(if is_negative { value - (1 << bits) } else { value })
    }

    /// Writes a register and reads it back.
    ///
    /// # Errors
    /// Those of [`Self::ask_one`]; [`ServoError::NotKept`].
    pub fn write(&mut self, id: Id, register: &Register, value: i64) -> Result<(), ServoError> {
        self.order(id, register, value)?;
        match self.read(id, register)? {
            has if has == value => Ok(()),
            has => Err(ServoError::NotKept { id: id.get(), name: register.name, has, wanted: value }),
        }
    }

    /// Writes a register, by whose change the servo may answer no more as before.
    ///
    /// # Errors
    /// Those of [`Self::ask_one`].
    pub fn order(&mut self, id: Id, register: &Register, value: i64) -> Result<(), ServoError> {
        let bytes = value.to_le_bytes();
        let data = bytes.get(..usize::from(register.width)).unwrap_or_default();
        self.ask_one(id, &encode::write(id, register.address, data)?).map(drop)
    }
}

/// Takes bytes; the number of packets that they completed.
fn hear(receiver: &mut Receiver, mut bytes: &[u8], heard: &mut Vec<Heard>) -> usize {
    let mut packets = 0;
    while !bytes.is_empty() {
        let before = bytes.len();
        bytes = receiver.hear(bytes);
        while let Some(packet) = receiver.next_packet() {
            packets += 1;
            // Where the adapter hears itself, its own question is no answer.
            if let Ok(status) = Status::of(&packet) {
                let Status { id, error, alert, data } = status;
                heard.push(Heard { id, error, alert, data: data.to_vec() });
            }
        }
        if bytes.len() == before {
            receiver.clear();
        }
    }
    packets
}
