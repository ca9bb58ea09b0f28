//! Hundreds of scenarios: no promise is broken, and the same seeds give the same result.
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

use std::sync::atomic::{AtomicU64, Ordering};

use vergence_plant::EncoderFault;
use vergence_soak::{Ending, Fault, FaultKind, Onset, Outcome, Scenario, native_board, run, soak};

fn play(seed: u64) -> Outcome {
    let scenario = Scenario::of(seed);
    run(&scenario, &mut native_board(&scenario).unwrap())
}

#[test]
fn three_hundred_scenarios_break_no_promise() {
    let played = AtomicU64::new(0);
    let tally = soak(1, 300, native_board, || {
        played.fetch_add(1, Ordering::Relaxed);
    })
    .unwrap();
    assert!(tally.violations.is_empty(), "{:?}", tally.violations);
    assert_eq!(played.into_inner(), 300);
    assert_eq!(tally.by_kind.iter().map(|row| row.scenarios).sum::<u64>(), 300);
    for row in &tally.by_kind {
        assert_eq!(row.safe_stops + row.completed, row.scenarios, "{row:?}");
        assert!(row.scenarios > 0, "{row:?}");
    }
}

#[test]
fn hosts_jog_and_change_their_minds_in_mid_move() {
    let logs: String = (1..=60).map(|seed| play(seed).journal.to_string()).collect();
    for part in ["host: Jog(", "next is Retarget(", "next is Jog("] {
        assert!(logs.matches(part).count() > 5, "{part}");
    }
}

/// A fault that leaves mechanics and encoders intact must not keep a host from completing its script.
#[test]
fn faults_of_line_and_host_delay_but_do_not_defeat() {
    let tally = soak(1_000, 200, native_board, || {}).unwrap();
    let harmless = [
        FaultKind::None,
        FaultKind::ByteErrors,
        FaultKind::Drops,
        FaultKind::Duplicates,
        FaultKind::Stall,
        FaultKind::Disconnect,
        FaultKind::Reset,
        FaultKind::SwitchBounce,
        FaultKind::EmergencyStop,
        FaultKind::ClockJump,
    ];
    for row in tally.by_kind.iter().filter(|row| harmless.contains(&row.kind)) {
        assert_eq!(row.completed, row.scenarios, "{row:?}");
    }
}

#[test]
fn the_same_seed_gives_the_same_log() {
    for seed in 1..=20 {
        assert_eq!(play(seed), play(seed));
    }
    assert_ne!(play(1).journal, play(2).journal);
}

#[test]
fn the_order_of_the_cores_does_not_matter() {
    let all = soak(1, 40, native_board, || {}).unwrap();
    let seconds: f64 = (1..=40).map(|seed| play(seed).virtual_time.0 as f64 * 1e-6).sum();
    assert!((all.virtual_seconds - seconds).abs() < 1e-6);
}

/// Regression: two spikes on the home switch passed for its edges; the mode was reported four centimetres away.
#[test]
fn spikes_on_the_home_switch_do_not_pass_for_its_edges() {
    for seed in 1..=60 {
        let scenario = Scenario::of_kind(seed, FaultKind::SwitchBounce);
        let outcome = run(&scenario, &mut native_board(&scenario).unwrap());
        assert!(outcome.violations.is_empty(), "{}", outcome.journal);
        assert_eq!(outcome.ending, Ending::Completed);
    }
}

/// Regression: an encoder that died at a restart failed the self-test before the first pose; the checker took that for
/// a memory of what was before.
#[test]
fn a_self_test_that_fails_after_a_restart_is_no_memory() {
    let onset = Onset { step: 2, after_us: 300_000 };
    let how = EncoderFault::Noisy { amplitude: 1_000, seed: 1 };
    let faults = vec![
        Fault::Encoder { onset, axis: 0, how, lasts_us: Some(900_000) },
        Fault::Disconnect(onset, 400_000),
        Fault::Reset(onset),
    ];
    let scenario = Scenario { faults, ..Scenario::of_kind(1, FaultKind::Several) };
    let outcome = run(&scenario, &mut native_board(&scenario).unwrap());
    assert!(outcome.violations.is_empty(), "{}", outcome.journal);
    assert_eq!(outcome.journal.to_string().matches("board: self-test").count(), 2, "{}", outcome.journal);
}

#[test]
fn hosts_run_errands_too() {
    let logs: String = (1..=60).map(|seed| play(seed).journal.to_string()).collect();
    for part in
        ["host: SetTrigger(Every", "host: SetSetting {", "host: SaveSettings", "host: Begin(", "board: taking firmware"]
    {
        assert!(logs.contains(part), "{part}");
    }
}

#[test]
fn a_replay_tells_the_whole_story() {
    let seed = (1..).find(|&seed| Scenario::of(seed).kind == FaultKind::Reset).unwrap();
    let text = play(seed).journal.to_string();
    for part in [
        &format!("seed {seed}, reset: [Reset("),
        "host: Arm { session: SessionId(",
        "host: Home { axes: AxisMask(3) }",
        "board: homing, loads [",
        "fault: Reset(Onset { step: ",
        "host: the session is lost, boot ",
        "host: all done",
        "Completed",
    ] {
        assert!(text.contains(part), "'{part}' is missing in:\n{text}");
    }
    assert!(text.lines().all(|line| line.contains(" s  ")));
}
