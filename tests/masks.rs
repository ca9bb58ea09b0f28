//! Masks as polygons and circles, by the command line: nothing is taken where they hide the view, and a bad one is told.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::path::{Path, PathBuf};

use common::pairs::{Work, refs, small_bench};
use common::{fails_with, run_json};
use vergence_calibration_input::{InputError, InputHash, Sought, views_in_images};
use vergence_camera::read_mask;
use vergence_rig::CameraMask;
use vergence_targets::{TargetKind, TargetSpec};
use vergence_vision::{BodyMask, ImageSize, Length, Pixel};

/// All outside a circle, and a wedge of the upper half of the image of 640 x 640 pixels.
const SHAPES: &str = "
[[shape]]
hides = \"outside\"
circle = [319.5, 319.5, 260]
[[shape]]
hides = \"inside\"
polygon = [[320, 330], [640, 100], [640, 330]]
";
const SIZE: ImageSize = ImageSize { width: 640, height: 640 };
const BOARD: TargetKind = TargetKind::Chessboard(TargetSpec { columns: 7, rows: 5, square: Length::from_mm(30.0) });

fn hidden(mask: &BodyMask, pixels: &[Pixel]) -> usize {
    pixels.iter().filter(|pixel| mask.hides(**pixel)).count()
}

/// Pixels of a cloud's points in the left and in the right image.
fn pixels(ply: &str) -> [Vec<Pixel>; 2] {
    let text = std::fs::read_to_string(ply).expect("a cloud");
    let (_, body) = text.split_once("end_header\n").expect("a header");
    let of = |at: usize| {
        let row = |line: &str| {
            let n: Vec<f64> = line.split(' ').map(|number| number.parse().expect("a number")).collect();
            Pixel { u: n[at], v: n[at + 1] }
        };
        body.lines().map(row).collect()
    };
    [of(6), of(8)]
}

#[test]
fn no_point_lies_where_a_mask_hides_it() {
    let work = Work::new();
    work.photograph(20.0, 3, ["left.png", "right.png"]);
    let (shapes, cloud) = (work.file("mask.toml"), work.file("out.ply"));
    std::fs::write(&shapes, SHAPES).expect("written");
    let mask = read_mask(Path::new(&shapes), SIZE).expect("a mask");
    let masks = ["--left-mask", &shapes, "--right-mask", &shapes];
    let sparse = |more: &[&str]| {
        run_json(&refs(&work.depth("left.png", "right.png", &[&["--json", "--ascii"], more].concat())));
        pixels(&cloud).map(|pixels| (hidden(&mask, &pixels), pixels.len()))
    };
    let ([left, right], [masked_left, masked_right]) = (sparse(&[]), sparse(&masks));
    println!("hidden points of all, left and right: {left:?} {right:?}, masked {masked_left:?} {masked_right:?}");
    assert!(left.0 > 20 && right.0 > 20 && masked_left.1 > 100);
    assert_eq!((masked_left.0, masked_right.0), (0, 0));

    let dense = |more: &[&str]| {
        run_json(&refs(&work.depth("left.png", "right.png", &[&["--json", "--dense", "--ascii"], more].concat())));
        let of_points = pixels(&cloud);
        assert!(of_points[0].len() > 1000 && (more.is_empty() || hidden(&mask, &of_points[0]) == 0), "points as text");
        let ranges = image::open(work.file("out-range.png")).expect("ranges").into_luma16();
        let measured = ranges.enumerate_pixels().filter(|(_, _, range)| range.0[0] > 0);
        let pixels: Vec<_> = measured.map(|(u, v, _)| Pixel { u: f64::from(u), v: f64::from(v) }).collect();
        (hidden(&mask, &pixels), pixels.len())
    };
    let (all, masked) = (dense(&[]), dense(&masks));
    println!("hidden pixels with a range of all: {all:?}, masked {masked:?}");
    assert!(all.0 > 1000 && masked.1 > 10_000);
    assert_eq!(masked.0, 0);
}

/// The images in `folder` in which the target is seen outside `mask`, and the number of all.
fn seen(folder: &Path, side: &str, mask: Option<&Path>) -> (Vec<Vec<Pixel>>, usize) {
    let entries = std::fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let is_of_side = |file: &PathBuf| file.file_name().is_some_and(|name| name.to_string_lossy().starts_with(side));
    let files: Vec<PathBuf> = entries.filter(is_of_side).collect();
    let mask = mask.map(|mask| CameraMask::File(mask.into()));
    let sought = Sought { target: &BOARD, hint: None, placed: false, mask: mask.as_ref() };
    let found =
        views_in_images::<InputError>(&files, sought, &mut InputHash::default(), &mut |_| Ok(())).expect("images");
    let corners = found.found().into_iter().map(|view| view.corners.iter().map(|corner| corner.pixel).collect());
    (corners.collect(), files.len())
}

