//! New targets in mid-move: the firmware on the simulated chip takes them at any phase of a move without a fault, its
//! acceleration does not jump where a new plan takes over, and it comes to rest where the native board does.
//!
//! `VERGENCE_RETARGETS=1000` tries that many.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;

use elf_rig::{Board, Continuity, Conversation, ElfBoard, Standing};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_plant::{NativeBoard, StepMade, bench_settings};
use vergence_protocol::{ControllerState, Counts, Microseconds, MovePhase, Request, SettingItem, SettingKey, Status};

const SEED: u64 = 20;
/// Retargets in the normal run.
const RETARGETS: usize = 60;
/// New targets in a row before the board is left to settle.
const IN_A_ROW: usize = 5;
/// Longest time from one target to the next, in microseconds: most moves are over by then, and settle.
const LONGEST_US: u64 = 1_500_000;
/// The last approach from below of each axis, in micro-units.
const BACKLASH: [i32; 2] = [400, 10_000];
/// Largest difference of the steps made in two milliseconds, one after the other: the largest acceleration makes a third of a
/// step, two samples of whole steps may be off by two, and a tick's list may be 20 us late.
const JUMP_STEPS: i32 = 5;

/// One new target, and how long the board is left to it in microseconds.
#[derive(Clone, Copy, Debug)]
struct Order {
    targets: [i32; 2],
    wait_us: u64,
}

/// Rows of random targets: most anywhere in the range, some close to the one before, so that the axes pass it in the run-up
/// from below.
fn rows(retargets: usize) -> Vec<Vec<Order>> {
    let mut random = Pcg64Mcg::seed_from_u64(SEED);
    let settings = bench_settings();
    let mut at = [145_000, 0];
    let mut order = || {
        let is_near = random.random_range(0..4) == 0;
        for (axis, place) in settings.iter().zip(&mut at) {
            let wide = if is_near { 3_000 } else { axis.max.0 - axis.min.0 };
            *place = (*place + random.random_range(-wide..=wide)).clamp(axis.min.0, axis.max.0);
        }
        // Half of them early, while the axes speed up.
        let longest = if random.random_range(0..2) == 0 { 200_000 } else { LONGEST_US };
        Order { targets: at, wait_us: random.random_range(1_000..longest) }
    };
    (0..retargets.div_ceil(IN_A_ROW)).map(|_| (0..=IN_A_ROW).map(|_| order()).collect()).collect()
}

/// The largest jerk of an axis, in steps per second cubed.
fn jerk(axis: usize) -> f64 {
    let settings = bench_settings()[axis];
    f64::from(settings.jerk) / (f64::from(settings.motor().position_at(1_000_000).0) * 1e-6)
}

/// Takes the pulses of a motion from the mechanics, and adds what they show.
fn look<B: Board>(talk: &mut Conversation<B>, shown: &mut [Continuity; 2]) {
    for (axis, shown) in shown.iter_mut().enumerate() {
        let mut made = Vec::new();
        talk.board.with_plant(|plant| made = plant.axis_mut(axis).expect("it is there").take_steps());
        shown.merge(&Continuity::of(&made, jerk(axis)));
    }
}

/// Sends each row of targets, lets the board settle after it, and returns the counts at each rest.
fn rests<B: Board>(rows: &[Vec<Order>]) -> Vec<Vec<Counts>> {
    let mut talk = Conversation::<B>::open(&Standing::default());
    for (axis, backlash) in (0..).zip(BACKLASH) {
        let key = SettingKey { item: SettingItem::Backlash, axis };
        assert_eq!(talk.ask(Request::SetSetting { key, value: backlash.into() }), Status::Accepted);
    }
    talk.arm_and_home();
    talk.board.with_plant(vergence_plant::Plant::record_steps);
    let (mut phases, mut shown) = ([0; 2], [Continuity::default(); 2]);
    let rests = rows.iter().map(|row| {
        for order in row {
            let was_moving = talk.pose().phase == MovePhase::Running;
            phases[usize::from(was_moving)] += 1;
            let steps = talk.steps();
            talk.watched_steps = Some(vec![(talk.now, steps)]);
            assert_eq!(talk.move_to(order.targets, 1), Status::Accepted, "{order:?} {:?}", talk.faults);
            talk.wait(order.wait_us);
            assert!(talk.faults.is_empty(), "{order:?}: {:?}", talk.faults);
            let steps = talk.watched_steps.take().expect("they were watched");
            assert!(largest_jump(&steps) <= JUMP_STEPS, "{order:?}: {} steps", largest_jump(&steps));
        }
        talk.wait_for(ControllerState::Ready);
        talk.wait(50_000);
        assert_eq!(talk.pose().phase, MovePhase::Settled);
        look(&mut talk, &mut shown);
        talk.pose().counts.to_vec()
    });
    let rests = rests.collect();
    for (axis, shown) in shown.iter().enumerate() {
        println!("axis {axis}: {shown:.3?} of a jerk of {:.0}", jerk(axis));
        assert!(shown.windows > 500 * rows.len() && shown.worst <= 1.0, "axis {axis}: {shown:?}");
    }
    println!("{} targets at rest or while settling, {} in mid-move", phases[0], phases[1]);
    rests
}

