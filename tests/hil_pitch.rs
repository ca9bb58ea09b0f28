//! A screw whose pitch is off and play that nobody knows: moves settle by short corrections, and the pose of the cameras is as
//! certain as the rig file lets the host say. On the firmware and on the native board.
//!
//! `VERGENCE_POSES=200` goes to that many.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;

use elf_rig::{Board, Conversation, ElfBoard, Standing};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_plant::{NativeBoard, PitchError, bench_mechanics, bench_settings};
use vergence_protocol::{AxisKind, ControllerState, FaultCode, MovePhase, Request, SettingItem, SettingKey, Status};
use vergence_rig::{AxisPosition, JointsAt, Rig, RigCalibration};

/// Poses in the normal run.
const POSES: usize = 5;
/// Largest correction of each axis, in micro-units.
const CORRECTION: [i64; 2] = [200, 2_000];
/// Play between encoder and stage, in micro-units.
const PLAY: [f64; 2] = [20.0, 400.0];
/// Two-sided 95 % of a normal distribution.
const NORMAL_95: f64 = 1.96;

/// The screw leads 50 um too far in 160 mm and wobbles by 5 um in each turn of 2 mm, with play of 20 um that no setting states;
/// the pinion wobbles by 0.03 degrees in each of its 64 teeth.
fn worn() -> Standing {
    let mut mechanics = bench_mechanics();
    mechanics[0].pitch = PitchError { lead: 50.0 / 160_000.0, wobble: 5.0, period: 2_000.0 };
    mechanics[0].backlash = 20.0;
    mechanics[1].pitch = PitchError { lead: 0.0, wobble: 500.0, period: std::f64::consts::TAU * 1e6 / 64.0 };
    for (axis, play) in mechanics.iter_mut().zip(PLAY) {
        axis.encoder_play = play;
    }
    Standing { mechanics, ..Standing::default() }
}

/// The bench's rig file, with this play in micrometres and microradians, and a calibration without error.
fn rig(play: [f64; 2]) -> Rig {
    let [slides, turns] = play.map(|play| play * 1e-3);
    let text = include_str!("../host/rig/src/bench.toml")
        .replacen("counts_per_metre", &format!("play = \"{slides}mm\"\ncounts_per_metre"), 1)
        .replacen("counts_per_revolution", &format!("play = \"{turns}mrad\"\ncounts_per_revolution"), 1);
    Rig { calibration: RigCalibration::exact(), ..Rig::from_toml(&text).expect("a rig file") }
}

/// Share of the poses in which the stated sigmas cover the truth, in translation and rotation.
fn covered(rig: &Rig, poses: &[Pose]) -> [f64; 2] {
    let mut covered = [0.0; 2];
    for pose in poses {
        let stated = rig.pose(&JointsAt::latched(&pose.counts));
        let truth = rig.pose_at_values(&pose.truth).left_from_right;
        let off = stated.left_from_right.inverse() * truth;
        let errors = [off.origin().mm().norm(), off.rotation().angle()];
        let sigmas = [stated.translation_sigma.mm(), stated.rotation_sigma.rad()];
        for ((covered, error), sigma) in covered.iter_mut().zip(errors).zip(sigmas) {
            *covered += f64::from(u8::from(error <= NORMAL_95 * sigma)) / poses.len() as f64;
        }
    }
    covered
}

/// Where a move came to rest.
struct Pose {
    counts: Vec<vergence_protocol::Counts>,
    /// The true position of each stage in millimetres and radians.
    truth: Vec<f64>,
}

fn prepared<B: Board>(correction: [i64; 2]) -> Conversation<B> {
    let mut talk = Conversation::<B>::open(&worn());
    for (axis, value) in (0..).zip(correction) {
        let key = SettingKey { item: SettingItem::Correction, axis };
        assert_eq!(talk.ask(Request::SetSetting { key, value }), Status::Accepted);
    }
    talk.arm_and_home();
    talk
}

fn poses<B: Board>(count: usize) -> Vec<Pose> {
    let mut talk = prepared::<B>(CORRECTION);
    let mut random = Pcg64Mcg::seed_from_u64(5);
    let settings = bench_settings();
    let poses = (0..count).map(|_| {
        let targets = settings.each_ref().map(|axis| random.random_range(axis.min.0..=axis.max.0));
        assert_eq!(talk.move_to(targets, 1), Status::Accepted);
        talk.wait_for(ControllerState::Ready);
        talk.wait(50_000);
        assert_eq!(talk.pose().phase, MovePhase::Settled, "{targets:?}: {:?}", talk.faults);
        for ((axis, &target), load) in settings.iter().zip(&targets).zip(talk.board.plant().loads()) {
            let off = load - f64::from(target);
            assert!(off.abs() <= 1.25 * f64::from(axis.tolerance.0), "{off} um or urad off");
        }
        let stage = |axis: usize| talk.board.plant().stage(axis).expect("two axes");
        Pose { counts: talk.pose().counts.to_vec(), truth: vec![stage(0) * 1e-3, stage(1) * 1e-6] }
    });
    poses.collect()
}

