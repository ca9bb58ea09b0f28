//! Attached cameras as the program opens, sets, reads, judges and loses them, on a faithful stand-in of the kernel's V4L2 devices
//! (`tests/v4l/fake_v4l.c`), which is preloaded into the real program and logs its ioctls; no kernel device (vivid, v4l2loopback) was at hand. Beside
//! them folders and videos that are played as cameras, and simulated ones.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a test fails loudly, shows its figures, and looks at the clock"
)]

mod common;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use common::pairs::{human, write_rig};
use common::{Simulator, fails_with, run, run_json, small_bench_toml, text, vergence};
use image::RgbImage;
use nalgebra::UnitQuaternion;
use serde_json::{Value, json};
use tempfile::TempDir;
use vergence_rig::{Rig, RigCalibration};
use vergence_sim::{Room, RoomCamera};
use vergence_vision::{Angle, Left, Length, Right, Side, Transform};

/// A folder with the rig file of a pair without axes, whose cameras have 320 x 320 pixels and stand as in the mode `human`.
struct Pair {
    folder: TempDir,
    rig: Rig,
}

impl Pair {
    fn new() -> Self {
        let rig = Rig::from_toml(&small_bench_toml()).expect("the bench");
        let folder = tempfile::tempdir().expect("a folder");
        write_rig(&fixed(&rig, human(&rig).left_from_right), &folder.path().join("pair.toml"));
        Self { folder, rig }
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    /// What both cameras see where they stand.
    fn photographs(&self) -> [RgbImage; 2] {
        let room = std::sync::Arc::new(Room::with_rig());
        [Side::Left, Side::Right].map(|side| {
            let camera = RoomCamera { side, lens: *self.rig.camera(side), room: room.clone(), seed: 3 };
            camera.photograph(&human(&self.rig), 0)
        })
    }

    /// Writes `count` pairs into the folders `left` and `right`, named by `name`.
    fn folders(&self, count: u32, name: impl Fn(u32) -> String) -> [String; 2] {
        let images = self.photographs();
        let folders = ["left", "right"].map(|side| self.path(side));
        for (folder, image) in folders.iter().zip(&images) {
            std::fs::create_dir_all(folder).expect("a folder");
            (0..count).for_each(|number| image.save(format!("{folder}/{}", name(number))).expect("saved"));
        }
        folders
    }
}

/// A calibrated pair without axes, with the lenses of `rig`.
fn fixed(rig: &Rig, left_from_right: Transform<Left, Right>) -> Rig {
    let calibration = RigCalibration::Sigmas { rotation: Angle::from_deg(0.05), translation: Length::from_mm(0.2) };
    Rig { calibration, ..Rig::fixed_pair("pair", (rig.left_camera, rig.right_camera), left_from_right) }
}

/// The kernel's stand-in, and a folder in the place of /dev.
struct Kernel {
    library: PathBuf,
    pair: Pair,
}

impl Kernel {
    fn new(name: &str) -> Self {
        let library = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("fake_v4l-{name}.so"));
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/v4l/fake_v4l.c");
        // The linker of Rust programs is a C compiler.
        let mut compiler = Command::new("cc");
        compiler.args(["-shared", "-fPIC", "-O1", "-o"]).args([&library, &source]).args(["-ldl", "-lpthread"]);
        assert!(compiler.status().expect("cc runs").success());
        let pair = Pair::new();
        std::fs::create_dir(pair.path("dev")).expect("a folder");
        for name in ["video0", "video1", "video2", "null"] {
            std::fs::write(pair.path(&format!("dev/{name}")), "").expect("a file");
        }
        Self { library, pair }
    }

    fn run(&self, arguments: &[&str], faults: &[(&str, &str)]) -> Output {
        let mut command = vergence(arguments);
        command
            .env("LD_PRELOAD", &self.library)
            .env("FAKE_V4L_DIR", self.pair.path("dev"))
            .env("FAKE_V4L_LOG", self.pair.path("log"))
            .envs(faults.iter().copied());
        command.output().expect("the binary runs")
    }

    fn json(&self, arguments: &[&str], faults: &[(&str, &str)], code: i32) -> Value {
        let output = self.run(arguments, faults);
        assert_eq!(
            output.status.code(),
            Some(code),
            "{arguments:?}: {} {}",
            text(&output.stdout),
            text(&output.stderr)
        );
        serde_json::from_slice(&output.stdout).expect("JSON")
    }

