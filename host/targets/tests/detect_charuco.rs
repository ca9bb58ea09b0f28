//! ChArUco boards in rendered fisheye images: near the axis and past 90° from it, partly hidden, blurred and noisy.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod rendered;
mod simulated;

use image::GrayImage;
use rendered::{ByAngle, Pose, Tally, Truth, assert_searched_once, fisheye, half_hidden_shots, optics, photograph};
use simulated::Dice;
use vergence_scene::{MarkerBoard, Optics, Scene, Sheet, TagPrint, Target};
use vergence_targets::{CharucoSpec, DetectError, MARKER_BORDER, TagFamily, TargetKind, detect_charuco};
use vergence_vision::{Camera, KannalaBrandt, Length, Transform};

fn board(name: &str) -> CharucoSpec {
    let dictionary = TagFamily::dictionary(name).unwrap();
    let [square, marker] = [24.0, 17.5].map(Length::from_mm);
    CharucoSpec { columns: 9, rows: 6, square, marker, dictionary, legacy: false }
}

fn sheet(board: &CharucoSpec) -> Sheet {
    let CharucoSpec { columns, rows, square, marker, dictionary, .. } = *board;
    let code = TagPrint { side: dictionary.side, border: MARKER_BORDER, codes: dictionary.codes };
    Sheet::Markers(MarkerBoard { columns, rows, square, marker, white_first: board.is_white_first(), code })
}

/// Looks for a board before `camera`.
fn tally(
    board: &CharucoSpec,
    place: Transform<Camera, Target>,
    camera: &KannalaBrandt,
    image: &GrayImage,
    hint: Option<&KannalaBrandt>,
) -> Tally {
    let truth = Truth { corners: (board.corners(), &|index| board.corner_mm(index)), place, camera };
    match detect_charuco(image, board, hint) {
        Ok(corners) => truth.tally(&corners),
        Err(error) => {
            println!("{error}");
            Tally { in_sight: truth.in_sight().len(), ..truth.tally(&[]) }
        }
    }
}

#[test]
fn boards_are_found_from_the_axis_to_past_90_degrees() {
    let camera = fisheye(1280);
    let shots = [
        ([0.0, 0.0, 10.0, 20.0, 200.0], 0.5, 0.0, "DICT_4X4_50"),
        ([30.0, 140.0, 70.0, -30.0, 200.0], 0.8, 2.0, "DICT_5X5_100"),
        ([60.0, 80.0, 140.0, 25.0, 180.0], 0.8, 2.0, "DICT_6X6_250"),
        ([80.0, 20.0, 210.0, 0.0, 180.0], 0.8, 2.0, "DICT_4X4_1000"),
        ([86.0, 320.0, 280.0, 0.0, 180.0], 0.5, 1.0, "DICT_5X5_1000"),
        ([86.0, 260.0, 350.0, -20.0, 160.0], 1.0, 4.0, "DICT_4X4_50"),
    ];
    for (([theta_deg, azimuth_deg, roll_deg, tilt_deg, distance_mm], blur, noise, name), seed) in
        shots.into_iter().zip(0..)
    {
        let board = board(name);
        let pose = Pose { theta_deg, azimuth_deg, roll_deg, tilt_deg, distance_mm };
        let place = pose.camera_from_target(&sheet(&board));
        let scene = Scene::studio().with_target(sheet(&board), place.renamed());
        let image = photograph(&scene, &camera, &optics(blur, noise), seed);
        for (hint, share) in [(None, 0.9), (Some(&camera), 0.95)] {
            let Tally { found, in_sight, rms_px, worst_px, farthest_deg } = tally(&board, place, &camera, &image, hint);
            println!(
                "theta {theta_deg}°, {name}, blur {blur}, noise {noise}, lens {}: {found} of {in_sight}, rms {rms_px:.4} px, \
                 worst {worst_px:.3} px, to {farthest_deg:.1}°",
                if hint.is_some() { "known" } else { "unknown" },
            );
            assert!(found as f64 >= share * in_sight as f64, "{found} of {in_sight} found");
            assert!(rms_px < 0.1 && worst_px < 0.4, "rms {rms_px} px, worst {worst_px} px");
            assert!(theta_deg < 86.0 || farthest_deg > 94.0, "farthest at {farthest_deg}°");
        }
    }
}

