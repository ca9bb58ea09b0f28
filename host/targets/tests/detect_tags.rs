//! Grids of AprilTags in rendered fisheye images: near the axis and past 90° from it, partly hidden, blurred and noisy.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod rendered;
mod simulated;

use image::GrayImage;
use rendered::{ByAngle, Pose, Tally, Truth, assert_searched_once, fisheye, half_hidden_shots, optics, photograph};
use simulated::Dice;
use vergence_scene::{Optics, Scene, Sheet, TagGrid, TagPrint, Target};
use vergence_targets::{
    AprilGridSpec, DetectError, Placement, TAG_BORDER, TargetKind, TargetSpec, detect, detect_april_grid,
};
use vergence_vision::{Camera, KannalaBrandt, Length, Transform};

const GRID: AprilGridSpec = AprilGridSpec { columns: 6, rows: 6, tag: Length::from_mm(24.0), spacing: 0.3 };

fn sheet(grid: AprilGridSpec) -> Sheet {
    let family = AprilGridSpec::FAMILY;
    let code = TagPrint { side: family.side, border: TAG_BORDER, codes: family.codes };
    Sheet::Tags(TagGrid { columns: grid.columns, rows: grid.rows, tag: grid.tag, gap: grid.tag * grid.spacing, code })
}

fn truth(place: Transform<Camera, Target>, camera: &KannalaBrandt) -> Truth<'_> {
    Truth { corners: (4 * GRID.tags(), &|index| GRID.corner_mm(index)), place, camera }
}

/// Blur and noise as `optics` takes them, and the place of the grid.
struct Shot {
    pose: Pose,
    blur: f64,
    noise: f64,
}

fn shots() -> Vec<Shot> {
    let shot = |[theta_deg, azimuth_deg, roll_deg, tilt_deg, distance_mm]: [f64; 5], blur: f64, noise: f64| Shot {
        pose: Pose { theta_deg, azimuth_deg, roll_deg, tilt_deg, distance_mm },
        blur,
        noise,
    };
    vec![
        shot([0.0, 0.0, 10.0, 20.0, 200.0], 0.5, 0.0),
        shot([30.0, 140.0, 70.0, -30.0, 200.0], 0.8, 2.0),
        shot([60.0, 80.0, 140.0, 25.0, 180.0], 0.8, 2.0),
        shot([80.0, 20.0, 210.0, 0.0, 180.0], 0.8, 2.0),
        shot([86.0, 320.0, 280.0, 0.0, 180.0], 0.5, 1.0),
        shot([86.0, 260.0, 350.0, -20.0, 160.0], 1.0, 4.0),
    ]
}

#[test]
fn grids_are_found_from_the_axis_to_past_90_degrees() {
    let (camera, sheet) = (fisheye(1280), sheet(GRID));
    for (shot, seed) in shots().into_iter().zip(0..) {
        let place = shot.pose.camera_from_target(&sheet);
        let scene = Scene::studio().with_target(sheet, place.renamed());
        let image = photograph(&scene, &camera, &optics(shot.blur, shot.noise), seed);
        for (hint, share) in [(None, 0.85), (Some(&camera), 0.92)] {
            let corners = detect_april_grid(&image, &GRID, hint).unwrap();
            let Tally { found, in_sight, rms_px, worst_px, farthest_deg } = truth(place, &camera).tally(&corners);
            println!(
                "theta {}°, blur {}, noise {}, lens {}: {found} of {in_sight}, rms {rms_px:.4} px, worst {worst_px:.3} px, \
                 to {farthest_deg:.1}°",
                shot.pose.theta_deg,
                shot.blur,
                shot.noise,
                if hint.is_some() { "known" } else { "unknown" },
            );
            assert!(found as f64 >= share * in_sight as f64, "{found} of {in_sight} found");
            assert!(rms_px < 0.06 && worst_px < 0.3, "rms {rms_px} px, worst {worst_px} px");
            assert!(shot.pose.theta_deg < 80.0 || farthest_deg > 94.0, "farthest at {farthest_deg}°");
        }
    }
}

/// A sheet lies over half of the grid; what is seen of it is found, and nothing else.
#[test]
fn a_grid_half_hidden_is_found_where_it_is_seen() {
    let (camera, sheet) = (fisheye(1280), sheet(GRID));
    for (theta_deg, place, image) in half_hidden_shots(sheet, &camera) {
        assert_searched_once(&image, &TargetKind::AprilGrid(GRID), &camera);
        for hint in [None, Some(&camera)] {
            let corners = detect_april_grid(&image, &GRID, hint).unwrap();
            let Tally { found, in_sight, rms_px, worst_px, .. } = truth(place, &camera).tally(&corners);
            println!(
                "theta {theta_deg}°, half hidden: {found} of {in_sight}, rms {rms_px:.4} px, worst {worst_px:.3} px"
            );
            assert!((24..in_sight).contains(&found) && worst_px < 0.3);
        }
    }
}