    /// `vergence camera test` of both cameras for a second, with `more` options.
    fn test(&self, more: &[&str], faults: &[(&str, &str)], code: i32) -> Value {
        let rig = self.pair.path("pair.toml");
        let line =
            ["camera", "test", "--cameras", "/dev/video0", "/dev/video1", "--rig", &rig, "--for", "1s", "--json"];
        self.json(&[&line[..], more].concat(), faults, code)
    }

    /// The ioctls of one camera, in their order.
    fn log(&self, camera: &str) -> Vec<String> {
        let log = std::fs::read_to_string(self.pair.path("log")).expect("a log");
        log.lines().filter_map(|line| line.strip_prefix(&format!("{camera} "))).map(str::to_owned).collect()
    }
}

/// The verdicts of the checks called `check`.
fn verdicts(result: &Value, check: &str) -> Vec<String> {
    let checks = result["checks"].as_array().expect("checks").iter().filter(|found| found["check"] == check);
    checks.map(|found| found["verdict"].as_str().expect("a verdict").to_owned()).collect()
}

#[test]
fn devices_lists_what_cameras_can_do() {
    let kernel = Kernel::new("list");
    let listed = kernel.json(&["devices", "--json"], &[], 0);
    let cameras = listed["cameras"].as_array().expect("cameras");
    let devices: Vec<_> = cameras.iter().map(|camera| camera["device"].as_str().unwrap_or_default()).collect();
    assert_eq!(devices, ["/dev/video0", "/dev/video1"], "video2 takes no images: {listed}");
    let camera = &cameras[0];
    assert_eq!((&camera["card"], &camera["driver"]), (&json!("Fake camera 0"), &json!("fake")));
    let format = |code: &str| {
        let formats = camera["formats"].as_array().expect("formats");
        formats.iter().find(|format| format["code"] == code).unwrap_or_else(|| panic!("{code}: {camera}"))
    };
    assert_eq!(format("YUYV")["sizes"][0], "320x320 at 10, 5 Hz");
    assert_eq!((&format("GREY")["understood"], &format("BG10")["understood"]), (&json!(true), &json!(false)));
    assert_eq!(camera["trigger_controls"][0], json!({ "control": "Trigger Mode", "value": 0 }));
    let said = text(&kernel.run(&["devices"], &[]).stdout);
    assert!(said.contains("trigger: control 'Trigger Mode' is 0") && said.contains("BG10 (not understood"), "{said}");
    assert!(kernel.log("video0").iter().all(|call| call == "open"), "listing sets nothing: {:?}", kernel.log("video0"));
    let quick = kernel.json(&["devices", "--quick", "--json"], &[], 0);
    assert_eq!(quick["cameras"][0], json!({ "device": "/dev/video0" }));
}

/// Buffers go to the kernel and come back as its documentation demands, and the exposure is set by hand before its time.
#[test]
fn a_camera_test_reads_both_cameras_by_the_kernel_s_rules() {
    let kernel = Kernel::new("test");
    let result = kernel.test(&["--exposure", "5ms", "--gain", "20", "--readout", "5ms"], &[], 0);
    println!("{result:#}");
    for side in ["left", "right"] {
        let figures = &result["figures"][side];
        let rate = figures["rate_hz"].as_f64().expect("a rate");
        assert!((rate - 10.0).abs() < 0.3 && figures["lost"] == 0, "{figures}");
        // 320 x 320 bytes of grey, ten times a second.
        assert!((figures["mb_per_s"].as_f64().expect("bytes") - 1.024).abs() < 0.02, "{figures}");
        assert!((figures["mean_level"].as_f64().expect("a level") - 120.0).abs() < 3.0, "{figures}");
    }
    let difference = result["figures"]["difference"]["median_ms"].as_f64().expect("pairs");
    assert!((difference - 2.0).abs() < 0.2, "the second camera is 2 ms late: {difference}");
    assert!((result["figures"]["bound_ms"].as_f64().expect("a bound") - 49.0).abs() < 0.1);
    assert!(result["checks"].as_array().expect("checks").iter().all(|check| check["verdict"] != "fail"));
    let log = kernel.log("video0");
    let at =
        |call: &str| log.iter().position(|line| line.starts_with(call)).unwrap_or_else(|| panic!("{call}: {log:?}"));
    let order =
        ["open", "S_FMT GREY 320x320", "S_EXT_CTRLS 0x9a0901 1", "S_EXT_CTRLS 0x9a0902 50", "S_EXT_CTRLS 0x980913 20"];
    let begin = ["REQBUFS 4: 0", "QUERYBUF 0", "QBUF 3: 0", "STREAMON: 0", "DQBUF 0: 0"];
    let places: Vec<_> = order.iter().chain(&begin).map(|call| at(call)).collect();
    assert!(places.is_sorted(), "{places:?} {log:?}");
    let refused: Vec<_> = log.iter().filter(|line| line.contains(": ") && !line.ends_with(": 0")).collect();
    assert!(refused.is_empty(), "the kernel refuses nothing: {refused:?}");
}