/// Live views: no view is kept whose target the mask hides, and no corner of those that are kept is taken there.
#[test]
fn live_views_are_taken_outside_the_mask() {
    let work = Work::new();
    let (shapes, rig) = (work.file("mask.toml"), work.file("rig.toml"));
    std::fs::write(&shapes, SHAPES).expect("written");
    let mask = read_mask(Path::new(&shapes), SIZE).expect("a mask");
    let target = ["--corners", "7x5", "--square", "30mm", "--json"];
    let capture = |name: &str, more: &[&str]| {
        let out = work.file(name);
        let mono =
            ["--rig", &rig, "capture", "--cameras", "sim", "--mono", "--views", "12", "--frames", "60", "--out", &out];
        run_json(&[&mono[..], &target, more].concat());
        let (views, images) = seen(Path::new(&out), "left", None);
        let hides_all = |view: &&Vec<Pixel>| hidden(&mask, view) == view.len();
        (views.iter().filter(hides_all).count(), images)
    };
    let (all, masked) = (capture("all", &[]), capture("masked", &["--left-mask", &shapes]));
    println!("views with nothing but hidden corners, of all: {all:?}, masked {masked:?}");
    assert!(all.0 > 0 && masked.1 > 2);
    assert_eq!(masked.0, 0);
    let folder = work.file("masked");
    let (views, _) = seen(Path::new(&folder), "left", Some(Path::new(&shapes)));
    assert!(views.iter().all(|view| !view.is_empty() && hidden(&mask, view) == 0));
    let (views, _) = seen(Path::new(&folder), "left", None);
    assert!(views.iter().any(|view| hidden(&mask, view) > 0), "the mask had nothing to hide");

    let set = work.file("set");
    let live = ["--rig", &rig, "--port", "sim", "calibrate", "stage", "--live", "--cameras", "sim", "--set", &set];
    let brief = ["--poses", "4", "--views", "4", "--seed", "3", "--left-mask", &shapes];
    let out = work.file("stage.toml");
    run_json(&[&live[..], &brief, &target, &["--out", &out]].concat());
    let written = std::fs::read_to_string(&out).expect("a rig file");
    assert!(written.contains(&format!("mask = \"{shapes}\"")), "{written}");
    let (views, images) = seen(&Path::new(&set).join("pose01"), "left", None);
    assert!(images == 4 && views.iter().all(|view| hidden(&mask, view) < view.len()), "{images}");
}

#[test]
fn a_bad_mask_is_told_before_anything_is_measured() {
    let work = Work::new();
    work.photograph(0.0, 1, ["left.png", "right.png"]);
    let shapes = work.file("mask.toml");
    let polygon = |corners: &str| format!("[[shape]]\nhides = \"inside\"\npolygon = {corners}\n");
    for (text, words) in [
        (polygon("[[0, 0], [100, 0], [0, 100], [100, 100]]"), &["shape 1", "meet"][..]),
        (polygon("[[0, 0], [100, 0]]"), &["shape 1", "3 corners"]),
        (polygon("[[0, 0], [nan, 0], [0, 100]]"), &["shape 1", "not finite"]),
        (polygon("[[700, 0], [800, 0], [800, 100]]"), &["shape 1", "no pixel of an image of 640 x 640"]),
        (SHAPES.replace("hides", "keeps"), &["keeps"]),
    ] {
        std::fs::write(&shapes, text).expect("written");
        let words = [&["mask.toml"], words].concat();
        fails_with(&refs(&work.depth("left.png", "right.png", &["--left-mask", &shapes])), 2, &words);
        let zones = ["--rig", &work.file("rig.toml"), "zones", "--mode", "human", "--right-mask", &shapes];
        fails_with(&zones, 2, &words);
    }
    std::fs::write(&shapes, SHAPES).expect("written");
    let zones = |more: &[&str]| {
        run_json(&[&["--rig", &work.file("rig.toml"), "zones", "--mode", "human", "--json"], more].concat())
    };
    let share = |value: &serde_json::Value| value["solid_sr"]["stereo"].as_f64().expect("a solid angle");
    assert!(share(&zones(&["--left-mask", &shapes])) < 0.8 * share(&zones(&[])));
    assert_eq!(small_bench().left_camera.size(), SIZE);
}

/// The rig file of the bench with these keys of its left camera, next to `rig.toml` or in a folder of its own.
fn rig_with(work: &Work, name: &str, keys: &str) -> String {
    let (plain, path) = (std::fs::read_to_string(work.file("rig.toml")).expect("a rig file"), work.file(name));
    std::fs::create_dir_all(Path::new(&path).parent().expect("a folder")).expect("it is made");
    let at = plain.find("[left.camera]").expect("the left camera");
    std::fs::write(&path, [&plain[..at], keys, &plain[at..]].concat()).expect("written");
    path
}