fn settles_and_knows_how_well<B: Board>(board: &str) {
    let count = std::env::var("VERGENCE_POSES").ok().and_then(|text| text.parse().ok()).unwrap_or(POSES);
    let poses = poses::<B>(count);
    let [honest, blind] = [rig(PLAY), rig([0.0; 2])].map(|rig| covered(&rig, &poses));
    println!(
        "{board}, {count} poses: sigma covers {honest:.3?} of translations and rotations, without play {blind:.3?}"
    );
    assert!(honest.iter().all(|&share| share >= 0.95), "{honest:?}");
    assert!(blind.iter().all(|&share| share < 0.5), "{blind:?}");
}

#[test]
fn the_firmware_settles_on_a_screw_with_pitch_error() {
    settles_and_knows_how_well::<ElfBoard>("firmware");
}

#[test]
fn the_native_board_settles_on_a_screw_with_pitch_error() {
    settles_and_knows_how_well::<NativeBoard>("native board");
}

/// An error of the baseline's scale that grows by 150 um over the range and waves by 40 um, beside play of 20 um.
fn uneven() -> Standing {
    let mut mechanics = bench_mechanics();
    mechanics[0].scale = PitchError { lead: 150.0 / 160_000.0, wobble: 40.0, period: 120_000.0 };
    mechanics[0].encoder_play = PLAY[0];
    Standing { mechanics, ..Standing::default() }
}

/// The bench's rig file with this play of the baseline in micrometres and, where asked for, the table of its errors each 5 mm.
fn uneven_rig(play: f64, has_table: bool) -> Rig {
    let (scale, home) = (uneven().mechanics[0].scale, f64::from(bench_settings()[0].homing.switch_at.0));
    let entry = |millimetres: u32| {
        let load = f64::from(millimetres) * 1e3;
        // Homing sets the encoder to the truth at the switch.
        let further = scale.at(load) - scale.at(home);
        format!("[\"{:.4}mm\", \"{:.4}um\"]", (load + further) * 1e-3, -further)
    };
    let entries = (55..=225).step_by(5).map(entry).collect::<Vec<_>>().join(", ");
    let table = if has_table { format!("pitch_error = [{entries}]\n") } else { String::new() };
    let text = include_str!("../host/rig/src/bench.toml").replacen(
        "counts_per_metre",
        &format!("play = \"{play}um\"\n{table}counts_per_metre"),
        1,
    );
    Rig { calibration: RigCalibration::exact(), ..Rig::from_toml(&text).expect("a rig file") }
}

/// The table makes poses true, and targets too; without it they are as true only where the stated sigma is wider.
fn a_table_corrects_the_scale<B: Board>(board: &str) {
    let [table, blind, wide] =
        [(PLAY[0], true), (PLAY[0], false), (400.0, false)].map(|(play, table)| uneven_rig(play, table));
    let mut talk = Conversation::<B>::open(&uneven());
    // Steps and counts disagree where the scale is off; short moves correct that.
    let key = SettingKey { item: SettingItem::Correction, axis: 0 };
    assert_eq!(talk.ask(Request::SetSetting { key, value: CORRECTION[0] }), Status::Accepted);
    talk.arm_and_home();
    let mut poses = Vec::new();
    for millimetres in [215.0, 90.0, 150.0, 200.0, 120.0, 180.0] {
        let mut targets = table.mode("herbivore").expect("a mode").targets.clone();
        targets[0] = AxisPosition::from_value(AxisKind::Linear, millimetres);
        let wire = table.wire_targets(&targets);
        assert_eq!(talk.move_to([wire[0].0, 100_000], 1), Status::Accepted);
        talk.wait_for(ControllerState::Ready);
        talk.wait(20_000);
        assert_eq!(talk.pose().phase, MovePhase::Settled, "{:?}", talk.faults);
        let stage = |axis: usize| talk.board.plant().stage(axis).expect("two axes");
        let off = stage(0) - millimetres * 1e3;
        assert!(off.abs() < 35.0, "{off} um off: the tolerance, and half of the play");
        poses.push(Pose { counts: talk.pose().counts.to_vec(), truth: vec![stage(0) * 1e-3, stage(1) * 1e-6] });
    }
    let [with, without, widened] = [&table, &blind, &wide].map(|rig| covered(rig, &poses)[0]);
    let sigma = |rig: &Rig| rig.pose(&JointsAt::latched(&poses[0].counts)).translation_sigma.mm() * 1e3;
    let (narrow, broad) = (sigma(&table), sigma(&wide));
    println!(
        "{board}: the stated sigma of {narrow:.0} um covers {with:.2} of the poses with the table, {without:.2} without"
    );
    println!("{board}: without the table {broad:.0} um cover {widened:.2}");
    assert!(with >= 0.95 && without < 0.5 && widened >= 0.95, "{with} {without} {widened}");
    assert!(narrow * 5.0 < broad);
}

#[test]
fn a_table_corrects_the_scale_on_the_firmware() {
    a_table_corrects_the_scale::<ElfBoard>("firmware");
}

#[test]
fn a_table_corrects_the_scale_on_the_native_board() {
    a_table_corrects_the_scale::<NativeBoard>("native board");
}

#[test]
fn without_corrections_a_move_does_not_settle() {
    let mut talk = prepared::<NativeBoard>([0; 2]);
    assert_eq!(talk.move_to([210_000, 0], 1), Status::Accepted);
    talk.wait_for(ControllerState::Fault);
    assert_eq!(talk.faults.first().map(|fault| fault.code), Some(FaultCode::NotSettled));
}
