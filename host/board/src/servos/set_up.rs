//! What is on the bus, and the number and speed of a servo.

use std::time::Duration;

use vergence_dynamixel::units::Baud;
use vergence_dynamixel::{Id, PingInfo, encode, table};

use super::error::ServoError;
use super::port::{Heard, ServoPort};

/// Bytes of an answer to a ping, and the longest delay before it, for each number that may answer.
const PING_BYTES: u32 = 14;
const PING_DELAY: Duration = Duration::from_micros(510);
/// What adapter and system may add once.
const LATENCY: Duration = Duration::from_millis(60);

/// A servo that answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FoundServo {
    /// Number of the servo.
    pub id: Id,
    /// Speed at which it answers.
    pub baud: Baud,
    /// Kind and firmware.
    pub info: PingInfo,
    /// Whether it has found an error of its hardware.
    pub alert: bool,
}

/// What was found at one speed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scanned {
    /// The servos, by their numbers.
    pub servos: Vec<FoundServo>,
    /// Number of garbled answers: where not zero, two servos may have one number.
    pub garbled: u32,
}

/// Looks for servos at the port's speed, by a ping that all answer.
///
/// # Errors
/// [`ServoError::Port`].
pub fn scan_at(port: &mut ServoPort) -> Result<Scanned, ServoError> {
    let before = port.garbled();
    let slots = u32::from(Id::MAX) + 1;
    let longest = LATENCY + slots * (port.time_of(PING_BYTES) + PING_DELAY);
    let heard = port.ask(&encode::ping(Id::BROADCAST)?, longest, |_| false)?;
    let baud = port.baud();
    let found = |heard: &Heard| {
        let [a, b, firmware] = *heard.data.first_chunk::<3>()?;
        let info = PingInfo { model: u16::from_le_bytes([a, b]), firmware };
        Some(FoundServo { id: heard.id, baud, info, alert: heard.alert })
    };
    let mut servos: Vec<FoundServo> = heard.iter().filter_map(found).collect();
    servos.sort_by_key(|servo| servo.id);
    servos.dedup();
    Ok(Scanned { servos, garbled: port.garbled() - before })
}

/// Looks for servos at all speeds of the servos that the adapter makes; `progress` is called before each.
///
/// # Errors
/// [`ServoError::Port`].
pub fn scan(port: &mut ServoPort, mut progress: impl FnMut(Baud)) -> Result<Vec<(Baud, Scanned)>, ServoError> {
    let mut all = Vec::new();
    for baud in Baud::ALL {
        progress(baud);
        // An adapter that cannot make a speed finds nobody at it.
        if port.set_baud(baud).is_ok() {
            all.push((baud, scan_at(port)?));
        }
    }
    Ok(all)
}

/// Gives a servo another number.
///
/// # Errors
/// [`ServoError`]: the servo does not answer or has torque on, the number is taken, answers are garbled.
pub fn set_id(port: &mut ServoPort, from: Id, to: Id) -> Result<(), ServoError> {
    let Scanned { servos, garbled } = scan_at(port)?;
    if garbled > 0 {
        return Err(ServoError::Garbled(port.baud().bits_per_second()));
    }
    if servos.iter().any(|servo| servo.id == to) {
        return Err(ServoError::Taken(to.get()));
    }
    must_be_loose(port, from)?;
    port.order(from, &table::ID, to.get().into())?;
    port.ask_one(to, &encode::ping(to)?).map(drop)
}

/// Gives a servo another speed of the line; the port follows.
///
/// # Errors
/// [`ServoError`]: the servo does not answer or has torque on, the adapter cannot make the speed.
pub fn set_baud(port: &mut ServoPort, id: Id, baud: Baud) -> Result<(), ServoError> {
    must_be_loose(port, id)?;
    // Known before the servo is out of reach.
    let before = port.baud();
    port.set_baud(baud)?;
    port.set_baud(before)?;
    port.order(id, &table::BAUD_RATE, baud.register().into())?;
    port.set_baud(baud)?;
    port.ask_one(id, &encode::ping(id)?).map(drop)
}

fn must_be_loose(port: &mut ServoPort, id: Id) -> Result<(), ServoError> {
    match port.read(id, &table::TORQUE_ENABLE)? {
        0 => Ok(()),
        _ => Err(ServoError::Torque(id.get())),
    }
}

/// Name of a kind of servo by its number (e-manual of each); `None` for one that is not known here.
#[must_use]
pub const fn model_name(model: u16) -> Option<&'static str> {
    Some(match model {
        1000 => "XH430-W350",
        1010 => "XH430-W210",
        1020 => "XM430-W350",
        1030 => "XM430-W210",
        1060 => "XL430-W250",
        1120 => "XM540-W270",
        1130 => "XM540-W150",
        1190 => "XL330-M077",
        1200 => "XL330-M288",
        _ => return None,
    })
}
