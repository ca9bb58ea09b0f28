//! Models in their folder: kept, listed, verified, used, and refused in sentences.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and says what it skips"
)]

mod common;

use std::path::{Path, PathBuf};

use common::{fails_with, real_data, run, run_json, text};

/// A model of tiny networks in a folder of its own, described by model.toml.
fn tiny_model(folder: &Path) -> PathBuf {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../networks/tests/tiny");
    let model = folder.join("tiny");
    std::fs::create_dir(&model).expect("a folder");
    for file in ["extractor64.onnx", "per_keypoint64.onnx"] {
        std::fs::copy(from.join(file), model.join(file)).expect("a tiny network");
    }
    let manifest = r#"
name = "tiny"
licence = "MIT"
image = { channels = 1, multiple_of = 32 }
[networks.separate.extractor]
file = "extractor64.onnx"
image = "image"
keypoints = "keypoints"
descriptors = "descriptors"
scores = "scores"
descriptor_width = 64
[networks.separate.matcher]
file = "per_keypoint64.onnx"
keypoints = ["kpts0", "kpts1"]
descriptors = ["desc0", "desc1"]
coordinates = "centred"
result = { matches = "matches0", scores = "mscores0", form = "per-keypoint", threshold = 0.1 }
"#;
    std::fs::write(model.join("model.toml"), manifest).expect("a manifest");
    model
}

fn path(path: &Path) -> &str {
    path.to_str().expect("UTF-8")
}

#[test]
fn a_model_is_kept_listed_verified_and_a_changed_file_is_noticed() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = tiny_model(folder.path());
    let store = folder.path().join("store");
    let models = |verb: &[&str]| [&["models"], verb, &["--models", path(&store), "--json"]].concat().join("\n");
    let arguments = |verb: &[&str]| models(verb).split('\n').map(str::to_owned).collect::<Vec<_>>();
    let json = |verb: &[&str]| {
        let arguments = arguments(verb);
        run_json(&arguments.iter().map(String::as_str).collect::<Vec<_>>())
    };

    assert_eq!(json(&["list"])["kept"].as_array().expect("a list").len(), 0);
    json(&["add", path(&model)]);
    assert_eq!(json(&["list"])["kept"][0]["name"], "tiny");
    let verified = json(&["verify"]);
    assert!(verified["models"].as_array().expect("a list").iter().all(|entry| entry["ok"] == true), "{verified}");

    let kept = store.join("tiny").join("extractor64.onnx");
    let mut bytes = std::fs::read(&kept).expect("the kept file");
    bytes[20] ^= 1;
    std::fs::write(&kept, bytes).expect("the kept file");
    fails_with(&["models", "verify", "--models", path(&store)], 1, &["not what it should be"]);
    let output = run(&["models", "verify", "--models", path(&store)]);
    assert!(text(&output.stdout).contains("SHA-256"), "{}", text(&output.stdout));
}

#[test]
fn what_cannot_be_kept_or_used_is_refused_in_a_sentence() {
    let folder = tempfile::tempdir().expect("a folder");
    let model = tiny_model(folder.path());
    let manifest = model.join("model.toml");
    let right = std::fs::read_to_string(&manifest).expect("the manifest");
    let store = folder.path().join("store");
    let add = ["models", "add", path(&model), "--models", path(&store)];

    std::fs::write(&manifest, right.replace("matches0", "matches")).expect("the manifest");
    fails_with(&add, 2, &["per_keypoint64.onnx", "it has no output 'matches'"]);
    std::fs::write(&manifest, right.replace("name = \"tiny\"", "name = \"../tiny\"")).expect("the manifest");
    fails_with(&add, 2, &["letters, digits"]);
    std::fs::write(&manifest, "name = 3").expect("the manifest");
    fails_with(&add, 2, &["model.toml"]);
    fails_with(&["models", "add", "/nonexistent", "--models", path(&store)], 2, &["/nonexistent"]);
    assert!(!store.join("tiny").exists(), "what was refused is not kept");

    fails_with(&["models", "pull", "superpoint-lightglue"], 2, &["non-commercial", "--accept-non-commercial"]);
    fails_with(&["models", "pull", "unheard-of"], 2, &["vergence models list"]);
    fails_with(&["models", "pull", "xfeat-lighterglue"], 2, &["PyTorch"]);
    fails_with(
        &["models", "verify", "--models", path(&store), "--onnxruntime", "/nonexistent/libonnxruntime.so"],
        2,
        &["ONNX Runtime cannot be used"],
    );
}

/// Two black photographs for the built-in rig.
fn black_photograph(folder: &Path) -> String {
    let file = folder.join("black.png");
    image::GrayImage::new(1280, 1280).save(&file).expect("written");
    path(&file).to_owned()
}

