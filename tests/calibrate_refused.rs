//! What `vergence calibrate` tells of input that it cannot use: a sentence, an exit code, and no file.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::path::Path;

use common::cameras::camera_files;
use common::{fails_with, real_data};

/// What a pair is told of cameras and corners that cannot be used.
#[test]
fn bad_pairs_are_refused_and_leave_no_file() {
    let Some(folder) = real_data("data/sourishg_stereo") else { return };
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let [left, right] = camera_files(&folder, work.path());
    let csv = folder.join("corners_opencv_classic.csv").to_string_lossy().into_owned();
    let (out, page, bad) = (file("rig.toml"), file("report.html"), file("bad.toml"));
    let refused = |cameras: [&str; 2], csv: &str, more: &[&str], code: i32, words: &[&str]| {
        let pair = ["calibrate", "extrinsics", "--left", cameras[0], "--right", cameras[1], "--csv", csv];
        fails_with(&[&pair[..], &["--out", &out, "--report", &page], more].concat(), code, words);
        assert!(!Path::new(&out).exists() && !Path::new(&page).exists());
    };
    let text = std::fs::read_to_string(&left).expect("a camera file");
    let line = |key: &str| text.lines().find(|line| line.starts_with(key)).expect("a key").to_owned();
    std::fs::write(&bad, text.replace(&line("opencv_k1"), "opencv_k1 = -0.9")).expect("written");
    refused([&bad, &right], &csv, &[], 2, &["bad.toml", "turns over"]);
    std::fs::write(&bad, text.replace(&line("fx"), "fx = nan")).expect("written");
    refused([&bad, &right], &csv, &[], 2, &["bad.toml"]);
    refused([&left, &file("none.toml")], &csv, &[], 2, &["none.toml"]);
    refused([&left, &right], &csv, &["--cameras", "left", "top"], 2, &["top", "left, right"]);
    let rows = std::fs::read_to_string(&csv).expect("corners");
    let (few, wild) = (file("few.csv"), file("wild.csv"));
    let header = rows.lines().next().expect("a header");
    let of_frame = |frame: &str| rows.lines().filter(|row| row.split(',').nth(2) == Some(frame)).collect::<Vec<_>>();
    std::fs::write(&few, [&[header], &of_frame("1")[..]].concat().join("\n")).expect("written");
    refused([&left, &right], &few, &[], 2, &["1 views", "3"]);
    // The right camera's corners in another order: good data that nothing fits.
    let shuffled: Vec<String> = rows
        .lines()
        .map(|row| match row.strip_prefix("right,") {
            Some(rest) => {
                let cells: Vec<&str> = rest.split(',').collect();
                let index: usize = cells[2].parse().expect("an index");
                let other = (index * 7 + 3) % 54;
                let (x, y) = (24.23 * (other % 9) as f64, 24.23 * (other / 9) as f64);
                format!("right,{},{},{index},{},{},{x},{y}", cells[0], cells[1], cells[3], cells[4])
            }
            None => row.to_owned(),
        })
        .collect();
    std::fs::write(&wild, shuffled.join("\n")).expect("written");
    let output =
        common::run(&["calibrate", "extrinsics", "--left", &left, "--right", &right, "--csv", &wild, "--out", &out]);
    let said = common::text(&output.stderr);
    println!("{said}");
    assert!(matches!(output.status.code(), Some(1 | 2)) && said.lines().count() == 1, "{said}");
    assert!(!Path::new(&out).exists());
}

/// Corners of a target that is seen from straight ahead, at `distances`.
fn frontal_csv(distances: &[f64]) -> String {
    let mut csv = String::from("camera,file,frame,idx,x,y,bx_mm,by_mm\n");
    for (frame, distance) in distances.iter().enumerate() {
        for index in 0..54u32 {
            let (x, y) = (f64::from(index % 9) * 20.0, f64::from(index / 9) * 20.0);
            let (u, v) = (480.0 + 230.0 * (x - 80.0) / distance, 300.0 + 230.0 * (y - 50.0) / distance);
            csv += &format!("cam,view{frame}.png,{frame},{index},{u},{v},{x},{y}\n");
        }
    }
    csv
}