/// A sheet lies over half of the board; what is seen of it is found, with its own numbers, and nothing else.
#[test]
fn a_board_half_hidden_is_found_where_it_is_seen() {
    let (camera, board) = (fisheye(1280), board("DICT_4X4_50"));
    for (theta_deg, place, image) in half_hidden_shots(sheet(&board), &camera) {
        assert_searched_once(&image, &TargetKind::Charuco(board), &camera);
        for hint in [None, Some(&camera)] {
            let Tally { found, in_sight, rms_px, worst_px, .. } = tally(&board, place, &camera, &image, hint);
            println!(
                "theta {theta_deg}°, half hidden: {found} of {in_sight}, rms {rms_px:.4} px, worst {worst_px:.3} px"
            );
            assert!((12..in_sight).contains(&found) && worst_px < 0.6);
        }
    }
}

/// A board whose labels its corners alone leave open: markers tell them, however it stands, and in both patterns.
#[test]
fn square_boards_of_both_patterns_are_labelled_however_they_stand() {
    let camera = fisheye(960);
    let square = CharucoSpec { columns: 6, rows: 6, ..board("DICT_5X5_50") };
    for legacy in [false, true] {
        let board = CharucoSpec { legacy, ..square };
        for (roll_deg, seed) in [(5.0, 1), (95.0, 2), (185.0, 3), (275.0, 4)] {
            let pose = Pose { theta_deg: 15.0, azimuth_deg: 200.0, roll_deg, tilt_deg: 10.0, distance_mm: 150.0 };
            let place = pose.camera_from_target(&sheet(&board));
            let scene = Scene::target_alone(sheet(&board), place.renamed());
            let image = photograph(&scene, &camera, &Optics { samples: 1, ..optics(0.5, 1.0) }, seed);
            let Tally { found, worst_px, .. } = tally(&board, place, &camera, &image, None);
            assert!(found >= 20 && worst_px < 0.4, "legacy {legacy}, {roll_deg}°: {found} found, {worst_px} px");
            // As the other pattern, markers say each another place.
            let other = CharucoSpec { legacy: !legacy, ..board };
            let refused = detect_charuco(&image, &other, None);
            assert!(matches!(refused, Err(DetectError::NoMarkers { .. })), "{refused:?}");
        }
    }
}

#[test]
fn other_images_show_no_board_and_other_boards_are_refused() {
    let (camera, board) = (fisheye(960), board("DICT_4X4_50"));
    for scene in [Scene::studio(), Scene::room()] {
        let image = photograph(&scene, &camera, &optics(0.5, 1.0), 1);
        let refused = detect_charuco(&image, &board, None);
        assert!(matches!(refused, Err(DetectError::NoTarget { .. } | DetectError::NoMarkers { .. })), "{refused:?}");
    }
    // A chessboard has no markers, and those of another dictionary agree on nothing.
    let pose = Pose { theta_deg: 10.0, azimuth_deg: 0.0, roll_deg: 0.0, tilt_deg: 10.0, distance_mm: 170.0 };
    let plain = Target { columns: 8, rows: 5, square: board.square };
    let place = pose.camera_from_target(&plain.into());
    let chessboard = photograph(&Scene::target_alone(plain, place.renamed()), &camera, &optics(0.5, 1.0), 1);
    let other = CharucoSpec { dictionary: TagFamily::dictionary("DICT_6X6_50").unwrap(), ..board };
    let place = pose.camera_from_target(&sheet(&other));
    let other = photograph(&Scene::target_alone(sheet(&other), place.renamed()), &camera, &optics(0.5, 1.0), 1);
    for image in [chessboard, other] {
        let refused = detect_charuco(&image, &board, None);
        assert!(matches!(refused, Err(DetectError::NoMarkers { .. })), "{refused:?}");
    }
    for (width, height) in [(0, 0), (1, 1), (3, 200), (64, 48)] {
        let blank = GrayImage::new(width, height);
        assert_eq!(detect_charuco(&blank, &board, None), Err(DetectError::NoTarget { found: 0 }));
    }
    for unusable in [
        CharucoSpec { columns: 2, ..board },
        CharucoSpec { rows: 12, ..board },
        CharucoSpec { marker: board.square, ..board },
        CharucoSpec { marker: Length::from_mm(f64::NAN), ..board },
        CharucoSpec { square: Length::from_mm(f64::INFINITY), ..board },
    ] {
        let refused = detect_charuco(&GrayImage::new(64, 64), &unusable, None);
        assert!(matches!(refused, Err(DetectError::UnusableBoard { .. })), "{unusable:?}");
    }
}