fn depth_of_black(folder: &Path, store: &Path, more: &[&str]) -> std::process::Output {
    let (black, cloud) = (black_photograph(folder), folder.join("cloud.ply"));
    let images = ["depth", "--mode", "herbivore", "--left", &black, "--right", &black, "--out", path(&cloud)];
    run(&[&images[..], &["--models", path(store), "--matcher"], more].concat())
}

#[test]
fn black_photographs_have_no_points_and_a_learned_matcher_that_is_asked_for_must_be_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = folder.path().join("store");
    let classical = depth_of_black(folder.path(), &store, &["guided"]);
    assert_eq!(classical.status.code(), Some(1), "{}", text(&classical.stderr));
    assert!(text(&classical.stdout).contains("0 points"), "{}", text(&classical.stdout));
    let without = depth_of_black(folder.path(), &store, &["learned"]);
    assert_eq!(without.status.code(), Some(2), "{}", text(&without.stdout));
    assert!(text(&without.stderr).contains("no model is kept"), "{}", text(&without.stderr));

    let model = tiny_model(folder.path());
    run_json(&["models", "add", path(&model), "--models", path(&store), "--json"]);
    let with = depth_of_black(folder.path(), &store, &["tiny"]);
    assert_eq!(with.status.code(), Some(1), "{}", text(&with.stderr));
    assert!(text(&with.stdout).contains("0 points"), "{}", text(&with.stdout));

    let kept = store.join("tiny").join("extractor64.onnx");
    std::fs::write(&kept, b"another").expect("the kept file");
    let changed = depth_of_black(folder.path(), &store, &["tiny"]);
    assert_eq!(changed.status.code(), Some(1));
    assert!(text(&changed.stderr).contains("SHA-256"), "{}", text(&changed.stderr));
}

#[test]
fn the_faster_runtime_is_on_record_and_another_can_be_asked_for() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = folder.path().join("store");
    let model = tiny_model(folder.path());
    run_json(&["models", "add", path(&model), "--models", path(&store), "--json"]);
    let record = std::fs::read_to_string(store.join("tiny/speed.toml")).expect("a record");
    assert!(record.contains("rten_seconds"), "{record}");
    let asked = depth_of_black(folder.path(), &store, &["tiny", "--runtime", "rten"]);
    assert!(text(&asked.stdout).contains("tiny on rten (as asked)"), "{}", text(&asked.stdout));
    for runtime in [&[][..], &["--runtime", "cuda"], &["--runtime", "webgpu"]] {
        let named = ["tiny", "--onnxruntime", "/nonexistent/libonnxruntime.so"];
        let missing = depth_of_black(folder.path(), &store, &[&named, runtime].concat());
        assert_eq!(missing.status.code(), Some(2));
        assert!(text(&missing.stderr).contains("ONNX Runtime cannot be used"), "{}", text(&missing.stderr));
    }
}

/// At 120° networks find many times as much in views as in whole images, and nearly all of it is right.
#[test]
fn views_beat_whole_images_where_the_axes_are_far_apart() {
    let bench = ["bench", "matching", "--separations", "120deg", "--side", "400", "--keypoints", "512", "--json"];
    let Some(models) = real_data("models") else {
        let found = run_json(&[&bench[..], &["--matcher", "guided"]].concat());
        assert!(
            found["rows"][0]["ways"]["classical"]["after"]["precision"].as_f64().expect("a share") > 0.9,
            "{found}"
        );
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let store = folder.path().join("store");
    run_json(&["models", "add", path(&models), "--models", path(&store), "--json"]);
    let found = run_json(&[&bench[..], &["--models", path(&store), "--runtime", "rten"]].concat());
    let ways = &found["rows"][0]["ways"];
    println!("{ways}");
    let correct = |way: &str| ways[way]["after"]["correct"].as_u64().expect("a count");
    assert!(correct("views") > 4 * correct("raw"), "{ways}");
    for way in ["views", "classical"] {
        assert!(ways[way]["after"]["precision"].as_f64().expect("a share") > 0.9, "{way}: {ways}");
    }
}

#[test]
fn published_networks_are_known_by_their_tensors() {
    let Some(models) = real_data("models") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let store = folder.path().join("store");
    let added = run_json(&["models", "add", path(&models), "--models", path(&store), "--json"]);
    assert_eq!(added["name"], "xfeat-lighterglue");
    let verified = run_json(&["models", "verify", "--models", path(&store), "--json"]);
    assert_eq!(verified["models"][0]["ok"], true, "{verified}");
}