#[test]
fn bad_corners_are_refused_and_leave_no_file() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (csv, out) = (file("corners.csv"), file("cam.toml"));
    let several = frontal_csv(&[300.0, 350.0, 400.0, 500.0]);
    let cases = [
        (frontal_csv(&[300.0]), "1 view"),
        (several.clone(), "parallel"),
        (several.replacen(",0,480", ",0,NaN", 1).replacen("view0.png,0,0,", "view0.png,0,0,NaN", 1), "corners.csv"),
        (format!("{several}{}", several.lines().nth(1).expect("a row")), "same place"),
        ("camera,file,frame,idx,x,y\n".to_owned(), "corners"),
        ("nothing".to_owned(), "corners"),
    ];
    for (text, word) in cases {
        std::fs::write(&csv, text).expect("written");
        let arguments = ["calibrate", "intrinsics", "--csv", &csv, "--size", "960x600", "--out", &out];
        fails_with(&arguments, 2, &[word]);
        assert!(!Path::new(&out).exists());
    }
    std::fs::write(&csv, several).expect("written");
    fails_with(&["calibrate", "intrinsics", "--csv", &csv, "--size", "960", "--out", &out], 2, &["960x600"]);
    fails_with(
        &["calibrate", "intrinsics", "--csv", &csv, "--size", "960x600", "--camera", "front"],
        2,
        &["front", "cam"],
    );
    fails_with(
        &["calibrate", "intrinsics", "--images", "/nowhere/*.png", "--corners", "9x6", "--square", "20mm"],
        2,
        &["/nowhere"],
    );
    fails_with(
        &["capture", "--cameras", "/dev/none", "--corners", "9x6", "--square", "20mm", "--out", &file("set")],
        3,
        &["/dev/none"],
    );
}

#[test]
fn images_without_a_target_or_of_two_sizes_are_told() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let grey = |name: &str, width| {
        image::RgbImage::from_pixel(width, 200, image::Rgb([90; 3])).save(file(name)).expect("a picture");
    };
    grey("a0.png", 300);
    grey("a1.png", 300);
    let target = ["--corners", "9x6", "--square", "20mm"];
    let pattern = file("a*.png");
    let arguments = [&["calibrate", "intrinsics", "--images", &pattern], &target[..]].concat();
    fails_with(&arguments, 2, &["no target", "2 images"]);
    grey("a2.png", 310);
    fails_with(&arguments, 2, &["a2.png", "310 x 200"]);
}

/// A wrong cell is named by the line that an editor shows, with Windows line ends and blank lines too.
#[test]
fn a_wrong_cell_is_named_by_its_line() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let (csv, out) = (file("corners.csv"), file("cam.toml"));
    let good = frontal_csv(&[300.0]);
    // The header is line 1.
    let wrong: Vec<String> = good
        .lines()
        .enumerate()
        .map(
            |(index, line)| {
                if index == 10 { line.replacen("cam,view0.png,0", "cam,view0.png,x", 1) } else { line.into() }
            },
        )
        .collect();
    for (text, line) in [
        (wrong.join("\n"), "line 11: column frame"),
        (wrong.join("\r\n"), "line 11: column frame"),
        (wrong.join("\n\n"), "line 21: column frame"),
    ] {
        std::fs::write(&csv, text).expect("written");
        fails_with(&["calibrate", "intrinsics", "--csv", &csv, "--size", "960x600", "--out", &out], 2, &[line]);
    }
    let short = format!("{good}cam,view0.png\n");
    std::fs::write(&csv, short).expect("written");
    let arguments = ["calibrate", "intrinsics", "--csv", &csv, "--size", "960x600", "--out", &out];
    fails_with(&arguments, 2, &["line 56: it has 2 columns"]);
}

/// Folders are taken as sets; damaged images and those without a partner are left out with a word.
#[test]
fn damaged_images_and_gaps_in_folders_are_left_out_with_a_word() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    for folder in ["left", "right"] {
        std::fs::create_dir(file(folder)).expect("a folder");
    }
    for name in ["left/left0.png", "left/left1.png", "left/left2.png", "right/right0.png", "right/right2.png"] {
        chessboard(&file(name), 9, 6);
    }
    let whole = std::fs::read(file("left/left2.png")).expect("an image");
    std::fs::write(file("left/left2.png"), &whole[..whole.len() / 2]).expect("written");
    let target = ["--corners", "9x6", "--square", "20mm"];
    let left = file("left");
    // Frontal views give no calibration, but the damaged one is no reason to stop.
    let arguments = [&["calibrate", "intrinsics", "--force", "--images", &left], &target[..]].concat();
    fails_with(&arguments, 2, &["left2.png: left out", "the same photograph", "no calibration"]);
    std::fs::write(file("damaged.png"), &whole[..100]).expect("written");
    let damaged = file("damaged.png");
    let arguments = [&["calibrate", "intrinsics", "--images", &damaged], &target[..]].concat();
    fails_with(&arguments, 2, &["none of 1 images can be read", "damaged.png"]);
    std::fs::copy(file("right/right0.png"), file("left/right0.png")).expect("copied");
    let arguments = [&["calibrate", "intrinsics", "--images", &left], &target[..]].concat();
    fails_with(&arguments, 2, &["images of both cameras"]);
    std::fs::remove_file(file("left/right0.png")).expect("removed");
    let cameras = plain_cameras(&work);
    let (right, cameras) = (file("right"), cameras.each_ref().map(String::as_str));
    let pair = ["calibrate", "extrinsics", "--left", cameras[0], "--right", cameras[1]];
    let images = ["--left-images", &left, "--right-images", &right];
    fails_with(&[&pair[..], &images, &target].concat(), 2, &["left1.png: left out: the other camera"]);
}