#[test]
fn a_camera_test_finds_lost_images_and_a_lens_cap() {
    let kernel = Kernel::new("faults");
    let result = kernel.test(&["--readout", "5ms"], &[("FAKE_V4L_LOSE", "5"), ("FAKE_V4L_DARK", "1")], 1);
    assert_eq!(verdicts(&result, "images"), ["fail", "fail"], "{result:#}");
    assert_eq!(verdicts(&result, "exposure"), ["pass", "fail"], "{result:#}");
    let lost = result["figures"]["left"]["lost"].as_u64().expect("a count");
    assert!((1..=3).contains(&lost), "{lost}");
}

/// What a real rig without axes does: it pairs the images of both cameras by their stamps, and measures; then the cameras are unplugged.
#[test]
fn run_measures_with_cameras_of_the_kernel_and_outlives_their_loss() {
    let kernel = Kernel::new("run");
    let rig = kernel.pair.path("pair.toml");
    let line = ["run", "--cameras", "/dev/video0", "/dev/video1", "--rig", &rig, "--for", "20s", "--json"];
    let output = kernel.run(&line, &[("FAKE_V4L_VANISH", "25")]);
    let (said, warned) = (text(&output.stdout), text(&output.stderr));
    assert!(warned.contains("the left camera is dead") && warned.contains("No such device"), "{warned}");
    assert_eq!(output.status.code(), Some(3), "both are dead in the end: {warned}");
    assert!(said.lines().count() > 1, "{said}");
    assert!(kernel.log("video1").iter().any(|call| call == "DQBUF 0: 19"), "ENODEV is 19");
}

/// Images that are named by time stamps, 100 ms apart: they come at the pace at which they were taken, and their end ends the run in order.
#[test]
fn folders_and_videos_are_played_as_cameras() {
    let pair = Pair::new();
    let rig = pair.path("pair.toml");
    let [left, right] =
        pair.folders(8, |number| format!("{}.png", 1_403_636_579_000_000_000_u64 + u64::from(number) * 100_000_000));
    let begun = std::time::Instant::now();
    let output = run(&["run", "--cameras", &left, &right, "--rig", &rig, "--json"]);
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(begun.elapsed().as_millis() > 700, "real time");
    let lines: Vec<Value> =
        text(&output.stdout).lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let clouds: Vec<_> = lines.iter().filter(|line| line["kind"] == "cloud").collect();
    assert!(!clouds.is_empty() && clouds.iter().all(|cloud| cloud["points"].as_u64() > Some(30)), "{lines:#?}");
    // A recording of them holds every image of both.
    let out = pair.path("recording");
    let recorded = run_json(&["record", "--cameras", &left, &right, "--rig", &rig, "--out", &out, "--json"]);
    assert_eq!((&recorded["images"], &recorded["left_out"]), (&json!(16), &json!(0)), "{recorded}");
    // The same as videos.
    let videos = ["left", "right"].map(|side| pair.path(&format!("{side}.y4m")));
    for (video, image) in videos.iter().zip(pair.photographs()) {
        let grey = image::DynamicImage::ImageRgb8(image).into_luma8();
        let mut bytes = b"YUV4MPEG2 W320 H320 F20:1 Ip Cmono XCOLORRANGE=FULL\n".to_vec();
        (0..30).for_each(|_| bytes.extend([&b"FRAME\n"[..], grey.as_raw()].concat()));
        std::fs::write(video, bytes).expect("written");
    }
    let test = run(&["camera", "test", "--cameras", &videos[0], &videos[1], "--rig", &rig, "--for", "1s", "--json"]);
    let result: Value = serde_json::from_slice(&test.stdout).expect("JSON");
    assert!(test.status.success(), "{result:#}");
    let rate = result["figures"]["left"]["rate_hz"].as_f64().expect("a rate");
    assert!((rate - 20.0).abs() < 0.5 && result["figures"]["pairs"].as_u64() > Some(8), "{result:#}");
}

