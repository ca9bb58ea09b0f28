//! A range for every pixel by the command line: the files that a user gets, with a right and with a wrong pose.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

mod common;

use common::pairs::{Work, refs, small_bench};
use common::{run, run_json, text};
use vergence_scene::Scene;
use vergence_vision::{Left, Pixel, Point, Transform, World};

/// Shares of the pixels whose range is within one and two sigma, both read from the images that were written.
fn within(work: &Work) -> [f64; 2] {
    let read = |name: &str| image::open(work.file(name)).expect("it is written").into_luma16();
    let (ranges, sigmas) = (read("out-range.png"), read("out-sigma.png"));
    let (scene, lens) = (Scene::room(), small_bench().left_camera);
    let world_from_left: Transform<World, Left> =
        Transform::new(nalgebra::UnitQuaternion::identity(), nalgebra::Vector3::new(100.0, 0.0, 0.0));
    let origin: Point<World> = world_from_left.origin();
    let (mut all, mut good) = (0.0, [0.0; 2]);
    for (u, v, range) in ranges.enumerate_pixels().filter(|(_, _, range)| !matches!(range.0[0], 0 | u16::MAX)) {
        let ray = lens.unproject::<Left>(Pixel { u: u.into(), v: v.into() }).expect("it was measured");
        let truth = scene.cast(&origin, &(world_from_left * ray)).map_or(f64::INFINITY, |hit| hit.range.mm());
        let off = (f64::from(range.0[0]) - truth).abs();
        // Rounding to whole millimetres is no part of sigma.
        let sigma = (f64::from(sigmas.get_pixel(u, v).0[0]) / 10.0).hypot(12f64.sqrt().recip());
        all += 1.0;
        good[0] += f64::from(u8::from(off <= sigma));
        good[1] += f64::from(u8::from(off <= 2.0 * sigma));
    }
    good.map(|count| 100.0 * count / all)
}

#[test]
fn dense_files_state_honest_sigma_and_a_wrong_pose_costs_a_warning_and_few_pixels() {
    let work = Work::new();
    work.photograph(0.0, 1, ["one.png", "two.png"]);
    let command = work.depth("one.png", "two.png", &["--dense", "--json"]);
    let honest = run_json(&refs(&command));
    let [one, two] = within(&work);
    println!("{one:.1} % within 1 sigma, {two:.1} % within 2; {honest}");
    assert_eq!(honest["pose_drift"]["significant"], false, "{honest}");
    // The pose is exact; its stated uncertainty makes sigma larger than the errors.
    assert!((65.0..78.0).contains(&one) && (90.0..98.0).contains(&two), "{one} {two}");

    let rig = std::fs::read_to_string(work.file("rig.toml")).expect("the rig file");
    let (before, place) = rig.split_once("[right.at_zero]").expect("the right camera has a place");
    let after = place.find("\n[").map_or("", |at| &place[at..]);
    let turned =
        "[right.at_zero]\norigin = [\"0mm\", \"0mm\", \"0mm\"]\nrotation_vector = [\"0.3deg\", \"0deg\", \"0deg\"]\n";
    std::fs::write(work.file("rig.toml"), format!("{before}{turned}{after}")).expect("it is written");
    let output = run(&refs(&command));
    let warned = text(&output.stderr);
    assert!(output.status.success(), "{warned}");
    let wrong: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    println!("{warned}{wrong}");
    assert!(warned.contains("the pose on the command line and the images disagree by 0.3"), "{warned}");
    assert!(warned.contains("for each metre of range"), "{warned}");
    assert_eq!(wrong["pose_drift"]["significant"], true, "{wrong}");
    let measured = |result: &serde_json::Value| result["measured"].as_f64().expect("a count");
    assert!(measured(&wrong) > 0.95 * measured(&honest), "{wrong}");
}