/// Camera files with the image size of the chessboards of these tests.
fn plain_cameras(work: &tempfile::TempDir) -> [String; 2] {
    ["left.toml", "right.toml"].map(|name| {
        let path = work.path().join(name).to_string_lossy().into_owned();
        let lens = "fx = 200.0\nfy = 200.0\ncx = 209.5\ncy = 164.5\n";
        let distortion = "opencv_k1 = 0.0\nopencv_k2 = 0.0\nopencv_k3 = 0.0\nopencv_k4 = 0.0\n";
        std::fs::write(&path, format!("[camera]\nsize = [420, 330]\n{lens}{distortion}")).expect("written");
        path
    })
}

/// A chessboard of `columns` x `rows` inner corners, seen from straight ahead.
fn chessboard(path: &str, columns: u32, rows: u32) {
    let square = |x: u32, y: u32| (x / 30 + y / 30).is_multiple_of(2);
    let picture = image::RgbImage::from_fn(30 * (columns + 5), 30 * (rows + 5), |x, y| {
        let inside = (60..60 + 30 * (columns + 1)).contains(&x) && (60..60 + 30 * (rows + 1)).contains(&y);
        image::Rgb([if inside && square(x, y) { 20 } else { 230 }; 3])
    });
    image::imageops::blur(&picture, 0.8).save(path).expect("a picture");
}

#[test]
fn a_target_of_another_size_is_told() {
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    for name in ["a0.png", "a1.png"] {
        chessboard(&file(name), 11, 8);
    }
    let (pattern, out) = (file("a*.png"), file("cam.toml"));
    let arguments = ["calibrate", "intrinsics", "--images", &pattern, "--square", "20mm", "--out", &out, "--corners"];
    fails_with(&[&arguments[..], &["7x5"]].concat(), 2, &["11 × 8", "7 × 5"]);
    // The right size, but the same frontal view twice.
    fails_with(&[&arguments[..], &["11x8"]].concat(), 2, &["a0.png", "a1.png", "the same photograph"]);
    fails_with(&[&arguments[..], &["11x8", "--force"]].concat(), 2, &["the same photograph", "no calibration"]);
    assert!(!Path::new(&out).exists());
}

/// Corners that are there, but nowhere near a target: the data can be read and the result is no good.
#[test]
fn a_fit_that_fails_its_own_check_is_exit_code_1() {
    let Some(folder) = real_data("data/sourishg_stereo") else { return };
    let work = tempfile::tempdir().expect("a temporary folder");
    let file = |name: &str| work.path().join(name).to_string_lossy().into_owned();
    let rows = std::fs::read_to_string(folder.join("corners_opencv_classic.csv")).expect("corners");
    let shaken: Vec<String> = rows
        .lines()
        .enumerate()
        .map(|(line, row)| {
            let mut cells: Vec<String> = row.split(',').map(str::to_owned).collect();
            if line > 0 {
                for (cell, stride) in [(4, 37), (5, 61)] {
                    let shift = (line * stride % 41) as f64 - 20.0;
                    cells[cell] = format!("{}", cells[cell].parse::<f64>().expect("a number") + shift * 0.6);
                }
            }
            cells.join(",")
        })
        .collect();
    let (csv, out, page) = (file("shaken.csv"), file("cam.toml"), file("report.html"));
    std::fs::write(&csv, shaken.join("\n")).expect("written");
    let arguments = ["calibrate", "intrinsics", "--csv", &csv, "--camera", "left", "--size", "960x600"];
    fails_with(&[&arguments[..], &["--out", &out, "--report", &page]].concat(), 1, &["px off"]);
    assert!(!Path::new(&out).exists() && !Path::new(&page).exists());
}
