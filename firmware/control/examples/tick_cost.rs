//! Control ticks to be counted by an instrument that counts instructions; `docs/measured/control-tick.md` names the command.
//!
//! Arguments: number of axes, largest step rate of each in steps a second (0 to stay at rest).

use std::hint::black_box;
use std::process::ExitCode;

use vergence_control::{
    AxisSettings, Controller, DriverSettings, EncoderSettings, FINE_BITS, HomingSettings, Limits, MotionState,
    MovePlanner, PlanRequest, RigIo, StepSchedule, SwitchSettings, Trajectory,
};
use vergence_protocol::{AxisKind, ControllerState, Jog, Micro, Microseconds, MoveId, Permille, Request, SessionId};

const HOST: SessionId = SessionId(1);
const TICKS: u64 = 1_000;

/// Motors whose encoders count their steps.
struct Rig(Vec<i32>);

impl RigIo for Rig {
    fn set_drivers(&mut self, _: bool) {}

    fn schedule_steps(&mut self, axis: usize, steps: &StepSchedule) {
        let count = steps.at_ns.len() as i32;
        if let Some(at) = self.0.get_mut(axis) {
            *at += if steps.forward { count } else { -count };
        }
    }

    fn steps(&self, axis: usize) -> i32 {
        self.encoder(axis)
    }

    fn encoder(&self, axis: usize) -> i32 {
        self.0.get(axis).copied().unwrap_or(0)
    }

    fn home_switch(&self, _: usize) -> bool {
        false
    }

    fn hard_limit(&self, _: usize) -> bool {
        false
    }

    fn emergency_stop(&self) -> bool {
        false
    }
}

/// 10 mm/s; the scale makes the step rate.
fn axis(step_rate: u32) -> AxisSettings {
    AxisSettings {
        kind: AxisKind::Linear,
        min: Micro(0),
        max: Micro(1_000_000),
        speed: 10_000,
        acceleration: 1_000_000,
        jerk: 100_000_000,
        steps_per_unit: step_rate.max(1) * 100,
        counts_per_unit: step_rate.max(1) * 100,
        steps_reversed: false,
        counts_reversed: false,
        following_error: Micro(1_000),
        tolerance: Micro(20),
        backlash: Micro(0),
        correction: Micro(0),
        homing: HomingSettings {
            switch_at: Micro(-1_000),
            seek_speed: 10_000,
            approach_speed: 1_000,
            retract: Micro(1_000),
            travel: Micro(1_000_000),
            repeatability: Micro(100),
        },
        driver: DriverSettings::default(),
        switches: SwitchSettings::default(),
        feedback: EncoderSettings::default(),
    }
}

/// What is counted.
#[inline(never)]
fn tick(controller: &mut Controller, now: u64, rig: &mut Rig) {
    let next = controller.poll(Microseconds(now), rig);
    black_box(next);
}

/// What is counted, too: the plan of all axes from rest.
#[inline(never)]
fn plan(request: PlanRequest) -> MovePlanner {
    black_box(MovePlanner::planned(request))
}

/// What is counted, too: the plan of one axis for another target in mid-move.
#[inline(never)]
fn turn(limits: Limits) {
    let velocity = 7_000 << FINE_BITS;
    let from = MotionState { position: 0, velocity, acceleration: -(300_000 << FINE_BITS) };
    black_box(Trajectory::reach(black_box(from), -(50_000 << FINE_BITS), limits, black_box(10.0)));
}

fn main() -> ExitCode {
    let mut numbers = std::env::args().skip(1).map(|text| text.parse::<u32>().unwrap_or(0));
    let (axes, step_rate) = (numbers.next().unwrap_or(2) as usize, numbers.next().unwrap_or(0));
    let settings = vec![axis(step_rate); axes];
    let Ok(mut controller) = Controller::new(&settings) else { return ExitCode::FAILURE };
    turn(axis(step_rate).limits());
    let mut rig = Rig(vec![0; axes]);
    let mut now = 0;
    while controller.state() != ControllerState::Idle {
        now = controller.poll(Microseconds(now), &mut rig).0;
    }
    controller.heartbeat(Microseconds(now), HOST, 1_000);
    controller.handle(Microseconds(now), HOST, &Request::Arm { session: HOST }, &mut rig);
    let way = (0..axes).map(|_| Micro(500_000)).collect();
    let jog = Request::Jog(Jog { id: MoveId(1), by: way, speed: Permille::FULL });
    if step_rate > 0 {
        controller.handle(Microseconds(now), HOST, &jog, &mut rig);
    }
    let planned = controller.take_plan_request().map(plan);
    // Up to full speed uncounted.
    for _ in 0..200 {
        now = controller.poll(Microseconds(now), &mut rig).0;
        if let Some(planned) = &planned {
            controller.give_plan(planned);
        }
    }
    for _ in 0..TICKS {
        controller.heartbeat(Microseconds(now), HOST, 1_000);
        tick(&mut controller, now, &mut rig);
        now += 1_000;
    }
    let busy = controller.state() == if step_rate > 0 { ControllerState::Moving } else { ControllerState::Ready };
    if busy { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