#[test]
fn images_whose_pose_or_time_is_unknown_are_refused() {
    let pair = Pair::new();
    let [left, right] = pair.folders(2, |number| format!("{number:03}.png"));
    let bench = pair.path("bench.toml");
    std::fs::write(&bench, small_bench_toml()).expect("written");
    let rig = pair.path("pair.toml");
    fails_with(&["run", "--cameras", &left, &right, "--rig", &bench], 2, &["nothing says where they stood", "replay"]);
    fails_with(&["run", "--cameras", &left, &right, "--rig", &rig, "--exposure", "5ms"], 2, &["--exposure"]);
    std::fs::rename(format!("{left}/001.png"), format!("{left}/wall.png")).expect("renamed");
    std::fs::rename(format!("{right}/001.png"), format!("{right}/wall.png")).expect("renamed");
    fails_with(&["run", "--cameras", &left, &right, "--rig", &rig], 2, &["tells no time"]);
}

#[test]
fn a_camera_test_of_the_simulated_rig_says_that_it_is_simulated_and_how_late_images_are() {
    let rig = tempfile::tempdir().expect("a folder");
    let file = rig.path().join("rig.toml");
    std::fs::write(&file, small_bench_toml()).expect("written");
    let file = file.display().to_string();
    let line = ["cameras", "test", "--port", "sim", "--cameras", "sim", "--rig", &file, "--for", "2s"];
    let result = run_json(&[&line[..], &["--json"]].concat());
    assert_eq!(result["simulated"], true);
    let trigger = &result["figures"]["left"]["trigger"];
    let arrival = trigger["pulse_to_arrival"]["median_ms"].as_f64().expect("a time");
    // 4 ms of exposure, 6 of transfer, and up to 3 of looking.
    assert!((10.0..14.0).contains(&arrival), "{trigger}");
    assert_eq!(
        (&result["failed"], verdicts(&result, "trigger")),
        (&json!(0), vec!["pass".into(), "pass".into()]),
        "{result:#}"
    );
    let said = text(&run(&line).stdout);
    assert!(said.contains("simulated lenses") && said.contains("pulse to arrival, ms"), "{said}");
    // No camera takes 60 images a second here: pulses are missed.
    let fast = run(&[&line[..], &["--rate", "60", "--json"]].concat());
    let result: Value = serde_json::from_slice(&fast.stdout).expect("JSON");
    assert_eq!(
        (fast.status.code(), verdicts(&result, "trigger")),
        (Some(1), vec!["fail".into(), "fail".into()]),
        "{result:#}"
    );
}

/// A board behind a pseudo-terminal says who it is; one that is in use is left alone, and a port where nobody answers is silent within seconds.
#[test]
fn devices_asks_boards_who_they_are() {
    let simulator = Simulator::start(&["--pty"]);
    let identity = |listed: &Value, port: &str| {
        let ports = listed["devices"].as_array().expect("ports");
        ports.iter().find(|listed| listed["port"] == port).unwrap_or_else(|| panic!("{port}: {listed}"))["identity"]
            .clone()
    };
    let found = identity(&simulator.json(&["devices"]), &simulator.port);
    assert_eq!((&found["answer"], &found["axes"]), (&json!("board"), &json!(2)), "{found}");
    assert_eq!(found["firmware"], env!("CARGO_PKG_VERSION"));
    assert_eq!(found["serial_number"].as_str().map(str::len), Some(24));
    assert_eq!(identity(&simulator.json(&["devices", "--quick"]), &simulator.port), Value::Null);
    let said = text(&simulator.run(&["devices"]).stdout);
    assert!(said.contains("native-sim with firmware"), "{said}");
    assert_eq!(simulator.json(&["status"])["state"], "idle", "nothing was armed");
    let mut watcher =
        simulator.command(&["monitor", "--json"]).stdout(std::process::Stdio::piped()).spawn().expect("it starts");
    let mut first = String::new();
    std::io::BufRead::read_line(&mut std::io::BufReader::new(watcher.stdout.as_mut().expect("piped")), &mut first)
        .expect("a pose");
    assert_eq!(identity(&simulator.json(&["devices"]), &simulator.port)["answer"], "busy");
    watcher.kill().and_then(|()| watcher.wait()).expect("ended");
    let (_master, slave) = serialport::TTYPort::pair().expect("a pseudo-terminal");
    let silent = serialport::SerialPort::name(&slave).expect("a name");
    let begun = std::time::Instant::now();
    assert_eq!(identity(&run_json(&["devices", "--port", &silent, "--json"]), &silent)["answer"], "none");
    assert!(begun.elapsed().as_secs() < 6);
}

