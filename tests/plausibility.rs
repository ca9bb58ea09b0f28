//! Input that is well formed and cannot be meant: every check of plausibility refuses it, at the command line, and honest input
//! passes. The photographs are rendered, the corners are computed.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::path::Path;

use common::pairs::{Work, corner_rows, human, refs, small_bench, write_rig};
use common::{fails_with, run, run_json, text};
use vergence_rig::Rig;
use vergence_vision::Transform;

/// `depth` refuses the pair, sparse and dense, and writes nothing.
fn depth_refuses(work: &Work, left: &str, right: &str, code: i32, words: &[&str]) {
    for more in [&[][..], &["--dense"]] {
        let command = work.depth(left, right, more);
        fails_with(&refs(&command), code, words);
        assert!(!Path::new(&work.file("out.ply")).exists(), "{command:?} wrote a cloud");
    }
}

/// `calibrate` refuses this, and writes nothing.
fn calibrate_refuses(work: &Work, arguments: &[&str], code: i32, words: &[&str]) {
    let out = work.file("calibration.toml");
    fails_with(&[&["calibrate"], arguments, &["--out", &out]].concat(), code, words);
    assert!(!Path::new(&out).exists(), "{arguments:?} wrote a calibration");
}

#[test]
fn photographs_that_are_no_pair_make_no_cloud() {
    let work = Work::new();
    work.photograph(0.0, 1, ["one.png", "two.png"]);
    work.photograph(150.0, 7, ["other-one.png", "other-two.png"]);
    for more in [&["--json"][..], &["--json", "--dense"]] {
        let honest = run_json(&refs(&work.depth("one.png", "two.png", more)));
        assert!(honest["points"].as_u64().is_some_and(|points| points > 300), "{honest}");
    }
    std::fs::remove_file(work.file("out.ply")).expect("the honest cloud");
    depth_refuses(&work, "two.png", "one.png", 1, &["are left and right swapped?", "keypoints", "--force"]);
    let forced = run(&refs(&work.depth("two.png", "one.png", &["--force"])));
    assert!(forced.status.success() && text(&forced.stderr).contains("swapped?"), "{}", text(&forced.stderr));
    std::fs::remove_file(work.file("out.ply")).expect("a person insisted on a cloud");
    depth_refuses(&work, "one.png", "other-two.png", 1, &["were not taken together", "keypoints"]);
    depth_refuses(&work, "one.png", "one.png", 2, &["the same photograph"]);
    std::fs::copy(work.file("one.png"), work.file("right0.png")).expect("a copy");
    std::fs::copy(work.file("two.png"), work.file("left0.png")).expect("a copy");
    fails_with(&refs(&work.depth("right0.png", "left0.png", &[])), 1, &["right0.png", "are they swapped?"]);
}

#[test]
fn folders_pair_by_their_names_and_never_by_their_order() {
    let work = Work::new();
    work.photograph(0.0, 1, ["left/left21.png", "right/right21.png"]);
    work.photograph(90.0, 3, ["left/left22.png", "right/right20.png"]);
    let clouds = work.file("clouds");
    let mut command = work.depth("left", "right", &["--json"]);
    let out = command.iter().position(|word| *word == work.file("out.ply")).expect("an output");
    command[out].clone_from(&clouds);
    let output = run(&refs(&command));
    let said = text(&output.stderr);
    assert!(
        output.status.success() && said.contains("left22.png: left out") && said.contains("right20.png: left out"),
        "{said}"
    );
    let result: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(result["pairs"].as_array().map(Vec::len), Some(1), "{result}");
    assert_eq!(result["left_out"].as_array().map(Vec::len), Some(2), "{result}");
    let written = std::fs::read_dir(&clouds).expect("a folder").count();
    assert_eq!(written, 1);
    // A pair that is none is left out too, and the others are kept.
    std::fs::rename(work.file("right/right20.png"), work.file("right/right22.png")).expect("renamed");
    work.photograph(-60.0, 5, ["left/left23.png", "elsewhere/x.png"]);
    std::fs::copy(work.file("right/right22.png"), work.file("right/right23.png")).expect("a copy");
    fails_with(&refs(&command), 1, &["no cloud of left23", "left23 and right23"]);
    assert_eq!(std::fs::read_dir(&clouds).expect("a folder").count(), 2);
    // Names that say nothing.
    for (from, to) in [
        ("right/right21.png", "right/a.png"),
        ("right/right22.png", "right/b.png"),
        ("right/right23.png", "right/c.png"),
    ] {
        std::fs::rename(work.file(from), work.file(to)).expect("renamed");
    }
    fails_with(&refs(&command), 2, &["3 left and 3 right", "time stamp"]);
}

