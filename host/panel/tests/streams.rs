//! What pages get over a real socket: the latest of everything, whenever they come and however slow they are; and who is let in.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

mod common;

use std::time::Duration;

use common::{Bench, open, show_cloud};
use serde_json::json;
use tokio::time::Instant;
use tokio_tungstenite::tungstenite::Error;
use vergence_panel::Access;

/// The status of a refused connection.
async fn refusal(bench: &Bench, query: &str, origin: Option<&str>) -> u16 {
    match open(bench.address, query, origin).await.map(drop).map_err(|error| *error) {
        Err(Error::Http(response)) => response.status().as_u16(),
        other => panic!("it should be refused, and was: {other:?}"),
    }
}

#[tokio::test]
async fn a_page_that_comes_late_gets_the_latest_of_every_stream() {
    let bench = Bench::start(Access::ThisComputer);
    for number in 1..=3 {
        show_cloud(&bench.panel, &bench.rig, number);
    }
    bench.panel.warn("a camera is dead");
    // The first page has what is computed only when somebody waits for it.
    let mut first = bench.page().await;
    first.next("sphere").await;
    let mut late = bench.page().await;
    late.until(|message| message["kind"] == "log").await;
    for kind in ["control", "status", "view", "cloud", "sphere", "log"] {
        assert!(late.latest.contains_key(kind), "{kind} is missing: {:?}", late.latest.keys());
    }
    let cloud = &late.latest["cloud"];
    assert_eq!(
        (&cloud["number"], &cloud["count"], &cloud["payload_bytes"]),
        (&json!(3), &json!(1), &json!(16 + 13 * 4))
    );
    assert_eq!(cloud["residual_sigmas"], json!(2.0));
    let lines = late.latest["log"]["lines"].as_array().expect("lines");
    assert!(lines.iter().any(|line| line["level"] == "warning" && line["text"] == "a camera is dead"), "{lines:?}");
}

#[tokio::test]
async fn a_page_that_does_not_read_delays_nobody_and_skips_what_it_missed() {
    const CLOUDS: u64 = 20_000;
    let bench = Bench::start(Access::ThisComputer);
    let mut slow = bench.page().await;
    let mut quick = bench.page().await;
    let begun = Instant::now();
    for number in 1..=CLOUDS {
        show_cloud(&bench.panel, &bench.rig, number);
        if number.is_multiple_of(1000) {
            tokio::task::yield_now().await;
        }
    }
    let shown = begun.elapsed();
    assert!(shown < Duration::from_secs(10), "showing {CLOUDS} clouds took {shown:?}");
    quick.until(|message| message["kind"] == "cloud" && message["number"] == CLOUDS).await;
    let mut got = 0;
    loop {
        let message = slow.read().await;
        got += u64::from(message["kind"] == "cloud");
        if message["kind"] == "cloud" && message["number"] == CLOUDS {
            break;
        }
    }
    assert!(got < CLOUDS, "nothing was skipped");
}

#[tokio::test]
async fn pages_of_other_sites_are_refused() {
    let bench = Bench::start(Access::ThisComputer);
    let own = format!("http://{}", bench.address);
    assert!(open(bench.address, "", Some(&own)).await.is_ok());
    for origin in [None, Some("http://evil.example"), Some("null"), Some("http://127.0.0.1")] {
        assert_eq!(refusal(&bench, "", origin).await, 403, "{origin:?}");
    }
}

#[tokio::test]
async fn on_a_network_a_page_needs_the_token() {
    let bench = Bench::start(Access::Token("5f1e".into()));
    let own = format!("http://{}", bench.address);
    bench.page().await;
    for query in ["", "?token=", "?token=5f1", "?token=5f1e0", "?other=5f1e"] {
        assert_eq!(refusal(&bench, query, Some(&own)).await, 403, "{query}");
    }
    assert_eq!(refusal(&bench, "?token=5f1e", Some("http://evil.example")).await, 403);
}