/// A mask in the rig file is as good as the option: by its name from the file's folder, or with its shapes in the file.
#[test]
fn a_rig_file_names_masks_and_an_option_overrides_them() {
    let work = Work::new();
    work.photograph(20.0, 3, ["left.png", "right.png"]);
    let (shapes, cloud) = (work.file("mask.toml"), work.file("out.ply"));
    std::fs::write(&shapes, SHAPES).expect("written");
    let named = rig_with(&work, "rigs/named.toml", "[left]\nmask = \"../mask.toml\"\n");
    let inline = rig_with(&work, "inline.toml", &SHAPES.replace("[[shape]]", "[[left.mask]]"));
    let plain = work.file("rig.toml");
    let measured = |rig: &str, more: &[&str]| {
        let (left, right) = (work.file("left.png"), work.file("right.png"));
        let depth = ["--rig", rig, "depth", "--mode", "human", "--left", &left, "--right", &right, "--out", &cloud];
        run_json(&[&depth[..], &["--json"], more].concat());
        std::fs::read(&cloud).expect("a cloud")
    };
    let (unmasked, by_option) = (measured(&plain, &[]), measured(&plain, &["--left-mask", &shapes]));
    assert!(by_option.len() < unmasked.len());
    assert!(measured(&named, &[]) == by_option, "the mask by name");
    assert!(measured(&inline, &[]) == by_option, "the shapes");
    let nothing = work.file("nothing.png");
    image::GrayImage::from_pixel(640, 640, image::Luma([255])).save(&nothing).expect("written");
    assert!(measured(&inline, &["--left-mask", &nothing]) == unmasked, "the option hides nothing");

    let stereo = |rig: &str, more: &[&str]| {
        let value = run_json(&[&["--rig", rig, "zones", "--mode", "human", "--json"], more].concat());
        value["solid_sr"]["stereo"].as_f64().expect("a solid angle")
    };
    let by_option = stereo(&plain, &["--left-mask", &shapes]);
    for rig in [&named, &inline] {
        assert!((stereo(rig, &[]) - by_option).abs() < 1e-12 && by_option < 0.8 * stereo(&plain, &[]));
    }
}

/// `calibrate stage` takes no corner where the mask of its rig file hides it, and what it writes names the same mask.
#[test]
fn views_heed_the_mask_of_the_rig_file_and_a_calibration_keeps_it() {
    let work = Work::new();
    std::fs::write(work.file("mask.toml"), SHAPES).expect("written");
    let rig = rig_with(&work, "rig2.toml", "[left]\nmask = \"mask.toml\"\n");
    let target = ["--corners", "7x5", "--square", "30mm", "--json"];
    let (set, out) = (work.file("set"), work.file("found/stage.toml"));
    std::fs::create_dir_all(work.file("found")).expect("a folder");
    let live = ["--rig", &rig, "--port", "sim", "calibrate", "stage", "--live", "--cameras", "sim", "--set", &set];
    run_json(&[&live[..], &["--poses", "4", "--views", "4", "--seed", "3", "--out", &out], &target].concat());
    let mask = read_mask(Path::new(&work.file("mask.toml")), SIZE).expect("a mask");
    let (views, images) = seen(&Path::new(&set).join("pose01"), "left", None);
    assert!(images == 4 && views.iter().all(|view| hidden(&mask, view) < view.len()), "{images}");
    let written = std::fs::read_to_string(&out).expect("a rig file");
    let whole = std::path::absolute(work.file("mask.toml")).expect("a name");
    assert!(written.contains(&format!("mask = \"{}\"", whole.display())), "{written}");
    let right = ["zones", "--mode", "human", "--json"];
    run_json(&[&["--rig", &out], &right[..]].concat());

    let folder = work.file("masked");
    let mono = ["--rig", &rig, "capture", "--cameras", "sim", "--mono", "--views", "12", "--frames", "60"];
    run_json(&[&mono[..], &["--out", &folder], &target].concat());
    let (views, images) = seen(Path::new(&folder), "left", None);
    assert!(images > 2 && views.iter().all(|view| hidden(&mask, view) < view.len()), "{images}");
}

#[test]
fn a_bad_mask_in_a_rig_file_is_told() {
    let work = Work::new();
    work.photograph(0.0, 1, ["left.png", "right.png"]);
    image::GrayImage::new(320, 640).save(work.file("narrow.png")).expect("written");
    let bad_shape = "[[left.mask]]\nhides = \"inside\"\npolygon = [[0, 0], [100, 0]]\n";
    let unknown = "[[left.mask]]\nhides = \"inside\"\nsquare = [1, 2, 3]\n";
    for (keys, words) in [
        ("[left]\nmask = \"missing.png\"\n", &["missing.png"][..]),
        ("[left]\nmask = \"narrow.png\"\n", &["narrow.png", "320 x 640", "640 x 640"]),
        ("[left]\nmask = 3\n", &["bad.toml", "mask = 3", "name of a mask's file, or shapes"]),
        (bad_shape, &["bad.toml", "[[left.mask]]", "shape 1", "3 corners"]),
        (unknown, &["bad.toml", "unknown field `square`"]),
    ] {
        let rig = rig_with(&work, "bad.toml", keys);
        fails_with(&["--rig", &rig, "zones", "--mode", "human"], 2, words);
        let (left, right, out) = (work.file("left.png"), work.file("right.png"), work.file("out.ply"));
        let depth = ["--rig", &rig, "depth", "--mode", "human", "--left", &left, "--right", &right, "--out", &out];
        fails_with(&depth, 2, words);
    }
}