#[test]
fn a_rig_that_cannot_be_is_refused() {
    let work = Work::new();
    work.photograph(0.0, 1, ["one.png", "two.png"]);
    let rig = std::fs::read_to_string(work.file("rig.toml")).expect("a rig file");
    let sigma = rig.lines().find(|line| line.starts_with("rotation = \"0.0")).expect("a sigma").to_owned();
    std::fs::write(work.file("rig.toml"), rig.replace(&sigma, "rotation = \"-0.02deg\"")).expect("written");
    fails_with(&refs(&work.depth("one.png", "two.png", &["--force"])), 2, &["-0.02", "cannot be negative"]);
    let file = work.file("rig.toml");
    fails_with(&["zones", "--rig", &file, "--mode", "human"], 2, &["cannot be negative"]);
    // Metres for millimetres.
    let bench = small_bench();
    let pose = human(&bench).left_from_right;
    let far = Transform::new(pose.rotation(), pose.origin().mm() * 1000.0);
    write_rig(&Rig::fixed_pair("far", (bench.left_camera, bench.right_camera), far), Path::new(&file));
    let [left, right, out] = ["one.png", "two.png", "out.ply"].map(|name| work.file(name));
    let wide = ["depth", "--rig", &file, "--left", &left, "--right", &right, "--out", &out];
    fails_with(&wide, 2, &["145.0 m apart", "wrong unit"]);
    let forced = run(&[&wide[..], &["--force"]].concat());
    assert!(text(&forced.stderr).contains("145.0 m apart") && Path::new(&out).exists(), "{}", text(&forced.stderr));
}

/// Corners of both cameras, and camera files that are calibrated from them.
fn calibrated(work: &Work) -> String {
    let csv = work.file("corners.csv");
    std::fs::write(&csv, corner_rows(&small_bench())).expect("written");
    for side in ["left", "right"] {
        let out = work.file(&format!("{side}.toml"));
        run_json(&[
            "calibrate",
            "intrinsics",
            "--json",
            "--csv",
            &csv,
            "--camera",
            side,
            "--size",
            "640x640",
            "--out",
            &out,
        ]);
    }
    csv
}

#[test]
fn a_pair_with_its_cameras_swapped_is_not_calibrated() {
    let work = Work::new();
    let csv = calibrated(&work);
    let [left, right, out] = ["left.toml", "right.toml", "pair.toml"].map(|name| work.file(name));
    let lenses = ["extrinsics", "--left", &left, "--right", &right, "--csv", &csv];
    let honest = run_json(&[&["calibrate"], &lenses[..], &["--json", "--out", &out]].concat());
    assert!(Path::new(&out).exists(), "{honest}");
    let swapped = [&lenses[..], &["--cameras", "right", "left"]].concat();
    calibrate_refuses(&work, &swapped, 1, &["144.", "to the left of the left one", "swapped?"]);
    let forced = run(&[&["calibrate"], &swapped[..], &["--force"]].concat());
    assert!(forced.status.success() && text(&forced.stderr).contains("swapped?"), "{}", text(&forced.stderr));
    // The left camera's corners as those of the right one.
    let rows = std::fs::read_to_string(&csv).expect("corners");
    let left_twice: Vec<String> = rows
        .lines()
        .filter(|row| !row.starts_with("right"))
        .flat_map(|row| [row.to_owned(), row.replacen("left", "right", 1)])
        .collect();
    std::fs::write(
        &csv,
        format!("{}\n", left_twice.join("\n").replacen("camera,file,frame,idx,x,y,bx_mm,by_mm\n", "", 1)),
    )
    .expect("written");
    calibrate_refuses(&work, &lenses, 2, &["left camera", "right one", "the same photograph"]);
}

