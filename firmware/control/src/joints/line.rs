//! The joints between node and bus: what the node orders at each tick, and what the bus has read.
//!
//! The node's tick and the bus run apart: on the board in two priorities. [`JointOrders`] and [`JointStates`] are all that
//! passes between them, each as one value that a short critical section copies.

use vergence_dynamixel::units::Position;
use vergence_protocol::{AxisList, DriverState, EncoderState, FaultCode, Microseconds};

use super::bus::{JointBus, Transmission};
use super::joint::{Joint, JointReading};
use super::settings::BusSettings;

/// Time in microseconds after which joints with a fault are tried again, while torque is off. A servo starts in less.
const RETRY_US: u64 = 500_000;
/// Counts of a joint in one revolution per microsecond for one unit of its velocity (0.229 revolutions a minute).
const COUNTS_OF_VELOCITY: f32 = 4096.0 * 0.229 / 60e6;
/// Longest time in microseconds over which a position is carried on by the velocity.
const LONGEST_CARRY_US: u64 = 20_000;
/// Temperature in degrees Celsius at which a joint counts as hot: its servo gives up at 80.
const HOT_CELSIUS: u8 = 70;

/// What the node wants of the joints.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct JointOrders {
    /// Whether torque shall be on.
    pub torque: bool,
    /// Goal of each joint in counts, from the first tick after torque was wanted on; empty before.
    pub goals: AxisList<i32>,
}

impl JointOrders {
    /// Switches torque; the goals until then are void.
    pub fn set_torque(&mut self, on: bool) {
        self.torque = on;
        self.goals.clear();
    }

    /// Sets the goal of the joint of an axis. The joints of a tick come in the order of their axes.
    pub fn set_goal(&mut self, joint: usize, counts: i32) {
        if let Some(goal) = self.goals.get_mut(joint) {
            *goal = counts;
        } else if self.goals.len() == joint {
            // The first tick fills the list, which has a place for each axis.
            let _ = self.goals.push(counts);
        }
    }
}

/// What is known of one joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JointState {
    /// Its latest position; `None` before the first.
    pub reading: Option<JointReading>,
    /// State of its servo.
    pub driver: DriverState,
}

/// What is known of all joints.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct JointStates(pub AxisList<JointState>);

impl JointStates {
    /// State of the servo of a joint.
    #[must_use]
    pub fn driver(&self, joint: usize) -> DriverState {
        self.0.get(joint).map_or(DriverState::Starting, |joint| joint.driver)
    }

    /// Position of a joint in counts at the instant of [`Self::read_at`]; zero before the first.
    #[must_use]
    pub fn counts(&self, joint: usize) -> i32 {
        let latest = || self.reading(joint).map_or(0, |reading| reading.position.0);
        self.read_at().map_or_else(latest, |at| self.counts_at(joint, at))
    }

    /// Position of a joint in counts at an instant: the latest one, carried on by its velocity; that of a joint with a fault is not
    /// carried on.
    #[must_use]
    pub fn counts_at(&self, joint: usize, at: Microseconds) -> i32 {
        let Some(reading) = self.reading(joint) else { return 0 };
        if matches!(self.driver(joint), DriverState::Failed(_)) {
            return reading.position.0;
        }
        let limit = LONGEST_CARRY_US as i64;
        let since = at.0.wrapping_sub(reading.at.0).cast_signed().clamp(-limit, limit);
        reading.position.0 + libm::roundf(reading.velocity.0 as f32 * COUNTS_OF_VELOCITY * since as f32) as i32
    }

    /// When the oldest of the latest positions was read; `None` before all joints were read.
    #[must_use]
    pub fn read_at(&self) -> Option<Microseconds> {
        let joints = self.0.iter().filter(|joint| !matches!(joint.driver, DriverState::Failed(_)));
        joints.map(|joint| joint.reading.map(|reading| reading.at)).min().flatten()
    }

    /// What is known of a joint's encoder.
    #[must_use]
    pub fn encoder(&self, joint: usize) -> EncoderState {
        match (self.driver(joint), self.reading(joint)) {
            (DriverState::Failed(code @ FaultCode::EncoderLost), _) => EncoderState::Failed(code),
            (_, None) => EncoderState::Starting,
            (_, Some(reading)) => {
                EncoderState::Absolute { reading: reading.position.0.rem_euclid(4096) as u16, gain: 0 }
            }
        }
    }

    fn reading(&self, joint: usize) -> Option<JointReading> {
        self.0.get(joint)?.reading
    }
}

/// The bus with the orders of the node.
#[derive(Clone, Debug)]
pub struct JointLine {
    bus: JointBus,
    torque: bool,
    /// When joints with a fault are tried again.
    retry_at: Microseconds,
}

impl JointLine {
    /// A line on which nothing was sent yet.
    #[must_use]
    pub fn new(settings: BusSettings) -> Self {
        Self { bus: JointBus::new(settings), torque: false, retry_at: Microseconds(RETRY_US) }
    }

    /// The master of the bus.
    #[must_use]
    pub fn bus(&self) -> &JointBus {
        &self.bus
    }

    /// Takes the node's orders.
    pub fn order(&mut self, orders: &JointOrders) {
        if core::mem::replace(&mut self.torque, orders.torque) != orders.torque {
            self.bus.set_torque(orders.torque);
        }
        for (joint, &goal) in orders.goals.iter().enumerate() {
            self.bus.set_goal(joint, Position(goal));
        }
    }

    /// Takes bytes from the wire: [`JointBus::hear`].
    pub fn hear(&mut self, bytes: &[u8]) {
        self.bus.hear(bytes);
    }

    /// What is to be sent now, if anything: [`JointBus::poll`].
    pub fn poll(&mut self, now: Microseconds) -> Option<Transmission> {
        if !self.torque && now >= self.retry_at {
            self.retry_at = Microseconds(now.0 + RETRY_US);
            self.bus.recover();
        }
        self.bus.poll(now).ok().flatten()
    }

    /// What is known of the joints.
    #[must_use]
    pub fn states(&self) -> JointStates {
        JointStates(self.bus.joints().iter().map(state_of).collect())
    }
}

fn state_of(joint: &Joint) -> JointState {
    let is_hot = joint.health().is_some_and(|health| health.celsius >= HOT_CELSIUS);
    let driver = match joint.fault() {
        Some(fault) => DriverState::Failed(fault.code()),
        None if !joint.is_ready() => DriverState::Starting,
        None if is_hot => DriverState::Hot,
        None => DriverState::Ready,
    };
    JointState { reading: joint.reading(), driver }
}
