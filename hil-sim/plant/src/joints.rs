//! The joints of a robot behind the native board: the servos with what they move, and the board's end of their bus.

use vergence_control::joints::{BusSettings, JointLine, JointOrders, JointStates};
use vergence_protocol::Microseconds;

use crate::servo::{AnyMechanism, Nanoseconds, ServoBus, Wire};

/// Period in microseconds in which the native board looks after its bus. A chip does so when bytes come.
const PERIOD_US: u64 = 250;

/// The servos, and the board's end of the wire where it drives joints.
#[derive(Clone, Debug)]
pub struct Joints {
    servos: ServoBus<AnyMechanism>,
    end: Option<End>,
    /// Time of the servos at the board's start, and now.
    began: Nanoseconds,
    now: Nanoseconds,
}

/// The board's end.
#[derive(Clone, Debug)]
struct End {
    settings: BusSettings,
    line: JointLine,
    orders: JointOrders,
    states: JointStates,
    wire: Wire,
    /// When the board looks after the bus next.
    next: Microseconds,
}

impl Joints {
    /// Servos on a bus that no board drives yet.
    #[must_use]
    pub const fn new(servos: ServoBus<AnyMechanism>) -> Self {
        Self { servos, end: None, began: Nanoseconds(0), now: Nanoseconds(0) }
    }

    /// The servos with what they move.
    #[must_use]
    pub const fn servos(&self) -> &ServoBus<AnyMechanism> {
        &self.servos
    }

    /// The servos with what they move, to change them.
    pub const fn servos_mut(&mut self) -> &mut ServoBus<AnyMechanism> {
        &mut self.servos
    }

    /// Time of the servos.
    #[must_use]
    pub const fn now(&self) -> Nanoseconds {
        self.now
    }

    /// What the board has counted on the bus; `None` where it drives no joints.
    #[must_use]
    pub fn line(&self) -> Option<&JointLine> {
        self.end.as_ref().map(|end| &end.line)
    }

    /// Makes the board drive the bus with these settings, or leave it alone.
    pub fn configure(&mut self, settings: Option<&BusSettings>, now: Microseconds) {
        if self.end.as_ref().map(|end| &end.settings) == settings {
            return;
        }
        self.end = settings.map(|settings| End {
            settings: settings.clone(),
            line: JointLine::new(settings.clone()),
            orders: JointOrders::default(),
            states: JointStates::default(),
            wire: Wire::new(settings.baud),
            next: now,
        });
    }

    /// The board starts anew: its clock begins at zero, and it has forgotten the bus. The servos go on.
    pub fn restart_clock(&mut self, now: Microseconds) {
        self.began = self.instant(now);
        self.end = None;
    }

    fn instant(&self, now: Microseconds) -> Nanoseconds {
        self.began.plus(Nanoseconds::microseconds(now.0))
    }

    /// Lets time pass until `to`.
    pub fn advance(&mut self, to: Microseconds) {
        while let Some(next) = self.end.as_ref().map(|end| end.next).filter(|next| *next <= to) {
            let instant = self.instant(next);
            let Some(end) = &mut self.end else { break };
            end.wire.run(&mut self.servos, instant);
            end.look_after(next, instant);
        }
        let instant = self.instant(to);
        self.now = instant;
        match &mut self.end {
            Some(end) => end.wire.run(&mut self.servos, instant),
            None => self.servos.advance(instant),
        }
    }

    /// What is known of the joints; `None` where the board drives none.
    #[must_use]
    pub fn states(&self) -> Option<&JointStates> {
        self.end.as_ref().map(|end| &end.states)
    }

    /// The orders, to change them; `None` where the board drives no joints.
    pub fn orders(&mut self) -> Option<&mut JointOrders> {
        self.end.as_mut().map(|end| &mut end.orders)
    }
}

impl End {
    fn look_after(&mut self, now: Microseconds, instant: Nanoseconds) {
        self.next = Microseconds(now.0 + PERIOD_US);
        while let Some(byte) = self.wire.take_heard(instant) {
            self.line.hear(&[byte]);
        }
        self.line.order(&self.orders);
        if let Some(bytes) = self.line.poll(now) {
            self.wire.send(&bytes, instant);
        }
        self.states = self.line.states();
    }
}
