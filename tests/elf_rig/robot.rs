//! A robot on the unmodified firmware: five simulated servos on the bus of the simulated chip.

use std::f64::consts::TAU;
use std::sync::{Mutex, PoisonError};

use vergence_dynamixel::Id;
use vergence_dynamixel::units::Baud;
use vergence_mcu::{Bench, BenchWiring, Machine, SentByte, UartId};
use vergence_plant::Plant;
use vergence_plant::servo::{AnyMechanism, Free, Nanoseconds, Servo, ServoBus, ServoModel};
use vergence_protocol::{
    AxisMask, ControllerState, DriverState, FaultCode, Microseconds, MovePhase, Report, Request, SettingItem,
    SettingKey, Status,
};

use crate::elf_rig::{Conversation, ElfBoard};

pub const ALL: AxisMask = AxisMask::first(5);
pub const IDS: [u8; 5] = [13, 14, 15, 16, 17];
pub fn degrees(angles: [f64; 5]) -> [i32; 5] {
    angles.map(|angle| (angle.to_radians() * 1e6).round() as i32)
}

pub fn spider() -> [i32; 5] {
    degrees([120.0, 120.0, 120.0, 180.0, 180.0])
}

pub fn stick_bug() -> [i32; 5] {
    degrees([170.0, 170.0, 20.0, 180.0, 180.0])
}

pub fn id(number: u8) -> Id {
    Id::servo(number).unwrap()
}

/// Servos that stand at half a turn, on a board that was delivered for the bench, before it gets power.
pub fn servos_on_a_board(speed: Baud) -> ElfBoard {
    let servo = |number| Servo::new(ServoModel::XM430_W350, id(number), speed, TAU / 2.0);
    let servos = ServoBus::new(IDS.map(servo).into(), AnyMechanism::new(Free::default()));
    ElfBoard::with_bench(Bench::new(BenchWiring::nucleo_g474_robot(), Plant::of_joints(servos)))
}

/// Makes the board one of a robot, as a person does it: a setting, saved, and a restart.
pub fn become_robot(talk: &mut Conversation<ElfBoard>) {
    let key = SettingKey { item: SettingItem::Machine, axis: 0 };
    assert_eq!(talk.ask(Request::SetSetting { key, value: 1 }), Status::Accepted);
    assert_eq!(talk.ask(Request::SaveSettings), Status::Accepted);
    restart(talk, 7);
}

pub fn restart(talk: &mut Conversation<ElfBoard>, session: u32) {
    let lost = talk.lost;
    talk.board.machine.power_on();
    talk.board.paint_stack();
    talk.wait_until("the restart goes unnoticed", |talk| talk.lost > lost);
    talk.reconnect(session);
}

pub struct Robot {
    pub talk: Conversation<ElfBoard>,
}

impl Robot {
    /// Connected, disarmed. The way there is simulated once.
    pub fn connected() -> Self {
        static SET: Mutex<Option<Machine<Bench>>> = Mutex::new(None);
        let mut set = SET.lock().unwrap_or_else(PoisonError::into_inner);
        let machine = set.get_or_insert_with(|| {
            let mut talk = Conversation::with_board(servos_on_a_board(Baud::M1), Microseconds(0));
            talk.connect();
            become_robot(&mut talk);
            talk.wait(500_000);
            talk.board.machine
        });
        let mut board = servos_on_a_board(Baud::M1);
        board.machine = machine.clone();
        let now = Microseconds(machine.time().0 / 1_000_000);
        let mut talk = Conversation::with_board(board, now);
        talk.reconnect(9);
        Self { talk }
    }

    pub fn ready() -> Self {
        let mut robot = Self::connected();
        assert_eq!(robot.talk.pose().referenced, ALL, "servos know their angles");
        assert_eq!(robot.talk.arm(), Status::Accepted);
        robot.talk.wait_for(ControllerState::Ready);
        robot
    }

    pub fn at(place: [i32; 5]) -> Self {
        let mut robot = Self::ready();
        robot.goes(place);
        robot
    }

    pub fn goes(&mut self, place: [i32; 5]) -> u64 {
        assert_eq!(self.talk.move_to(place, 1), Status::Accepted);
        let time = self.talk.wait_for(ControllerState::Ready);
        assert_eq!(self.talk.pose().phase, MovePhase::Settled, "{:?}", self.talk.pose());
        time
    }

    pub fn begins(&mut self, place: [i32; 5]) {
        assert_eq!(self.talk.move_to(place, 3), Status::Accepted);
    }

    pub fn with_servo<R>(&mut self, number: u8, act: impl FnOnce(&mut Servo) -> R) -> R {
        self.talk.board.machine.chip_mut().with_world(|bench, _| {
            let servos = bench.plant_mut().joints_mut().servos_mut();
            act(servos.servo_mut(id(number)).expect("a servo"))
        })
    }

    pub fn servos(&self) -> &[Servo] {
        self.talk.board.machine.chip().world().plant().joints().servos().servos()
    }

    /// Angles of the outputs in degrees.
    pub fn outputs(&self) -> [f64; 5] {
        std::array::from_fn(|joint| self.servos()[joint].motor().output().to_degrees())
    }

    pub fn torques(&self) -> [bool; 5] {
        std::array::from_fn(|joint| self.servos()[joint].has_torque())
    }

    pub fn servo_time(&self) -> Nanoseconds {
        Nanoseconds(self.talk.board.machine.time().0 / 1_000)
    }

    pub fn driver(&mut self, axis: u8) -> DriverState {
        match self.talk.answer(Request::GetDriver { axis }) {
            Report::Driver { state, .. } => state,
            other => panic!("{other:?}"),
        }
    }

    /// What the board has said on the bus since the last call.
    pub fn said(&mut self) -> Vec<SentByte> {
        self.talk.board.machine.chip_mut().take_sent(UartId::USART3)
    }

    /// Begins a move and lets this happen in the midst of it; the fault that follows. All but `lost` hold.
    pub fn disturbed(mut self, lost: u8, happen: impl FnOnce(&mut Self)) -> (Self, FaultCode) {
        self.begins(stick_bug());
        self.talk.wait(300_000);
        happen(&mut self);
        let began = self.talk.now.0;
        self.talk.wait_for(ControllerState::Fault);
        let code = self.talk.fault().code;
        println!("{code:?} after {} ms", (self.talk.now.0 - began) / 1_000);
        self.talk.wait(500_000);
        let before = self.outputs();
        self.talk.wait(500_000);
        for (joint, number) in IDS.into_iter().enumerate().filter(|(_, number)| *number != lost) {
            assert!(self.torques()[joint], "{number} has let go");
            assert!((self.outputs()[joint] - before[joint]).abs() < 0.2, "{number} moves");
        }
        let joint = usize::from(lost - IDS[0]);
        assert_eq!(self.talk.fault().axis, Some(joint as u8), "{:?}", self.talk.fault());
        (self, code)
    }
}
