//! How a servo is, and how it moves.

use std::time::Duration;

use tokio::time::Instant;
use vergence_dynamixel::units::{COUNTS_PER_TURN, HardwareErrors, Voltage};
use vergence_dynamixel::{Id, PingInfo, encode, table};

use super::error::ServoError;
use super::port::ServoPort;

/// Pings whose time is measured.
const PINGS: usize = 50;
/// A swing of this angle, in counts: five degrees.
const SWING: i64 = COUNTS_PER_TURN as i64 * 5 / 360;
/// Speed of a swing in units of 0.229 revolutions a minute: 14 degrees a second.
const SWING_SPEED: i64 = 10;
/// Longest time of one way of a swing.
const SWING_TIME: Duration = Duration::from_secs(3);
/// Largest error at its end, in counts: a degree.
const SWING_ERROR: i64 = 12;

/// What a servo says of itself, and how quickly.
#[derive(Clone, Debug, PartialEq)]
pub struct Examination {
    /// Kind and firmware.
    pub info: PingInfo,
    /// Supply in volts.
    pub volts: f64,
    /// Temperature in degrees Celsius.
    pub celsius: i64,
    /// Errors of its hardware since its start.
    pub errors: HardwareErrors,
    /// Position of its output in degrees.
    pub degrees: f64,
    /// Whether torque is on.
    pub has_torque: bool,
    /// Median and longest time from a ping to its answer, with adapter and system.
    pub round_trip: [Duration; 2],
}

/// How a servo moved by a small angle and back.
#[derive(Clone, Debug, PartialEq)]
pub struct Swing {
    /// Where it was at the end of both ways, beside where it should be, in degrees.
    pub errors: [f64; 2],
    /// Whether both are within a degree.
    pub is_good: bool,
}

/// Asks a servo how it is. Moves nothing.
///
/// # Errors
/// [`ServoError`].
pub fn examine(port: &mut ServoPort, id: Id) -> Result<Examination, ServoError> {
    let mut times = Vec::with_capacity(PINGS);
    let mut info = PingInfo { model: 0, firmware: 0 };
    for _ in 0..PINGS {
        let begin = Instant::now();
        let heard = port.ask_one(id, &encode::ping(id)?)?;
        times.push(begin.elapsed());
        if let Some(&[a, b, firmware]) = heard.data.first_chunk::<3>() {
            info = PingInfo { model: u16::from_le_bytes([a, b]), firmware };
        }
    }
    times.sort();
    let [median, longest] = [times.get(PINGS / 2), times.last()].map(|time| time.copied().unwrap_or_default());
    let volts = port.read(id, &table::PRESENT_INPUT_VOLTAGE)?;
    Ok(Examination {
        info,
        volts: f64::from(Voltage(u16::try_from(volts).unwrap_or_default()).millivolts()) * 1e-3,
        celsius: port.read(id, &table::PRESENT_TEMPERATURE)?,
        errors: HardwareErrors(u8::try_from(port.read(id, &table::HARDWARE_ERROR_STATUS)?).unwrap_or(u8::MAX)),
        degrees: degrees(port.read(id, &table::PRESENT_POSITION)?),
        has_torque: port.read(id, &table::TORQUE_ENABLE)? != 0,
        round_trip: [median, longest],
    })
}

/// Turns a servo by five degrees and back, slowly, and ends its torque.
///
/// # Errors
/// [`ServoError`]; [`ServoError::Torque`] where something else drives it.
pub fn swing(port: &mut ServoPort, id: Id) -> Result<Swing, ServoError> {
    if port.read(id, &table::TORQUE_ENABLE)? != 0 {
        return Err(ServoError::Torque(id.get()));
    }
    let swung = both_ways(port, id);
    // Whatever happened, it is let go.
    port.write(id, &table::TORQUE_ENABLE, 0)?;
    let errors = swung?;
    let is_good = errors.iter().all(|error| error.abs() <= SWING_ERROR);
    Ok(Swing { errors: errors.map(degrees), is_good })
}

fn both_ways(port: &mut ServoPort, id: Id) -> Result<[i64; 2], ServoError> {
    let here = port.read(id, &table::PRESENT_POSITION)?;
    port.write(id, &table::PROFILE_VELOCITY, SWING_SPEED)?;
    port.write(id, &table::TORQUE_ENABLE, 1)?;
    // Away from the nearer end of its range.
    let there = if here > i64::from(COUNTS_PER_TURN) / 2 { here - SWING } else { here + SWING };
    Ok([go(port, id, there)?, go(port, id, here)?])
}

/// Goes to a place; by how far it is missed.
fn go(port: &mut ServoPort, id: Id, goal: i64) -> Result<i64, ServoError> {
    port.write(id, &table::GOAL_POSITION, goal)?;
    let end = Instant::now() + SWING_TIME;
    let mut error = i64::MAX;
    while Instant::now() < end {
        let before = error;
        error = port.read(id, &table::PRESENT_POSITION)? - goal;
        if error.abs() <= SWING_ERROR && error == before {
            break;
        }
    }
    Ok(error)
}

fn degrees(counts: i64) -> f64 {
    counts as f64 * 360.0 / f64::from(COUNTS_PER_TURN)
}
