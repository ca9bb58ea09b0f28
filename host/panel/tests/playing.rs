//! A recording on a page: it is held, goes on, is played from elsewhere, and is not driven.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

mod common;

use std::net::TcpListener;
use std::sync::Arc;
use std::time::Duration;

use common::{PATIENCE, Page};
use serde_json::json;
use tokio::time::timeout;
use vergence_panel::{Access, Panel, Screen, Setting};
use vergence_recording::{Audience, Jump};
use vergence_rig::{BENCH_TOML, Rig};

#[tokio::test]
async fn a_page_holds_a_recording_plays_it_from_elsewhere_and_drives_nothing() {
    let rig = Arc::new(Rig::from_toml(BENCH_TOML).expect("the bench"));
    let setting = Setting { rig, simulated: None, has_cameras: true, recorded_ms: Some(1_700_000_000_000) };
    let (panel, _) = Panel::new(setting);
    let serving =
        panel.serve(TcpListener::bind("127.0.0.1:0").expect("a port"), Access::ThisComputer).expect("a server");
    let mut screen = Screen::new(panel, Some(Duration::from_secs(60)), Some(1.0));
    let mut page = Page::open(serving.address(), "").await;
    assert_eq!(page.latest["hello"]["recorded_ms"], json!(1_700_000_000_000_u64));

    for order in [json!({ "do": "take" }), json!({ "do": "home" }), json!({ "do": "mode", "name": "human" })] {
        page.send(order).await;
        assert!(page.next("refused").await["text"].as_str().is_some_and(|text| text.contains("this is a recording")));
    }

    let at = Duration::from_secs(12);
    screen.proceed(at).await.expect("it plays");
    let told = page.next("playback").await;
    assert_eq!((&told["at_s"], &told["length_s"], &told["state"]), (&json!(12.0), &json!(60.0), &json!("plays")));

    // Held: the next event waits for the page.
    page.send(json!({ "do": "pause" })).await;
    let held = async {
        loop {
            screen.proceed(at).await.expect("it plays");
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    };
    tokio::select! {
        () = held => {}
        told = page.until(|message| message["kind"] == "playback" && message["state"] == "paused") => {
            assert_eq!(told["at_s"], json!(12.0));
        }
    }
    assert!(timeout(Duration::from_millis(200), screen.proceed(at)).await.is_err(), "it goes on while it is held");
    page.send(json!({ "do": "resume" })).await;
    timeout(PATIENCE, screen.proceed(at)).await.expect("it goes on").expect("it plays");

    page.send(json!({ "do": "jump", "to_s": 33.5 })).await;
    let jump = timeout(PATIENCE, screen.jump()).await.expect("it jumps");
    assert_eq!(jump, Jump(Duration::from_millis(33_500)));
    screen.proceed(at).await.expect("each jump is made once");
    page.send(json!({ "do": "jump", "to_s": -1.0 })).await;
    assert!(page.next("refused").await["text"].as_str().is_some_and(|text| text.contains("is no time")));
}
