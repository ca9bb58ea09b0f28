//! The reasons that the host gives for a refused setting, against the controller's rules.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a test fails loudly")]

use vergence_board::{NamedSetting, settings, why_refused};
use vergence_control::BoardSettings;
use vergence_plant::bench_settings;
use vergence_rig::{BENCH_TOML, Rig};

/// The reason why the bench refuses `name` = `text`.
fn reason(name: &str, text: &str) -> Option<String> {
    let rig = Rig::from_toml(BENCH_TOML).unwrap();
    let board = BoardSettings::new(&bench_settings()).unwrap();
    let all = settings(&rig);
    let present: Vec<(NamedSetting, i64)> =
        all.into_iter().filter_map(|setting| Some((setting.clone(), board.get(setting.key)?))).collect();
    let (setting, _) = present.iter().find(|(setting, _)| setting.name() == name).expect("a setting of the bench");
    let change = (setting.key, setting.read(text).unwrap());
    why_refused(&rig, &present, [change])
}

#[test]
fn a_reason_gives_the_bounds_in_the_settings_own_unit() {
    let given = |name, text| reason(name, text).expect("refused");
    assert_eq!(
        given("baseline.tolerance", "5mm"),
        "baseline.tolerance must lie between 0.001mm and 0.8mm: below, encoder and motor cannot reach it; above, a \
         move would count as settled where it is not"
    );
    assert!(given("separation.following_error", "45deg").starts_with("separation.following_error must lie between"));
    assert!(given("separation.following_error", "45deg").contains("deg"));
    assert!(given("baseline.acceleration", "30mm/s2").contains("2670 ms"));
    assert!(given("baseline.speed", "5m/s").contains("100000 steps a second"));
    assert!(given("baseline.min", "230mm").contains("baseline.min must lie below baseline.max"));
    assert!(given("baseline.speed", "0mm/s").contains("must be positive"));
    assert_eq!(
        given("baseline.run_current", "3000mA"),
        "baseline.run_current must lie between 245mA and 1767mA: the driver cannot regulate another current by its \
         sense resistors"
    );
    assert!(given("separation.hold_current", "900mA").contains("800mA"));
    assert!(given("baseline.microsteps", "12").contains("baseline.microsteps must be a power of two"));
    assert!(given("baud", "300").contains("serial line"));
}

#[test]
fn what_the_controller_accepts_has_no_reason() {
    for (name, text) in [("baseline.speed", "10mm/s"), ("separation.tolerance", "0.1deg"), ("stream_period", "0s")] {
        assert_eq!(reason(name, text), None, "{name} = {text}");
    }
}
