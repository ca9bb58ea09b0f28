//! Calibrations kept under names, made active, and taken back.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::path::Path;
use std::process::Output;

use common::{run, text, vergence};
use serde_json::{Value, json};
use vergence_rig::{BENCH_TOML, CameraDocument, CameraTable, Provenance, Rig};

/// A store with the rigs `wide` and `narrow`, and a camera.
struct Store {
    folder: tempfile::TempDir,
}

impl Store {
    fn new() -> Self {
        let store = Self { folder: tempfile::tempdir().expect("a temporary folder") };
        std::fs::create_dir_all(store.path("kept")).expect("a folder");
        let provenance = Provenance {
            program: "vergence 0.1.0".into(),
            inputs_sha256: "ab".repeat(32),
            date: Some("2026-11-21".into()),
        };
        let bench = Rig::from_toml(BENCH_TOML).expect("the bench");
        for name in ["wide", "narrow"] {
            let rig = Rig { name: name.into(), ..bench.clone() };
            let text = rig.to_toml(&provenance).expect("TOML");
            std::fs::write(store.path(&format!("kept/{name}.toml")), text).expect("written");
        }
        let camera = CameraTable::of(&bench.left_camera);
        let camera = CameraDocument { camera, calibration: None, provenance: Some(provenance) };
        std::fs::write(store.path("kept/left.toml"), toml::to_string(&camera).expect("TOML")).expect("written");
        store
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).to_string_lossy().into_owned()
    }

    fn run(&self, arguments: &[&str]) -> Output {
        vergence(arguments).env("VERGENCE_STORE", self.path("kept")).output().expect("the binary runs")
    }

    fn json(&self, arguments: &[&str]) -> Value {
        let output = self.run(arguments);
        assert!(output.status.success(), "{arguments:?}: {}", text(&output.stderr));
        serde_json::from_slice(&output.stdout).expect("JSON")
    }

    fn refuses(&self, arguments: &[&str], words: &[&str]) {
        let output = self.run(arguments);
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{arguments:?} said: {said}");
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
    }

    fn active(&self) -> Option<String> {
        let list = self.json(&["calibrate", "list", "--json"]);
        let all = list["calibrations"].as_array().expect("a list");
        all.iter().find(|slot| slot["active"] == true).map(|slot| slot["name"].as_str().expect("a name").to_owned())
    }
}

#[test]
fn the_active_calibration_is_swapped_and_taken_back() {
    let store = Store::new();
    let list = store.json(&["calibrate", "list", "--json"]);
    let all = list["calibrations"].as_array().expect("a list");
    let kinds: Vec<_> = all.iter().map(|slot| (&slot["name"], &slot["kind"])).collect();
    assert_eq!(json!(kinds), json!([["left", "camera"], ["narrow", "rig"], ["wide", "rig"]]));
    assert_eq!(all[1]["date"], "2026-11-21");
    assert_eq!(all[1]["inputs_sha256"], "ab".repeat(32));
    store.refuses(&["calibrate", "rollback"], &["nothing to go back to"]);
    for name in ["wide", "narrow", "narrow"] {
        assert_eq!(store.json(&["calibrate", "use", name, "--json"])["active"], name);
        assert_eq!(store.active().as_deref(), Some(name));
    }
    // What is no rig, or is not there, leaves the active one as it was.
    store.refuses(&["calibrate", "use", "left"], &["camera", "--left"]);
    store.refuses(&["calibrate", "use", "tall"], &["tall", "narrow", "wide"]);
    std::fs::write(store.path("kept/torn.toml"), "name = ").expect("written");
    store.refuses(&["calibrate", "use", "torn"], &["torn.toml"]);
    assert_eq!(store.active().as_deref(), Some("narrow"));
    assert_eq!(store.json(&["calibrate", "rollback", "--json"])["active"], "wide");
    assert_eq!(store.json(&["calibrate", "rollback", "--json"])["active"], Value::Null);
    assert_eq!(store.active(), None);
}

#[test]
fn verbs_take_the_active_calibration_unless_told_otherwise() {
    let store = Store::new();
    let said = |arguments: &[&str]| text(&store.run(arguments).stderr);
    store.json(&["calibrate", "use", "wide", "--json"]);
    let no_mode = ["--port", "sim", "mode", "owl"];
    let answer = said(&no_mode);
    assert!(answer.contains("'wide'"), "{answer}");
    let other = store.path("other.toml");
    std::fs::write(&other, BENCH_TOML.replace("name = \"bench\"", "name = \"other\"")).expect("written");
    let answer = said(&[&["--rig", &other], &no_mode[..]].concat());
    assert!(answer.contains("'other'"), "{answer}");
    // An active calibration that has gone is told, and can be left.
    std::fs::remove_file(store.path("kept/wide.toml")).expect("removed");
    let answer = said(&no_mode);
    assert!(answer.contains("wide.toml"), "{answer}");
    store.json(&["calibrate", "use", "narrow", "--json"]);
    let answer = said(&no_mode);
    assert!(answer.contains("'narrow'"), "{answer}");
    store.refuses(&["calibrate", "rollback"], &["wide"]);
    assert_eq!(store.active().as_deref(), Some("narrow"));
}

#[test]
fn a_calibration_is_kept_once() {
    let store = Store::new();
    let csv = store.path("corners.csv");
    std::fs::write(&csv, "camera,file,frame,idx,x,y,bx_mm,by_mm\n").expect("written");
    let calibrate = ["calibrate", "intrinsics", "--csv", &csv, "--size", "960x600", "--slot"];
    store.refuses(&[&calibrate[..], &["wide"]].concat(), &["wide", "kept already"]);
    store.refuses(&[&calibrate[..], &["../escape"]].concat(), &["no name"]);
    // A calibration that fails keeps nothing.
    store.refuses(&[&calibrate[..], &["new"]].concat(), &["corners"]);
    assert!(!Path::new(&store.path("kept/new.toml")).exists());
}

#[test]
fn without_a_store_there_is_nothing_to_list() {
    let output = run(&["calibrate", "list"]);
    assert!(output.status.success() && text(&output.stdout).contains("--slot NAME"));
}
