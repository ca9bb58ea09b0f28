//! Photographs as they come: sequences of other programs, 16 bits, ranges and masks that a person names. The room is rendered.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::path::Path;

use common::pairs::{Work, refs};
use common::{fails_with, run, run_json, text};
use image::{GrayImage, ImageBuffer, Luma, Rgb};

/// Range and left pixel of every point of a cloud that `depth` made with `more`.
fn points(work: &Work, more: &[&str]) -> Vec<(f64, [f64; 2])> {
    run_json(&refs(&work.depth("one.png", "two.png", &[&["--json", "--also", "csv"], more].concat())));
    let mut table = csv::Reader::from_path(work.file("out.csv")).expect("a table");
    let headers = table.headers().expect("a header").clone();
    let column = |name: &str| headers.iter().position(|header| header == name).expect("a column");
    let columns = ["x_mm", "y_mm", "z_mm", "u_left", "v_left"].map(column);
    let row = |row: csv::StringRecord| {
        let [x, y, z, u, v] = columns.map(|column| row[column].parse::<f64>().expect("a number"));
        ((x * x + y * y + z * z).sqrt(), [u, v])
    };
    table.records().map(|record| row(record.expect("a row"))).collect()
}

#[test]
fn points_are_sought_between_the_ranges_and_beside_the_masks_that_are_named() {
    let work = Work::new();
    work.photograph(0.0, 1, ["one.png", "two.png"]);
    let all = points(&work, &[]);
    let near = all.iter().filter(|(range, _)| *range < 1200.0).count();
    let upper = all.iter().filter(|(_, [_, v])| *v < 320.0).count();
    println!("{} points, {near} within 1.2 m, {upper} in the upper half", all.len());
    assert!(near > 50 && all.len() - near > 50 && upper > 50 && all.len() - upper > 50);
    assert!(points(&work, &["--farthest", "1.2m"]).iter().all(|(range, _)| *range <= 1200.0));
    let far = points(&work, &["--nearest", "1.2m"]);
    // The tolerance of a position widens the band by a little.
    assert!(far.len() > 50 && far.iter().all(|(range, _)| *range > 1050.0), "{far:?}");

    let half = GrayImage::from_fn(640, 640, |_, y| Luma([if y < 320 { 0 } else { 255 }]));
    half.save(work.file("half.png")).expect("a mask");
    let mask = work.file("half.png");
    let lower = points(&work, &["--left-mask", &mask]);
    assert!(lower.len() > 50 && lower.iter().all(|(_, [_, v])| *v >= 319.5));
    // Rows of the same height in both images: what the right camera does not see has no partner.
    let lower = points(&work, &["--right-mask", &mask]);
    assert!(lower.len() > 50 && lower.iter().all(|(_, [_, v])| *v >= 310.0));

    run_json(&refs(&work.depth(
        "one.png",
        "two.png",
        &["--json", "--dense", "--left-mask", &mask, "--farthest", "1.2m"],
    )));
    let ranges = image::open(work.file("out-range.png")).expect("a range image").into_luma16();
    let measured = |range: u16| range != 0 && range != 65535;
    assert!(ranges.enumerate_pixels().all(|(_, y, range)| y >= 318 || range.0 == [0]));
    let lower = ranges.pixels().filter(|range| measured(range.0[0])).count();
    assert!(lower > 10_000 && ranges.pixels().all(|range| !measured(range.0[0]) || range.0[0] <= 1200), "{lower}");

    GrayImage::new(64, 64).save(work.file("small.png")).expect("a mask");
    let small = work.file("small.png");
    let refused = |more: &[&str], words: &[&str]| fails_with(&refs(&work.depth("one.png", "two.png", more)), 2, words);
    refused(&["--left-mask", &small], &["small.png", "64 x 64", "640 x 640"]);
    refused(&["--nearest", "0mm"], &["--nearest", "positive"]);
    refused(&["--nearest", "2m", "--farthest", "1m"], &["leaves nothing"]);
}

