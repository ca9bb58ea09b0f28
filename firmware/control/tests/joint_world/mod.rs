//! Five simulated servos on one wire, and the master that a board ticks each millisecond.
#![allow(dead_code, reason = "each test file uses its own part")]

use vergence_control::joints::{BusSettings, JointBus, JointFault, JointSettings};
use vergence_dynamixel::Id;
use vergence_dynamixel::units::{Baud, BusWatchdog, Position};
use vergence_plant::servo::{Free, Nanoseconds, Servo, ServoBus, ServoFaults, ServoModel, Wire};
use vergence_protocol::Microseconds;

pub const COUNT: f64 = std::f64::consts::TAU / 4096.0;
const BAUD: u32 = 1_000_000;

pub fn id(number: u8) -> Id {
    Id::servo(number).unwrap()
}

pub fn at(counts: i32) -> Position {
    Position(counts)
}

pub struct BusWorld {
    pub bus: JointBus,
    pub servos: ServoBus<Free>,
    /// Time in microseconds.
    pub now: u64,
    wire: Wire,
    pub board_lives: bool,
    /// Whether questions for a combined answer reach the servos.
    pub passes_fast_reads: bool,
}

pub fn settings() -> BusSettings {
    let joints = (13..18).map(|number| JointSettings { id: id(number), current_limit: 600 }).collect();
    BusSettings { joints, baud: BAUD, watchdog: BusWatchdog(5) }
}

impl BusWorld {
    /// Servos 13 to 17 with the values of the factory but for their line speed, standing at half a turn.
    pub fn new() -> Self {
        let servo = |number| Servo::new(ServoModel::XM430_W350, id(number), Baud::M1, 2048.5 * COUNT);
        Self {
            bus: JointBus::new(settings()),
            servos: ServoBus::new((13..18).map(servo).collect(), Free::default()),
            now: 0,
            wire: Wire::new(BAUD),
            board_lives: true,
            passes_fast_reads: true,
        }
    }

    /// All set up, with torque.
    pub fn armed() -> Self {
        let mut world = Self::new();
        world.until_ready();
        world.bus.set_torque(true);
        world.run(60);
        assert_eq!(world.faults(), [None; 5]);
        assert!((13..18).all(|number| world.servo(number).has_torque()));
        world
    }

    pub fn restart_board(&mut self) {
        self.bus = JointBus::new(settings());
        self.board_lives = true;
    }

    pub fn instant(&self) -> Nanoseconds {
        Nanoseconds::microseconds(self.now)
    }

    pub fn servo(&self, number: u8) -> &Servo {
        self.servos.servos().iter().find(|servo| servo.id() == Some(id(number))).unwrap()
    }

    pub fn fault(&mut self, number: u8) -> &mut ServoFaults {
        self.servos.servo_mut(id(number)).unwrap().faults_mut()
    }

    pub fn faults(&self) -> [Option<JointFault>; 5] {
        std::array::from_fn(|joint| self.bus.joints()[joint].fault())
    }

    /// Runs until all joints are ready; how many milliseconds that took.
    pub fn until_ready(&mut self) -> u64 {
        let begin = self.now;
        while !self.bus.is_ready() {
            self.run(1);
            assert!(self.now - begin < 5_000_000, "{:?} {:?}", self.faults(), self.bus.counters());
        }
        (self.now - begin) / 1_000
    }

    /// Runs so many ticks.
    pub fn run(&mut self, ticks: u64) {
        for _ in 0..ticks {
            self.tick();
        }
    }

    fn tick(&mut self) {
        while let Some(byte) = self.wire.take_heard(self.instant()) {
            self.bus.hear(&[byte]);
        }
        if self.board_lives
            && let Some(bytes) = self.bus.poll(Microseconds(self.now)).unwrap()
        {
            assert!(!self.wire.is_sending(), "it talks while it still talks");
            let is_fast =
                bytes.len() > 7 && bytes.windows(8).any(|window| window[..5] == FAST[..5] && window[7] == FAST[7]);
            if self.passes_fast_reads || !is_fast {
                self.wire.send(&bytes, self.instant());
            }
        }
        self.now += 1_000;
        self.wire.run(&mut self.servos, Nanoseconds::microseconds(self.now));
    }
}

/// The beginning of a question for a combined answer: header, broadcast, any length, instruction 0x8A.
const FAST: [u8; 8] = [0xFF, 0xFF, 0xFD, 0x00, 0xFE, 0, 0, 0x8A];