#[test]
fn the_udev_rule_is_printed_as_it_is_shipped() {
    let shipped = std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/70-vergence.rules"))
        .expect("a file");
    assert_eq!(text(&run(&["devices", "--rule"]).stdout), shipped);
}

/// The calibration that took the pictures fits them; one whose right camera is turned by a third of a degree or by two degrees does not.
#[test]
fn doctor_says_whether_the_calibration_fits_the_pictures() {
    let pair = Pair::new();
    let [left, right] = pair.folders(60, |number| format!("{number:03}.png"));
    let turned = |degrees: f64| {
        let by = UnitQuaternion::from_euler_angles(degrees.to_radians(), 0.0, 0.0);
        let pose = human(&pair.rig).left_from_right;
        let file = pair.folder.path().join(format!("turned{degrees}.toml"));
        write_rig(&fixed(&pair.rig, Transform::new(pose.rotation() * by, pose.origin().mm())), &file);
        file.display().to_string()
    };
    let doctor = |rig: &str| {
        let out = pair.path("");
        let output = run(&["doctor", "--cameras", &left, &right, "--rig", rig, "--out", &out, "--json"]);
        let result = serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", text(&output.stderr)));
        (output.status.code(), result)
    };
    let (_, fits): (_, Value) = doctor(&pair.path("pair.toml"));
    println!("{fits:#}");
    assert_eq!((verdicts(&fits, "fit"), verdicts(&fits, "age")), (vec!["pass".into()], vec!["pass".into()]));
    for check in ["udev", "disk", "host", "models"] {
        assert_eq!(verdicts(&fits, check).len(), 1, "{check}");
    }
    assert_eq!(verdicts(&fits, "port"), Vec::<String>::new(), "a pair without axes needs no board");
    for degrees in [0.33, 2.0] {
        let (code, result) = doctor(&turned(degrees));
        assert_eq!((code, verdicts(&result, "fit")), (Some(1), vec!["fail".into()]), "{degrees}: {result:#}");
    }
}

/// A target that is shown for a second and a half in each of three places, in a folder that is played.
#[test]
fn a_folder_of_target_images_is_captured_from() {
    let work = tempfile::tempdir().expect("a folder");
    let path = |name: &str| work.path().join(name).display().to_string();
    write_rig(&common::pairs::small_bench(), Path::new(&path("rig.toml")));
    let rig = path("rig.toml");
    let line = |cameras: &str, out: &str, views: &str| {
        let line =
            ["capture", "--cameras", cameras, "--corners", "9x6", "--square", "20mm", "--rig", &rig, "--out", out];
        let output =
            run(&[&line[..], &["--views", views, "--json"], if cameras == "sim" { &["--mono"] } else { &[] }].concat());
        assert!(output.status.success(), "{}", text(&output.stderr));
        serde_json::from_slice::<Value>(&output.stdout).expect("JSON")
    };
    let (shown, film, out) = (path("shown"), path("film"), path("out"));
    assert_eq!(line("sim", &shown, "3")["views"], 3);
    std::fs::create_dir(&film).expect("a folder");
    for (place, number) in (0..3).flat_map(|place| (0..15).map(move |number| (place, number))) {
        std::fs::copy(format!("{shown}/left{place:03}.png"), format!("{film}/{}.png", place * 15 + number))
            .expect("copied");
    }
    let captured = line(&film, &out, "9");
    // Whether a target that is shown on counts as news again is the watch's own affair.
    assert!(captured["views"].as_u64().expect("a count") >= 3, "{captured}");
    assert_eq!((&captured["complete"], &captured["lens"]), (&json!(false), &Value::Null));
}
