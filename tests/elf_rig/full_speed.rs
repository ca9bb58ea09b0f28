//! Both axes at 100 000 steps a second, the most that settings may ask for, with poses at 1 kHz.

use vergence_control::Scale;
use vergence_plant::bench_settings;
use vergence_protocol::{AxisKind, Request, SettingItem, SettingKey, Status};

use super::board::{ElfBoard, Standing};
use super::conversation::Conversation;

/// Steps for each metre and each turn: 100 kHz at the 80 mm/s and 60 degrees/s of the bench.
const STEPS_PER_UNIT: [u32; 2] = [1_250_000, 599_999];
pub const POSE_PERIOD_US: u32 = 1_000;
/// What both axes do in the same time, each at its full speed on the way: 60 degrees take their second and longer ramps.
const FAR: [f64; 2] = [84_000.0, 1_047_198.0];

/// Disarmed, with poses at 1 kHz, and motors that make 100 000 steps a second at full speed.
pub fn geared() -> Conversation<ElfBoard> {
    let mut standing = Standing::default();
    for ((mechanics, kind), per_unit) in
        standing.mechanics.iter_mut().zip([AxisKind::Linear, AxisKind::Rotary]).zip(STEPS_PER_UNIT)
    {
        mechanics.motor = Scale { kind, per_unit };
    }
    let mut talk = Conversation::open(&standing);
    for (axis, steps) in (0..).zip(STEPS_PER_UNIT) {
        let key = SettingKey { item: SettingItem::StepsPerUnit, axis };
        assert_eq!(talk.ask(Request::SetSetting { key, value: steps.into() }), Status::Accepted);
    }
    assert_eq!(talk.ask(Request::SetStream { period_us: POSE_PERIOD_US }), Status::Accepted);
    talk
}

/// Both axes in the middle of a move, at 100 kHz each, with poses at 1 kHz.
pub fn at_full_speed() -> Conversation<ElfBoard> {
    let mut talk = geared();
    talk.arm_and_home();
    cruise(&mut talk);
    talk
}

/// Goes on until both axes make 100 000 steps a second.
pub fn cruise(talk: &mut Conversation<ElfBoard>) {
    let targets = far_from(talk.loads());
    assert_eq!(talk.move_to(targets, 1), Status::Accepted);
    talk.wait(400_000);
}

/// Targets that are reached from `loads`, in micro-units, by way of full speed.
pub fn far_from(loads: [f64; 2]) -> [i32; 2] {
    let settings = bench_settings();
    [0, 1].map(|axis| {
        let middle = f64::from(settings[axis].min.0 + settings[axis].max.0) / 2.0;
        let far = (loads[axis] + if loads[axis] < middle { FAR[axis] } else { -FAR[axis] }) as i32;
        far.clamp(settings[axis].min.0, settings[axis].max.0)
    })
}
