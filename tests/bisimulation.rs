//! The native board and the firmware on the simulated chip do the same when told the same.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;

use elf_rig::{Board, Conversation, ElfBoard, LEASE_MS, Standing};
use vergence_control::TICK_US;
use vergence_plant::NativeBoard;
use vergence_protocol::{ControllerState, Counts, FaultCode, Microseconds, MovePhase, Request, Status, StopKind};

const HERBIVORE: [i32; 2] = [145_000, 2_094_395];
const HUMAN: [i32; 2] = [145_000, 0];

/// What a board did.
#[derive(Debug, Default)]
struct Done {
    states: Vec<ControllerState>,
    phases: Vec<MovePhase>,
    faults: Vec<FaultCode>,
    /// At rest after each command.
    counts: Vec<Vec<Counts>>,
    /// Of the first move: each sample at which the steps had changed.
    steps: Vec<(Microseconds, [i32; 2])>,
}

/// Home, there and back, a stop on the way, a host that dies, a stage that is blocked.
fn script<B: Board>() -> Done {
    let mut talk = Conversation::<B>::homed(&Standing::default());
    let mut done = Done::default();
    let rest = |talk: &mut Conversation<B>, done: &mut Done| {
        talk.wait(50_000);
        done.counts.push(talk.pose().counts.to_vec());
    };
    rest(&mut talk, &mut done);

    talk.watched_steps = Some(Vec::new());
    assert_eq!(talk.move_to(HERBIVORE, 1), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    done.steps = talk.watched_steps.take().expect("they were watched");
    rest(&mut talk, &mut done);

    assert_eq!(talk.move_to(HUMAN, 2), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    rest(&mut talk, &mut done);

    assert_eq!(talk.move_to(HERBIVORE, 1), Status::Accepted);
    talk.wait(600_000);
    assert_eq!(talk.ask(Request::Stop { kind: StopKind::Decelerate }), Status::Accepted);
    talk.wait_for(ControllerState::Ready);

    assert_eq!(talk.move_to(HUMAN, 2), Status::Accepted);
    talk.wait(300_000);
    talk.alive = false;
    talk.wait(u64::from(LEASE_MS) * 1_000 + 500_000);
    talk.reconnect(0x0a11_7e00);
    assert_eq!(talk.clear(), Status::Accepted);
    assert_eq!(talk.arm(), Status::Accepted);
    assert_eq!(talk.move_to(HUMAN, 2), Status::Accepted);
    talk.wait_for(ControllerState::Ready);
    rest(&mut talk, &mut done);

    assert_eq!(talk.move_to(HERBIVORE, 1), Status::Accepted);
    talk.wait(700_000);
    talk.board.with_plant(|plant| plant.block(1, true));
    talk.wait_for(ControllerState::Fault);
    // The native board is there at once, so that its self-test is seen.
    done.states = talk.states.into_iter().skip_while(|state| *state == ControllerState::SelfTest).collect();
    done.phases = talk.phases.iter().map(|(_, phase)| *phase).collect();
    done.faults = talk.faults.iter().map(|fault| fault.code).collect();
    done
}

/// When each step of an axis was made, from the first one on: microseconds, by the number of the step.
fn step_times(steps: &[(Microseconds, [i32; 2])], axis: usize) -> Vec<(i32, u64)> {
    let before = steps[0].1[axis];
    let moved: Vec<_> = steps.iter().filter(|(_, made)| made[axis] != before).collect();
    moved.iter().map(|(at, made)| ((made[axis] - before).abs(), at.0 - moved[0].0.0)).collect()
}

/// When so many steps had been made, by the samples around that number.
fn time_of(steps: &[(i32, u64)], number: i32) -> f64 {
    let after = steps.partition_point(|(made, _)| *made < number).min(steps.len() - 1);
    let [(n0, t0), (n1, t1)] = [steps[after.saturating_sub(1)], steps[after]].map(|(n, t)| (f64::from(n), t as f64));
    if n1 > n0 { t0 + (t1 - t0) * (f64::from(number) - n0) / (n1 - n0) } else { t1 }
}

#[test]
fn the_same_commands_give_the_same_states_counts_and_steps() {
    let (native, chip) = (script::<NativeBoard>(), script::<ElfBoard>());
    println!("states {:?}", chip.states);
    println!("counts {:?}\n       {:?}", native.counts, chip.counts);
    assert_eq!(native.states, chip.states);
    assert_eq!(native.phases, chip.phases);
    assert_eq!(native.faults, chip.faults);
    // The home switch is seen at a tick, and the two boards' ticks are not at the same instants: one tick at 2 mm/s and
    // 2 degrees a second, and one count.
    for (axis, allowed) in [(0, 4 + 1), (1, 1 + 1)] {
        for (native, chip) in native.counts.iter().zip(&chip.counts) {
            let apart = (native[axis].0 - chip[axis].0).abs();
            assert!(apart <= allowed, "axis {axis}: {native:?}, {chip:?}");
        }
        let [ours, theirs] = [&native, &chip].map(|done| step_times(&done.steps, axis));
        let total = ours.last().expect("it moved").0.min(theirs.last().expect("it moved").0);
        let late = (1..total).map(|step| (time_of(&ours, step) - time_of(&theirs, step)).abs()).fold(0.0, f64::max);
        println!("axis {axis}: {total} steps, {late:.0} us apart at most");
        assert!(total > 10_000 && late < TICK_US as f64, "axis {axis}: {late} us");
    }
}
