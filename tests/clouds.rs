//! The verbs that make clouds: names of their files, their pictures, what they warn of, and how they end when interrupted.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a test fails loudly, shows its figures and waits for another process"
)]

mod common;

use std::io::Read;
use std::path::Path;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use common::{fails_with, run, run_json, signal, text, vergence};
use nalgebra::{Rotation3, Vector3};

/// Two equal cameras with an equidistant lens of `focal` pixels per radian, 100 mm apart.
fn rig(side: u32, focal: f64) -> String {
    let middle = f64::from(side - 1) / 2.0;
    let camera = |name: &str| {
        format!(
            "[{name}.camera]\nsize = [{side}, {side}]\nfx = {focal:?}\nfy = {focal:?}\ncx = {middle:?}\ncy = {middle:?}\n\
             opencv_k1 = 0.0\nopencv_k2 = 0.0\nopencv_k3 = 0.0\nopencv_k4 = 0.0\n"
        )
    };
    format!(
        "name = \"pair\"\n[calibration_sigma]\nrotation = \"0.1deg\"\ntranslation = \"1mm\"\n{}{}\
         [right.at_zero]\norigin = [\"100mm\", \"0mm\", \"0mm\"]\n\
         rotation_vector = [\"0deg\", \"0deg\", \"0deg\"]\n",
        camera("left"),
        camera("right")
    )
}

/// A picture with texture everywhere, the same for the same seed.
fn texture(side: u32) -> image::RgbImage {
    image::RgbImage::from_fn(side, side, |x, y| {
        let value = (x / 3).wrapping_mul(2_654_435_761) ^ (y / 3).wrapping_mul(40_503);
        image::Rgb([(value >> 7) as u8; 3])
    })
}

/// A folder with a rig of small cameras, a pair of equal pictures and correspondences of 60 points, seen by a right camera
/// that is pitched by `pitch_deg` against the rig file.
struct Workshop(tempfile::TempDir);

impl Workshop {
    const SIDE: u32 = 96;
    const FOCAL: f64 = 40.0;

    fn new(pitch_deg: f64) -> Self {
        let shop = Self(tempfile::tempdir().expect("a temporary folder"));
        std::fs::write(shop.file("rig.toml"), rig(Self::SIDE, Self::FOCAL)).expect("written");
        texture(Self::SIDE).save(shop.file("grey.png")).expect("written");
        let right_from_left = Rotation3::from_axis_angle(&Vector3::x_axis(), pitch_deg.to_radians());
        let pixel = |p: Vector3<f64>| {
            let (across, middle) = (p.x.hypot(p.y), f64::from(Self::SIDE - 1) / 2.0);
            let radius = Self::FOCAL * across.atan2(p.z);
            format!("{},{}", middle + radius * p.x / across, middle + radius * p.y / across)
        };
        let rows = (0..60).map(|i| {
            let (x, y) = (f64::from(i % 10) * 60.0 - 220.0, f64::from(i / 10) * 90.0 - 215.0);
            let left = Vector3::new(x, y, 400.0 + f64::from(i % 7) * 40.0);
            format!("{},{}\n", pixel(left), pixel(right_from_left * (left - Vector3::new(100.0, 0.0, 0.0))))
        });
        std::fs::write(shop.file("pairs.csv"), format!("u_left,v_left,u_right,v_right\n{}", rows.collect::<String>()))
            .expect("written");
        shop
    }

    fn file(&self, name: &str) -> String {
        self.0.path().join(name).to_string_lossy().into_owned()
    }

    fn depth(&self, out: &str) -> Vec<String> {
        let [rig, grey, out] = ["rig.toml", "grey.png", out].map(|name| self.file(name));
        ["depth", "--rig", &rig, "--left", &grey, "--right", &grey, "--out", &out].map(ToOwned::to_owned).into()
    }
}