#[test]
fn corners_that_cannot_be_are_refused() {
    let work = Work::new();
    let csv = calibrated(&work);
    let rows = std::fs::read_to_string(&csv).expect("corners");
    let [changed, left, right] = ["changed.csv", "left.toml", "right.toml"].map(|name| work.file(name));
    let one = ["intrinsics", "--csv", &changed, "--camera", "left", "--size", "640x640"];
    let both = ["extrinsics", "--left", &left, "--right", &right, "--csv", &changed];
    let refused = |rows: String, arguments: &[&str], words: &[&str]| {
        std::fs::write(&changed, rows).expect("written");
        calibrate_refuses(&work, arguments, 2, words);
    };
    let cells = |row: &str| row.split(',').map(str::to_owned).collect::<Vec<_>>();
    let edited = |edit: &dyn Fn(&mut Vec<String>)| {
        let edited = rows.lines().enumerate().map(|(line, row)| {
            let mut row = cells(row);
            if line > 0 {
                edit(&mut row);
            }
            row.join(",")
        });
        edited.collect::<Vec<_>>().join("\n")
    };
    // --size swapped: half of the corners lie outside.
    let swapped = ["intrinsics", "--csv", &changed, "--camera", "left", "--size", "640x400"];
    refused(rows.clone(), &swapped, &["lie outside the images", "640 x 400", "width and height swapped"]);
    let outside = |row: &mut Vec<String>| {
        if row[2] == "3" && row[3] == "4" {
            row[4] = "640.1".into();
        }
    };
    refused(edited(&outside), &one, &["1 of 280 corners", "(640.1, "]);
    refused(edited(&outside), &both, &["1 of 280 corners", "left camera"]);
    let metres = |row: &mut Vec<String>| {
        for cell in &mut row[6..8] {
            cell.push_str("000");
        }
    };
    refused(edited(&metres), &one, &["180 m long", "millimetres?"]);
    refused(edited(&metres), &both, &["180 m long", "millimetres?"]);
    // A view once more, under another name.
    let again: Vec<String> = rows
        .lines()
        .filter(|row| row.contains(",3,"))
        .map(cells)
        .filter(|row| row[2] == "3")
        .map(|mut row| {
            (row[1], row[2]) = (format!("{}-copy.png", row[0]), "99".into());
            row.join(",")
        })
        .collect();
    let twice = format!("{}{}\n", rows, again.join("\n"));
    refused(twice.clone(), &one, &["left003.png", "left-copy.png", "the same photograph"]);
    refused(twice, &both, &["the same photograph", "left camera"]);
}

/// A lens whose axis is found far from the middle: images cut out of larger ones, or a --size that is another camera's.
#[test]
fn a_lens_far_from_the_middle_of_its_image_is_refused() {
    let work = Work::new();
    let csv = calibrated(&work);
    calibrate_refuses(
        &work,
        &["intrinsics", "--csv", &csv, "--camera", "left", "--size", "1400x640"],
        1,
        &["far from the middle of 1400 x 640", "swapped"],
    );
}

#[test]
fn squares_that_nobody_prints_are_refused() {
    let work = Work::new();
    let images = work.file("*.png");
    work.photograph(0.0, 1, ["one.png", "two.png"]);
    for square in ["24m", "0.1mm"] {
        let target = ["--corners", "9x6", "--square", square];
        calibrate_refuses(
            &work,
            &[&["intrinsics", "--images", &images], &target[..]].concat(),
            2,
            &["--square", "wrong unit"],
        );
        let out = work.file("set");
        fails_with(&[&["capture", "--cameras", "sim", "--out", &out], &target[..]].concat(), 2, &["wrong unit"]);
        assert!(!Path::new(&out).exists());
    }
}