#[test]
fn other_images_show_no_grid_and_other_grids_are_refused() {
    let camera = fisheye(960);
    for scene in [Scene::studio(), Scene::room()] {
        let image = photograph(&scene, &camera, &optics(0.5, 1.0), 1);
        assert!(matches!(detect_april_grid(&image, &GRID, None), Err(DetectError::NoTags { .. })));
    }
    for (width, height) in [(0, 0), (1, 1), (3, 200), (64, 48)] {
        let blank = GrayImage::new(width, height);
        assert_eq!(detect_april_grid(&blank, &GRID, None), Err(DetectError::NoTags { found: 0 }));
    }
    for unusable in [
        AprilGridSpec { columns: 0, ..GRID },
        AprilGridSpec { columns: 98, ..GRID },
        AprilGridSpec { spacing: 0.0, ..GRID },
        AprilGridSpec { tag: Length::from_mm(f64::NAN), ..GRID },
    ] {
        let refused = detect_april_grid(&GrayImage::new(64, 64), &unusable, None);
        assert!(matches!(refused, Err(DetectError::UnusableGrid { .. })), "{unusable:?}");
    }
}

/// A grid beyond the end of which the numbers go on: tags that the grid in use has not are not taken.
#[test]
fn tags_of_a_larger_grid_are_no_corners_of_a_smaller_one() {
    let (camera, sheet) = (fisheye(1280), sheet(GRID));
    let pose = Pose { theta_deg: 0.0, azimuth_deg: 0.0, roll_deg: 0.0, tilt_deg: 10.0, distance_mm: 200.0 };
    let scene = Scene::target_alone(sheet, pose.camera_from_target(&sheet).renamed());
    let image = photograph(&scene, &camera, &optics(0.5, 1.0), 1);
    let smaller = AprilGridSpec { rows: 3, ..GRID };
    let corners = detect_april_grid(&image, &smaller, Some(&camera)).unwrap();
    assert_eq!(corners.len(), 72);
    assert!(corners.iter().all(|corner| corner.index < 72));
}

/// Over many places: no corner is another one, and the error beside that of a chessboard's corners.
#[test]
fn no_number_is_wrong_in_many_images() {
    let (camera, sheet) = (fisheye(960), sheet(GRID));
    let board = Target { columns: 7, rows: 6, square: Length::from_mm(24.0) };
    let spec = TargetSpec { columns: board.columns, rows: board.rows, square: board.square };
    let (mut tags, mut chessboard) = (ByAngle::default(), ByAngle::default());
    for seed in 0..simulated::seeds(6) {
        let mut dice = Dice::new(seed);
        let pose = Pose {
            theta_deg: dice.between(0.0, 92.0),
            azimuth_deg: dice.between(0.0, 360.0),
            roll_deg: dice.between(0.0, 360.0),
            tilt_deg: dice.between(-45.0, 45.0),
            distance_mm: dice.between(140.0, 260.0),
        };
        let optics = Optics { samples: 1, ..optics(dice.between(0.4, 1.1), dice.between(0.0, 4.0)) };
        let place = pose.camera_from_target(&sheet);
        let image = photograph(&Scene::studio().with_target(sheet, place.renamed()), &camera, &optics, seed);
        let truth = truth(place, &camera);
        let errors = truth.errors(&detect_april_grid(&image, &GRID, Some(&camera)).unwrap_or_default());
        let worst = errors.iter().map(|(off, _)| *off).fold(0.0, f64::max);
        assert!(worst < 0.5, "seed {seed}: a corner is {worst} px off");
        tags.add(&truth.in_sight(), &errors);
        let place = pose.camera_from_target(&board.into());
        let image = photograph(&Scene::studio().with_target(board, place.renamed()), &camera, &optics, seed);
        let truth =
            Truth { corners: (spec.columns * spec.rows, &|index| spec.corner_mm(index)), place, camera: &camera };
        let detection = detect(&image, &spec, Some(&camera)).ok().filter(|found| found.placement == Placement::Unique);
        let corners = detection.map(|found| found.corners).unwrap_or_default();
        chessboard.add(&truth.in_sight(), &truth.errors(&corners));
    }
    chessboard.print("chessboard");
    let (share, rms) = tags.print("tags");
    assert!(rms < 0.1 && share >= 0.7, "rms {rms} px, {share} of the corners");
}

/// How small tags may be: the figures of the page on calibrating.
#[test]
fn tags_are_read_down_to_18_pixels() {
    let (camera, sheet) = (fisheye(1280), sheet(GRID));
    for (distance_mm, least) in [(300.0, 144), (350.0, 144), (400.0, 144), (450.0, 140), (500.0, 130)] {
        let pose = Pose { theta_deg: 20.0, azimuth_deg: 40.0, roll_deg: 25.0, tilt_deg: 15.0, distance_mm };
        let scene = Scene::target_alone(sheet, pose.camera_from_target(&sheet).renamed());
        let image = photograph(&scene, &camera, &optics(0.6, 1.5), 7);
        let found = detect_april_grid(&image, &GRID, Some(&camera)).map_or(0, |corners| corners.len());
        println!("tags of {:.0} px: {found} of 144 corners", 366.0 * GRID.tag.mm() / distance_mm);
        assert!(found >= least);
    }
}