fn with<'a>(arguments: &'a [String], more: &[&'a str]) -> Vec<&'a str> {
    arguments.iter().map(String::as_str).chain(more.iter().copied()).collect()
}

#[test]
fn a_name_that_says_another_format_is_refused() {
    let shop = Workshop::new(0.0);
    fails_with(&with(&shop.depth("cloud.xyz"), &[]), 2, &["cloud.xyz", "'.xyz' is not written", ".ply"]);
    fails_with(&with(&shop.depth("cloud.las"), &["--ascii"]), 2, &[".las has no form as text", "--ascii"]);
    fails_with(&with(&shop.depth("cloud"), &[]), 2, &["has no ending", ".ply"]);
    let matches = shop.file("matches.pdf");
    fails_with(&with(&shop.depth("cloud.ply"), &["--matches", &matches]), 2, &["'.pdf' is not written", ".svg"]);
    let out = shop.file("cloud.ply");
    fails_with(&["--port", "sim", "run", "--cameras", "sim", "--out", &out], 2, &["cloud.ply", "a folder"]);
    assert_eq!(std::fs::read_dir(shop.0.path()).expect("a folder").count(), 3, "only the inputs are there");
}

#[test]
fn the_match_picture_counts_as_the_table_does() {
    let shop = Workshop::new(0.0);
    let (pairs, matches) = (shop.file("pairs.csv"), shop.file("matches.svg"));
    let result = run_json(&with(&shop.depth("cloud.ply"), &["--json", "--points", &pairs, "--matches", &matches]));
    let drawing = std::fs::read_to_string(&matches).expect("a drawing");
    assert!(drawing.starts_with("<svg") && drawing.trim_end().ends_with("</svg>"));
    let points = result["points"].as_u64().expect("a count");
    assert!(points >= 10 && drawing.matches("<circle").count() as u64 == 2 * points, "{result}");
    assert!(drawing.contains(&format!("range of {points} points of {} matches", result["matches"])), "{result}");
}

/// A rig without axes has no encoders that could disagree; results and warnings do not mix.
#[test]
fn a_pose_that_the_images_contradict_is_a_warning_on_standard_error() {
    let shop = Workshop::new(2.0);
    let pairs = shop.file("pairs.csv");
    let output = run(&with(&shop.depth("cloud.ply"), &["--points", &pairs]));
    let (said, warned) = (text(&output.stdout), text(&output.stderr));
    assert!(warned.contains("the pose in the rig file and the images disagree by"), "{said}{warned}");
    assert!(!said.contains("disagree") && !warned.contains("encoder"), "{said}{warned}");
    let fits = Workshop::new(0.0);
    let output = run(&with(&fits.depth("cloud.ply"), &["--points", &fits.file("pairs.csv")]));
    assert!(!text(&output.stderr).contains("disagree"), "{}", text(&output.stderr));
}

/// Interrupts `process` as soon as `file` is there; what it said on standard error, its exit code, and how long it took to end.
fn interrupted_after(mut process: Child, file: &Path) -> (String, Option<i32>, Duration) {
    let patience = Instant::now() + Duration::from_secs(240);
    while !file.exists() {
        assert!(Instant::now() < patience && process.try_wait().expect("a process").is_none(), "no {}", file.display());
        std::thread::sleep(Duration::from_millis(5));
    }
    let asked = Instant::now();
    signal(process.id(), "-INT");
    let ended = process.wait().expect("it ends");
    let took = asked.elapsed();
    let mut said = String::new();
    process.stderr.take().expect("piped").read_to_string(&mut said).expect("text");
    println!("{took:?} {said}");
    (said, ended.code(), took)
}

fn started(arguments: &[&str]) -> Child {
    vergence(arguments).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the binary runs")
}

#[test]
fn an_interrupted_demo_ends_within_a_second_and_says_what_is_left() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let demo = started(&["demo", "--out", folder.path().to_str().expect("a name")]);
    let (said, code, took) = interrupted_after(demo, &folder.path().join("herbivore.ply"));
    assert!(said.contains("interrupted:") && said.contains("of 2 modes are measured"), "{said}");
    assert_eq!(code, Some(3));
    assert!(took < Duration::from_secs(1), "{took:?}");
}

#[test]
fn an_interrupted_depth_ends_within_a_second_and_says_what_is_left() {
    const SIDE: u32 = 800;
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| folder.path().join(name);
    let name = |path: &Path| path.to_string_lossy().into_owned();
    std::fs::write(file("rig.toml"), rig(SIDE, 260.0)).expect("written");
    for side in ["left", "right"] {
        std::fs::create_dir(file(side)).expect("a folder");
        for number in 0..4 {
            texture(SIDE).save(file(side).join(format!("{number}.png"))).expect("written");
        }
    }
    let [rig, left, right, out] = ["rig.toml", "left", "right", "clouds"].map(|path| name(&file(path)));
    let depth =
        started(&["depth", "--dense", "--force", "--rig", &rig, "--left", &left, "--right", &right, "--out", &out]);
    let (said, code, took) = interrupted_after(depth, &file("clouds").join("0-preview.svg"));
    assert!(said.contains("interrupted:") && said.contains("run the command again"), "{said}");
    assert_eq!(code, Some(3));
    assert!(took < Duration::from_secs(1), "{took:?}");
}