/// The pulses of an axis that speeds up with `acceleration` at `speed`, and with less by `jump` after half of a fifth of a second;
/// pulses of each millisecond are late by up to 1.5 us.
fn pulses(speed: f64, acceleration: f64, jump: f64) -> Vec<StepMade> {
    const HALF_S: f64 = 0.1;
    let mut random = Pcg64Mcg::seed_from_u64(SEED);
    let late: Vec<f64> = (0..201).map(|_| random.random_range(0.0..1.5e-6)).collect();
    let place = |at: f64| {
        let after = (at - HALF_S).max(0.0);
        speed * at + acceleration * at * at / 2.0 - jump * after * after / 2.0
    };
    let mut made = Vec::new();
    let mut at = 0.0;
    for step in 1.. {
        // Newton's method: the speed hardly changes from step to step.
        for _ in 0..20 {
            at += (f64::from(step) - place(at)) / (speed + acceleration * at);
        }
        if at >= 2.0 * HALF_S {
            return made;
        }
        made.push(StepMade { at_ns: ((at + late[(at * 1e3) as usize]) * 1e9) as u64, forward: true });
    }
    made
}

/// A plan that begins without the acceleration of the one before would be noticed: at full speed from 0.4 of the largest one,
/// at a tenth of it from a quarter.
#[test]
fn a_jump_of_the_acceleration_shows_in_the_pulses() {
    for axis in 0..2 {
        let settings = bench_settings()[axis];
        let step = f64::from(settings.motor().position_at(1_000_000).0) * 1e-6;
        let [most, fastest] = [settings.acceleration, settings.speed].map(|rate| f64::from(rate) / step);
        for (speed, share) in [(0.8, 0.4), (0.1, 0.25)] {
            let smooth = Continuity::of(&pulses(speed * fastest, most / 2.0, 0.0), jerk(axis));
            let jumps = Continuity::of(&pulses(speed * fastest, most / 2.0, share * most), jerk(axis));
            println!("axis {axis}, speed {speed}: {smooth:.3?}, with a jump {jumps:.3?}");
            assert!(smooth.windows > 100 && smooth.worst < 0.5 && jumps.worst > 1.0, "{smooth:?} {jumps:?}");
        }
    }
}

/// The largest difference of the steps that an axis made in two milliseconds, one after the other.
fn largest_jump(samples: &[(Microseconds, [i32; 2])]) -> i32 {
    let (begin, end) = (samples[0].0.0, samples[samples.len() - 1].0.0);
    let at = |us: u64| samples[samples.partition_point(|(at, _)| at.0 <= us).max(1) - 1].1;
    let jump = |us: u64, axis: usize| {
        let [before, now, after] = [us - 1_000, us, us + 1_000].map(|us| at(us)[axis]);
        ((after - now) - (now - before)).abs()
    };
    let instants = (begin + 1_000..end.saturating_sub(1_000)).step_by(1_000);
    instants.map(|us| jump(us, 0).max(jump(us, 1))).max().unwrap_or(0)
}

#[test]
fn new_targets_at_any_phase_of_a_move_end_where_they_do_on_the_native_board() {
    let retargets = std::env::var("VERGENCE_RETARGETS").ok().and_then(|text| text.parse().ok()).unwrap_or(RETARGETS);
    let rows = rows(retargets);
    let (native, chip) = (rests::<NativeBoard>(&rows), rests::<ElfBoard>(&rows));
    let apart = |axis: usize| {
        let pairs = native.iter().zip(&chip);
        pairs.map(|(native, chip)| (native[axis].0 - chip[axis].0).abs()).max().expect("it came to rest")
    };
    println!("{retargets} retargets, {} rests, {:?} counts apart at most", rows.len(), [0, 1].map(apart));
    // As in the bisimulation: the home switch is seen at a tick.
    assert!(apart(0) <= 5 && apart(1) <= 2);
}