/// Over many places: no corner is another one. The figures of docs/measured/targets.md.
#[test]
fn no_label_is_wrong_in_many_images() {
    let camera = fisheye(960);
    let mut rings = ByAngle::default();
    for seed in 0..simulated::seeds(6) {
        let mut dice = Dice::new(seed);
        let pose = Pose {
            theta_deg: dice.between(0.0, 92.0),
            azimuth_deg: dice.between(0.0, 360.0),
            roll_deg: dice.between(0.0, 360.0),
            tilt_deg: dice.between(-45.0, 45.0),
            distance_mm: dice.between(110.0, 200.0),
        };
        let optics = Optics { samples: 1, ..optics(dice.between(0.4, 1.1), dice.between(0.0, 4.0)) };
        let dictionaries = TagFamily::dictionaries();
        let dictionary = dictionaries[seed as usize % dictionaries.len()];
        let board = CharucoSpec { dictionary, legacy: seed % 3 == 0, ..board("DICT_4X4_50") };
        let place = pose.camera_from_target(&sheet(&board));
        let image = photograph(&Scene::studio().with_target(sheet(&board), place.renamed()), &camera, &optics, seed);
        let truth = Truth { corners: (board.corners(), &|index| board.corner_mm(index)), place, camera: &camera };
        let corners = detect_charuco(&image, &board, Some(&camera)).unwrap_or_else(|error| {
            println!("seed {seed}, {}, {:.0}°: {error}", dictionary.name, pose.theta_deg);
            Vec::new()
        });
        let errors = truth.errors(&corners);
        let worst = errors.iter().map(|(off, _)| *off).fold(0.0, f64::max);
        // A wrong label is a square off, 20 pixels.
        assert!(worst < 1.5, "seed {seed}: a corner is {worst} px off");
        rings.add(&truth.in_sight(), &errors);
    }
    let (share, rms) = rings.print("ChArUco");
    assert!(rms < 0.1 && share > 0.85, "rms {rms} px, {share} of the corners");
}

/// How small squares may be: the figures of the page on calibrating.
#[test]
fn boards_are_read_down_to_small_squares() {
    let (camera, board) = (fisheye(1280), board("DICT_4X4_50"));
    for (distance_mm, least) in [(250.0, 38), (300.0, 30), (350.0, 0), (400.0, 0), (450.0, 0)] {
        let pose = Pose { theta_deg: 20.0, azimuth_deg: 40.0, roll_deg: 25.0, tilt_deg: 15.0, distance_mm };
        let place = pose.camera_from_target(&sheet(&board));
        let image = photograph(&Scene::target_alone(sheet(&board), place.renamed()), &camera, &optics(0.6, 1.5), 7);
        let Tally { found, rms_px, .. } = tally(&board, place, &camera, &image, Some(&camera));
        println!(
            "squares of {:.0} px: {found} of 40 corners, rms {rms_px:.3} px",
            366.0 * board.square.mm() / distance_mm
        );
        assert!(found >= least);
    }
}
