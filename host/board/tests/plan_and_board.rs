//! The host's plan of a move against the steps that a simulated board makes, over random moves.
#![allow(clippy::expect_used, clippy::unwrap_used, clippy::indexing_slicing, reason = "a test fails loudly")]

use std::convert::Infallible;
use std::future::pending;

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use vergence_board::{
    AxisPlan, Board, BoardError, Client, Continuity, MovePlan, MoveStart, OpenWire, Served, Shared, spawn_in_process,
};
use vergence_control::{RigIo, TICK_US};
use vergence_plant::{NativeBoard, bench_mechanics, bench_settings};
use vergence_protocol::{AxisKind, Microseconds, Mode, SessionId};
use vergence_rig::{AxisPosition, BENCH_TOML, Rig};

/// Steps by which the plan may be off: half a step of rounding in either, 0.6 between the encoder's reading and the motor's
/// steps, and 1e-5 of the duration, by which axes may end apart: 1.3 steps in 2 s at 64 000 steps/s.
const CLOSE: f64 = 3.0;
/// Age of the board when the host connects: its self test is over.
const STARTED_US: u64 = 1_000_000;
/// Ticks from the request to the first steps, at most: it waits in a serial line, and steps are ordered a tick ahead.
const LATEST_START: usize = 60;

/// A native board that notes how many steps its motors have made at each control tick.
struct Traced {
    board: NativeBoard,
    output: Vec<u8>,
    steps: Vec<[i32; 2]>,
}

impl Served for Traced {
    type Error = Infallible;

    fn run_until(&mut self, elapsed_us: u64) {
        let until = STARTED_US + elapsed_us;
        while self.board.now().0 < until {
            self.board.advance(Microseconds(until.min(self.board.now().0 + TICK_US)));
            self.output.append(&mut self.board.transmit());
            if self.board.now().0.is_multiple_of(TICK_US) {
                self.steps.push([0, 1].map(|axis| self.board.plant().steps(axis)));
            }
        }
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.board.receive(bytes);
        self.output.append(&mut self.board.transmit());
    }

    fn take_output(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.output)
    }

    fn settle(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// A move to tenths of the ranges, from where the last one ended or after disarming and arming again.
#[derive(Clone, Debug)]
struct Step {
    tenths: [u8; 2],
    arm_again: bool,
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    // Few places, so that many moves leave an axis where it is.
    let step = (prop::array::uniform2(0..=3u8), any::<bool>());
    prop::collection::vec(
        step.prop_map(|(thirds, arm_again)| Step { tenths: thirds.map(|t| 2 + 2 * t), arm_again }),
        1..5,
    )
}

fn target(rig: &Rig, tenths: [u8; 2]) -> Vec<AxisPosition> {
    let place = |(axis, tenths): (&vergence_rig::RigAxis, u8)| {
        let [low, high] = axis.range.map(|end| end.value());
        let value = low + (high - low) * f64::from(tenths) / 10.0;
        // Whole micro-units, as they travel over the wire.
        AxisPosition::from_micro(axis.kind, AxisPosition::from_value(axis.kind, value).micro())
    };
    rig.axes.iter().zip(tenths).map(place).collect()
}

/// Steps from the start of a move until `time`, by the plan.
fn planned_steps(plan: &AxisPlan, kind: AxisKind, steps_per_unit: f64, time: f64) -> f64 {
    let Some(knot) = plan.knots.iter().rev().find(|knot| knot.time <= time).or(plan.knots.first()) else { return 0.0 };
    let t = (time - knot.time).max(0.0);
    let position = knot.position + t * (knot.velocity + t * (knot.acceleration / 2.0 + t * knot.jerk / 6.0));
    let unit = match kind {
        AxisKind::Linear => 1e-3,
        AxisKind::Rotary => 1.0 / std::f64::consts::TAU,
    };
    (position - plan.from.value()) * unit * steps_per_unit
}

/// Largest difference between plan and board, in steps, where the move begins `late` ticks after the trace.
fn difference(rig: &Rig, plan: &MovePlan, trace: &[[i32; 2]], late: usize) -> f64 {
    let settings = bench_settings();
    let mut worst = 0.0f64;
    for (tick, steps) in trace.iter().enumerate() {
        let time = (tick as f64 - late as f64) * 1e-6 * TICK_US as f64;
        for axis in 0..2 {
            let made = f64::from(steps[axis] - trace[0][axis]);
            let per_unit = f64::from(settings[axis].steps_per_unit);
            worst = worst.max((made - planned_steps(&plan.axes[axis], rig.axes[axis].kind, per_unit, time)).abs());
        }
    }
    worst
}

async fn compare(seed: u64, backlash: [i32; 2], moves: Vec<Step>) {
    let rig = Rig::from_toml(BENCH_TOML).expect("the bench");
    let mut settings = bench_settings();
    for (axis, backlash) in settings.iter_mut().zip(backlash) {
        axis.backlash = vergence_protocol::Micro(backlash);
    }
    let mut board = NativeBoard::new(&settings, &bench_mechanics(), seed).expect("a board");
    board.advance(Microseconds(STARTED_US));
    let traced = Shared::new(Traced { board, output: Vec::new(), steps: Vec::new() });
    let wire = OpenWire::in_process(spawn_in_process(traced.clone()));
    let client = Client::connect(wire, SessionId(7), Continuity::begin(None)).await.expect("a session");
    let mut board = Board::new(client, rig.clone(), 100).await.expect("the bench's board");
    let limits = board.limits().await.expect("limits");

    board.armed(pending(), async |board| board.home().await).await.expect("homed");
    let mut moves = moves.into_iter().peekable();
    while moves.peek().is_some() {
        board
            .armed(pending(), async |board| -> Result<(), BoardError> {
                // Armed, the board takes the encoders' word for where the axes are.
                let (mut at, mut from_below) = (board.positions(), false);
                for step in moves.by_ref() {
                    let to = target(&rig, step.tenths);
                    let plan = MovePlan::new(&rig, &limits, MoveStart { positions: &at, from_below }, &to);
                    let begin = traced.lock().steps.len();
                    board.move_to(Mode(0), &to).await?;
                    let trace = traced.lock().steps.split_off(begin);
                    let off = (0..LATEST_START).map(|late| difference(&rig, &plan, &trace, late));
                    let off = off.fold(f64::INFINITY, f64::min);
                    assert!(off < CLOSE, "{step:?} from {at:?}, from below: {from_below}: {off} steps off the plan");
                    traced.lock().steps.clear();
                    (at, from_below) = (to, true);
                    if step.arm_again {
                        break;
                    }
                }
                Ok(())
            })
            .await
            .expect("the moves are carried out");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, rng_seed: RngSeed::Fixed(0x5eed), ..ProptestConfig::default() })]
    #[test]
    fn the_board_executes_what_the_host_planned(
        seed in 1..1_000u64,
        backlash in (prop::sample::select(vec![0, 500]), prop::sample::select(vec![0, 8_000])),
        moves in steps(),
    ) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().start_paused(true).build().unwrap();
        runtime.block_on(compare(seed, [backlash.0, backlash.1], moves));
    }
}
