//! Where a rig takes orders: who may give one, and that each counts once.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use vergence_panel::{Driver, Panel, Setting};
use vergence_peers::{Answer, Ask, Desk, Secret};
use vergence_rig::{BENCH_TOML, Rig};

fn secret(text: &str) -> Secret {
    Secret::new(Path::new("secret"), text).expect("a secret")
}

/// A desk whose orders wait for a driver that nobody starts.
fn desk() -> (Desk, Driver) {
    let rig = Arc::new(Rig::from_toml(BENCH_TOML).expect("the bench"));
    let (panel, driver) = Panel::new(Setting { rig, simulated: None, has_cameras: false, recorded_ms: None });
    (Desk::new("bench", secret("0123456789abcdef"), panel.remotes()), driver)
}

fn ask(desk: &mut Desk, question: &Ask) -> Answer {
    let answer = desk.answer(&serde_json::to_vec(question).expect("JSON"));
    serde_json::from_slice(&answer).expect("an answer")
}

fn order(desk: &mut Desk, key: &Secret, mode: &str) -> Ask {
    let Answer::Number { number } = ask(desk, &Ask::Number) else { panic!("a number") };
    let tag = key.tag("bench", &number, mode);
    Ask::Mode { mode: mode.to_owned(), number, tag }
}

fn refuses(desk: &mut Desk, question: &Ask, word: &str) {
    match ask(desk, question) {
        Answer::Refused { why } if why.contains(word) => {}
        other => panic!("it should refuse with '{word}': {other:?}"),
    }
}

#[tokio::test(start_paused = true)]
async fn an_order_counts_once_for_a_short_time_and_from_those_who_know_the_secret() {
    let (mut desk, _driver) = desk();
    let known = secret("0123456789abcdef");
    let stranger = order(&mut desk, &secret("0123456789abcdeg"), "human");
    refuses(&mut desk, &stranger, "secret");

    let late = order(&mut desk, &known, "human");
    tokio::time::advance(Duration::from_secs(6)).await;
    refuses(&mut desk, &late, "too old");
    refuses(&mut desk, &late, "used");

    let unknown = order(&mut desk, &known, "owl");
    refuses(&mut desk, &unknown, "no mode 'owl'");

    let first = order(&mut desk, &known, "human");
    assert_eq!(ask(&mut desk, &first), Answer::Moving);
    refuses(&mut desk, &first, "used");
    let second = order(&mut desk, &known, "herbivore");
    refuses(&mut desk, &second, "somebody else drives");
    let Ask::Mode { number, .. } = first else { panic!("an order") };
    assert_eq!(ask(&mut desk, &Ask::Progress { number }), Answer::Moving);
    refuses(&mut desk, &Ask::Progress { number: "00".into() }, "no such order");
}

#[test]
fn what_is_no_question_is_refused() {
    let (mut desk, _driver) = desk();
    for wrong in [&b""[..], b"{}", b"{\"ask\": \"fly\"}", b"\xff", b"[1]"] {
        assert!(String::from_utf8_lossy(&desk.answer(wrong)).contains("refused"));
    }
}

#[test]
fn orders_of_a_rig_that_nothing_drives_are_refused() {
    let (mut desk, driver) = desk();
    drop(driver);
    let order = order(&mut desk, &secret("0123456789abcdef"), "human");
    refuses(&mut desk, &order, "nothing here drives");
}