#[test]
fn a_sequence_of_another_program_is_read_as_it_is() {
    let work = Work::new();
    let [first, second] = ["mav0/cam0/data/1403636579763555584.png", "mav0/cam1/data/1403636579763556000.png"];
    work.photograph(0.0, 1, [first, second]);
    for (from, copy) in
        [(first, "mav0/cam0/data/1403636579813555456.png"), (second, "mav0/cam1/data/1403636579863555584.png")]
    {
        std::fs::copy(work.file(from), work.file(copy)).expect("a copy");
    }
    std::fs::write(work.file("mav0/cam0/data.csv"), "#timestamp [ns],filename\n").expect("a table");
    let mut command = work.depth("mav0/cam0", "mav0/cam1", &["--json"]);
    let clouds = work.file("clouds");
    let out = command.iter().position(|word| *word == work.file("out.ply")).expect("an output");
    command[out].clone_from(&clouds);
    let output = run(&refs(&command));
    let said = text(&output.stderr);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("813555456.png: left out") && said.contains("863555584.png: left out"), "{said}");
    let names: Vec<_> =
        std::fs::read_dir(&clouds).expect("clouds").map(|entry| entry.expect("a file").file_name()).collect();
    assert_eq!(names, ["1403636579763555584.ply"]);
}

/// 12 bits in a file of 16, as cameras write them, and the full 16 bits give the cloud of 8 bits.
#[test]
fn sixteen_bits_are_read_as_far_as_they_are_used() {
    let work = Work::new();
    work.photograph(0.0, 1, ["one.png", "two.png"]);
    let eight = points(&work, &[]);
    for shift in [4, 8] {
        for name in ["one.png", "two.png"] {
            let path = work.0.path().join(name);
            let image = image::open(&path).expect("a photograph").into_rgb8();
            std::fs::copy(&path, work.file(&format!("kept-{name}"))).expect("a copy");
            let deep: ImageBuffer<Rgb<u16>, Vec<u16>> = ImageBuffer::from_fn(640, 640, |x, y| {
                Rgb(image.get_pixel(x, y).0.map(|sample| u16::from(sample) << shift))
            });
            deep.save(&path).expect("written");
        }
        assert_eq!(points(&work, &[]), eight);
        for name in ["one.png", "two.png"] {
            std::fs::rename(work.file(&format!("kept-{name}")), work.file(name)).expect("renamed");
        }
    }
}

#[test]
fn a_mask_hides_corners() {
    let work = Work::new();
    let board = GrayImage::from_fn(420, 330, |x, y| {
        let inside = (60..360).contains(&x) && (60..270).contains(&y);
        Luma([if inside && (x / 30 + y / 30).is_multiple_of(2) { 20 } else { 230 }])
    });
    image::imageops::blur(&board, 0.8).save(work.file("board.png")).expect("a picture");
    GrayImage::new(420, 330).save(work.file("black.png")).expect("a mask");
    let [image, mask] = ["board.png", "black.png"].map(|name| work.file(name));
    let arguments = ["calibrate", "intrinsics", "--images", &image, "--corners", "9x6", "--square", "20mm"];
    fails_with(&arguments, 2, &["no calibration", "1 view"]);
    fails_with(&[&arguments[..], &["--mask", &mask]].concat(), 2, &["the mask hides the whole target"]);
    fails_with(&[&arguments[..], &["--mask", &work.file("none.png")]].concat(), 2, &["none.png"]);
}

/// Simulated cameras have the size of the rig file: settings that would do nothing are refused.
#[test]
fn settings_of_attached_cameras_are_refused_beside_simulated_ones() {
    let work = Work::new();
    let (out, target) = (work.file("set"), ["--corners", "9x6", "--square", "20mm"]);
    let size = ["--size", "320x240"];
    let capture = [&["capture", "--cameras", "sim", "--out", &out][..], &target, &size].concat();
    fails_with(&capture, 2, &["--size is for attached cameras"]);
    let exposure = [&["capture", "--cameras", "sim", "--out", &out][..], &target, &["--exposure", "5ms"]].concat();
    fails_with(&exposure, 2, &["--exposure is for attached cameras"]);
    let run = ["run", "--port", "sim", "--cameras", "sim", "--home"];
    fails_with(&[&run[..], &["--gain", "2"]].concat(), 2, &["--gain is for attached"]);
    fails_with(&[&run[..], &size].concat(), 2, &["another shape", "320x320"]);
    let stage = ["calibrate", "stage", "--live", "--port", "sim", "--cameras", "sim", "--set", &out];
    fails_with(&[&stage[..], &target, &size].concat(), 2, &["--size is for attached"]);
    assert!(!Path::new(&out).exists());
}
