//! Control ticks that come late in mid-move: up to 200 us no step is lost, and later is a fault, on the chip as on the native
//! board.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;

use elf_rig::{Board, Conversation, ElfBoard, Standing};
use vergence_plant::NativeBoard;
use vergence_protocol::{ControllerState, FaultCode, MovePhase, Request, Status};

const HERBIVORE: [i32; 2] = [145_000, 2_094_395];
/// Delays without and with a fault, in microseconds. The chip needs some microseconds more to begin a tick.
const HARMLESS: [u64; 4] = [20, 90, 150, 185];
const TOO_LATE: [u64; 4] = [210, 400, 900, 1_500];

/// A board whose next tick can be delayed.
trait Delayed: Board {
    fn delay_next_tick(&mut self, us: u64);
}

impl Delayed for NativeBoard {
    fn delay_next_tick(&mut self, us: u64) {
        self.delay_tick(us);
    }
}

impl Delayed for ElfBoard {
    fn delay_next_tick(&mut self, us: u64) {
        self.delay_tick(us);
    }
}

/// In the middle of a move at full speed.
fn under_way<B: Board>() -> Conversation<B> {
    let mut talk = Conversation::<B>::homed(&Standing::default());
    assert_eq!(talk.move_to(HERBIVORE, 1), Status::Accepted);
    talk.wait(400_000);
    assert_eq!(talk.pose().state, ControllerState::Moving);
    talk
}

/// The motors' steps at the end of a move in which ticks came late.
fn steps_after<B: Delayed>(delays: &[u64]) -> [i32; 2] {
    let mut talk = under_way::<B>();
    for &us in delays {
        talk.board.delay_next_tick(us);
        talk.wait(20_000);
    }
    talk.wait_for(ControllerState::Ready);
    assert_eq!((talk.pose().phase, talk.faults.as_slice()), (MovePhase::Settled, [].as_slice()));
    talk.steps()
}

/// The faults that one late tick leads to.
fn faults_of<B: Delayed>(us: u64) -> Vec<FaultCode> {
    let mut talk = under_way::<B>();
    talk.board.delay_next_tick(us);
    talk.wait(20_000);
    assert!(!talk.board.plant().drivers_on() && talk.pose().referenced.0 == 0, "{us}");
    talk.faults.iter().map(|fault| fault.code).collect()
}

/// How far a pose lies off the line through its neighbours, in counts of the faster axis, where some ticks come late at a
/// constant speed.
fn unevenness<B: Delayed>() -> f64 {
    let mut talk = under_way::<B>();
    assert_eq!(talk.ask(Request::SetStream { period_us: 1_000 }), Status::Accepted);
    let mut poses = Vec::new();
    for _ in 0..40 {
        if poses.len() % 10 == 5 {
            talk.board.delay_next_tick(150);
        }
        talk.wait(1_000);
        let pose = talk.pose();
        poses.push((pose.at.0 as f64, f64::from(pose.counts[0].0)));
    }
    poses.dedup();
    let off = poses.windows(3).map(|near| {
        let [(t0, c0), (t1, c1), (t2, c2)] = [near[0], near[1], near[2]];
        (c0 + (c2 - c0) * (t1 - t0) / (t2 - t0) - c1).abs()
    });
    assert!(poses.len() > 30 && (poses[30].1 - poses[0].1).abs() > 1_000.0, "{poses:?}");
    off.fold(0.0, f64::max)
}

/// Poses of the chip gave the time at which the tick was due, and lay 10 counts off that line.
#[test]
fn a_pose_of_a_late_tick_carries_the_time_at_which_the_encoders_were_read() {
    let worst = [unevenness::<NativeBoard>(), unevenness::<ElfBoard>()];
    println!("off the line: {worst:?} counts");
    assert!(worst.iter().all(|&counts| counts < 5.0), "{worst:?}");
}

#[test]
fn ticks_that_are_a_little_late_lose_no_step() {
    assert_eq!(steps_after::<NativeBoard>(&HARMLESS), steps_after::<NativeBoard>(&[]));
    assert_eq!(steps_after::<ElfBoard>(&HARMLESS), steps_after::<ElfBoard>(&[]));
}

#[test]
fn a_tick_that_is_too_late_is_missed() {
    for us in TOO_LATE {
        assert_eq!(faults_of::<NativeBoard>(us), [FaultCode::TickMissed], "{us}");
        assert_eq!(faults_of::<ElfBoard>(us), [FaultCode::TickMissed], "{us}");
    }
}
