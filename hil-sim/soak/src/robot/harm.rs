//! What goes wrong with a robot, and how it is called.

use vergence_dynamixel::Id;
use vergence_plant::servo::{AnyMechanism, Servo, ServoBus};
use vergence_protocol::FaultCode;
use vergence_sim::FIRST_SERVO_ID;

use super::board::RobotBoard;

/// Volts of the servos' supply.
const SUPPLY: f64 = 12.0;

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HarmKind {
    /// Nothing.
    Nothing,
    /// Some answers of a joint are lost or have a wrong bit.
    Noise,
    /// A joint falls off the bus.
    Silent,
    /// A joint answers under the next number.
    WrongId,
    /// All answers of a joint have a wrong bit.
    Garbled,
    /// A joint is too hot.
    Overheated,
    /// A joint is blocked.
    Blocked,
    /// The encoder of a joint does not work.
    EncoderBroken,
    /// The supply of a joint is gone for an instant: it starts anew, without torque.
    Restart,
    /// The emergency stop is pressed.
    EmergencyStop,
    /// The host is gone.
    HostGone,
    /// The board starts anew.
    BoardRestart,
    /// Board and servos lose their power for a second.
    PowerCut,
}

impl HarmKind {
    /// All of them.
    pub const ALL: [Self; 13] = [
        Self::Nothing,
        Self::Noise,
        Self::Silent,
        Self::WrongId,
        Self::Garbled,
        Self::Overheated,
        Self::Blocked,
        Self::EncoderBroken,
        Self::Restart,
        Self::EmergencyStop,
        Self::HostGone,
        Self::BoardRestart,
        Self::PowerCut,
    ];

    /// Its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nothing => "nothing",
            Self::Noise => "noise",
            Self::Silent => "silent joint",
            Self::WrongId => "wrong id",
            Self::Garbled => "garbled joint",
            Self::Overheated => "overheated joint",
            Self::Blocked => "blocked joint",
            Self::EncoderBroken => "broken encoder",
            Self::Restart => "joint restart",
            Self::EmergencyStop => "emergency stop",
            Self::HostGone => "host gone",
            Self::BoardRestart => "board restart",
            Self::PowerCut => "power cut",
        }
    }

    /// The faults as which the board may name it; none where it is no fault.
    pub(super) const fn names(self) -> &'static [FaultCode] {
        match self {
            Self::Nothing | Self::Noise | Self::BoardRestart | Self::PowerCut => &[],
            Self::Silent => &[FaultCode::DriverSilent],
            Self::WrongId => &[FaultCode::JointWrongId],
            Self::Garbled => &[FaultCode::DriverGarbled],
            Self::Overheated => &[FaultCode::DriverOverheated],
            Self::Blocked => {
                &[FaultCode::Stall, FaultCode::FollowingError, FaultCode::JointOverload, FaultCode::NotSettled]
            }
            Self::EncoderBroken => &[FaultCode::EncoderLost],
            Self::Restart => &[FaultCode::DriverSilent, FaultCode::DriverReset],
            Self::EmergencyStop => &[FaultCode::EmergencyStop],
            Self::HostGone => &[FaultCode::LeaseExpired],
        }
    }

    /// Whether it concerns one joint.
    pub(super) const fn is_of_joint(self) -> bool {
        matches!(
            self,
            Self::Silent
                | Self::WrongId
                | Self::Garbled
                | Self::Overheated
                | Self::Blocked
                | Self::EncoderBroken
                | Self::Restart
        )
    }

    /// Whether the board starts anew by it.
    pub(super) const fn restarts_board(self) -> bool {
        matches!(self, Self::BoardRestart | Self::PowerCut)
    }

    /// Begins it.
    pub(super) fn begin(self, board: &mut impl RobotBoard, axis: usize) {
        match self {
            Self::EmergencyStop => board.press_emergency_stop(true),
            Self::PowerCut => board.with_servos(&mut |servos, now| servos.set_supply(0.0, now)),
            _ => board.with_servos(&mut |servos, now| {
                let Some(servo) = servo(servos, axis) else { return };
                match self {
                    Self::Noise => (servo.faults_mut().lost_answers, servo.faults_mut().flipped_answers) = (1, 1),
                    Self::Silent => servo.faults_mut().is_silent = true,
                    Self::WrongId => servo.faults_mut().wrong_ids = u32::MAX,
                    Self::Garbled => servo.faults_mut().flipped_answers = u32::MAX,
                    Self::Overheated => servo.motor_mut().set_temperature(95.0),
                    Self::Blocked => servo.motor_mut().blocked = true,
                    Self::EncoderBroken => servo.faults_mut().encoder_broken = true,
                    Self::Restart => {
                        servo.set_supply(0.0, now);
                        servo.set_supply(SUPPLY, now);
                    }
                    _ => {}
                }
            }),
        }
    }

    /// Ends it.
    pub(super) fn end(self, board: &mut impl RobotBoard, axis: usize) {
        board.press_emergency_stop(false);
        board.with_servos(&mut |servos, now| {
            if self == Self::PowerCut {
                servos.set_supply(SUPPLY, now);
            }
            if let Some(servo) = servo(servos, axis) {
                *servo.faults_mut() = vergence_plant::servo::ServoFaults::default();
                servo.motor_mut().blocked = false;
                if self == Self::Overheated {
                    servo.motor_mut().set_temperature(40.0);
                }
            }
        });
    }
}

/// The servo of an axis.
fn servo(servos: &mut ServoBus<AnyMechanism>, axis: usize) -> Option<&mut Servo> {
    let number = FIRST_SERVO_ID.checked_add(u8::try_from(axis).ok()?)?;
    servos.servo_mut(Id::servo(number).ok()?)
}
