//! From a folder of photographs to the rig file, by the command line.

use std::path::Path;

use vergence_rig::Rig;
use vergence_vision::Side;

use crate::common::{run, run_json, text};

/// What the rig file says, calibrated from photographs of a target of 9 x 6 corners: those of each camera alone in `left` and `right` of `folder`, those of
/// the stage in `set`. `lens` are options of `calibrate intrinsics`. The camera files and `rig.toml` go to the folder too. `None` where the program wants more views.
pub fn calibrated(folder: &Path, square: &str, lens: &[&str]) -> Option<Rig> {
    let file = |name: &str| folder.join(name).to_string_lossy().into_owned();
    let printed = ["--corners", "9x6", "--square", square, "--json"];
    for side in [Side::Left, Side::Right] {
        let (images, out) = (file(&side.to_string()), file(&format!("{side}.toml")));
        let verb = ["calibrate", "intrinsics", "--images", &images, "--out", &out];
        let found = run_json(&[&verb[..], lens, &printed].concat());
        println!("{side} lens {}: {} px, {} corners", lens.join(" "), found["rms_inlier_px"], found["corners_total"]);
    }
    let [set, left, right, out] = ["set", "left.toml", "right.toml", "rig.toml"].map(file);
    let stage = ["calibrate", "stage", "--set", &set, "--left", &left, "--right", &right, "--out", &out];
    let output = run(&[&stage[..], &printed].concat());
    let said = text(&output.stderr);
    if said.contains("views in which both cameras see enough of the target; at least 3 are needed") {
        println!("{said}");
        return None;
    }
    assert!(output.status.success(), "{said}");
    let found: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    println!("stage: {} px; {}", found["rms_inlier_px"], found["verdict"]["text"]);
    Some(Rig::from_toml(&std::fs::read_to_string(&out).expect("a rig file")).expect("a rig"))
}
