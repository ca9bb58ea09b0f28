//! Driving the simulated bench from pages: who may, and what stops it.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

mod common;

use common::{Bench, Page};
use serde_json::{Value, json};
use vergence_panel::Access;

fn moves(status: &Value) -> bool {
    status["state"] == "moving"
}

fn rests(status: &Value) -> bool {
    status["state"] == "idle" && status["doing"].is_null()
}

/// The separation in degrees.
fn separation(status: &Value) -> f64 {
    status["values"][1].as_f64().expect("a position")
}

/// The page sends the rig to herbivore and back to human until it is well on its way, from rest in human.
async fn on_the_way(page: &mut Page) {
    page.send(json!({ "do": "mode", "name": "herbivore" })).await;
    page.status(|status| moves(status) && separation(status) > 15.0).await;
}

/// The rig has come to rest between both modes, which nobody asked for but the stop.
async fn stopped_between(page: &mut Page) {
    let at = separation(&page.status(rests).await);
    assert!(at > 15.0 && at < 115.0, "it rests at {at} degrees");
}

async fn to_human(page: &mut Page) {
    page.send(json!({ "do": "mode", "name": "human" })).await;
    let there = page.status(|status| rests(status) && status["mode"] == "human").await;
    assert!(separation(&there).abs() < 0.2, "{there}");
}

#[tokio::test]
async fn one_page_drives_hands_over_and_the_rig_stops_whoever_asks_and_whoever_vanishes() {
    let bench = Bench::start(Access::ThisComputer);
    let mut first = bench.page().await;
    first.send(json!({ "do": "home" })).await;
    assert!(first.next("refused").await["text"].as_str().expect("words").contains("take control"));
    first.take().await;
    first.send(json!({ "do": "mode", "name": "human" })).await;
    first.until(|message| message["kind"] == "log" && message.to_string().contains("reference")).await;
    first.send(json!({ "do": "home" })).await;
    first.status(|status| rests(status) && status["referenced"] == json!([true, true])).await;
    to_human(&mut first).await;

    let mut second = bench.page().await;
    second.send(json!({ "do": "mode", "name": "herbivore" })).await;
    second.next("refused").await;

    // A page that only watches may stop.
    on_the_way(&mut first).await;
    second.send(json!({ "do": "stop" })).await;
    stopped_between(&mut first).await;
    to_human(&mut first).await;

    // An order in mid-move replaces the one under way.
    on_the_way(&mut first).await;
    to_human(&mut first).await;

    // Control is handed over to the page that asked.
    second.send(json!({ "do": "take" })).await;
    let id = second.id;
    first.until(|message| message["kind"] == "control" && message["asking"] == json!([id])).await;
    first.send(json!({ "do": "hand_over" })).await;
    second.until(|message| message["kind"] == "control" && message["driver"] == id).await;
    first.send(json!({ "do": "home" })).await;
    first.next("refused").await;

    // The page that drives is closed in mid-move.
    on_the_way(&mut second).await;
    first.status(|status| moves(status) && separation(status) > 15.0).await;
    drop(second);
    stopped_between(&mut first).await;
    let control = &first.latest["control"];
    assert_eq!((&control["driver"], &control["pages"]), (&Value::Null, &json!(1)));

    // Positions out of range, and modes that are none, are refused by name.
    first.take().await;
    first.send(json!({ "do": "move", "to": [145.0, 500.0] })).await;
    assert!(first.next("refused").await["text"].as_str().expect("words").contains("separation"));
    to_human(&mut first).await;
    first
        .send(json!({ "do": "plan", "forward": true, "sigma_mm": 1.0, "range_mm": 350.0, "half_width_deg": 40.0 }))
        .await;
    let plan = first.next("plan").await;
    assert_eq!((&plan["meets_goal"], plan["values"].as_array().map(Vec::len)), (&json!(true), Some(2)), "{plan}");

    // The page that drives is open and silent while the rig homes, which takes longer: `read` alone sends no heartbeat.
    first.send(json!({ "do": "home" })).await;
    first.status(|status| !rests(status)).await;
    let referenced = loop {
        let message = first.read().await;
        if message["kind"] == "status" && rests(&message) {
            break message["referenced"].clone();
        }
    };
    assert_ne!(referenced, json!([true, true]), "it went on to its end");
    assert!(first.latest["control"]["driver"].is_null(), "{:?}", first.latest["control"]);
}
