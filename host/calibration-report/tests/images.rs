//! What a report shows and asks for: thumbnails, coverage, residuals that are not noise, figures that compare.
#![allow(clippy::unwrap_used, reason = "a test fails loudly")]

#[path = "../../calibration/tests/simulated/mod.rs"]
mod simulated;

use image::{GrayImage, Luma};
use simulated::{Dice, Pair, lens, other_lens, own_views, pair_pose};
use vergence_calibration::{ExtrinsicsOptions, IntrinsicsOptions, calibrate_extrinsics, calibrate_intrinsics};
use vergence_calibration_report::{ReportAbout, ReportImage, extrinsics_report, intrinsics_report};
use vergence_targets::TargetView;

fn page(views: &[TargetView], about: &ReportAbout) -> String {
    let found = calibrate_intrinsics(views, lens().size(), &IntrinsicsOptions::default()).unwrap();
    intrinsics_report(&found, views, about)
}

/// Views within `largest_deg` of the optical axis.
fn views_within(largest_deg: f64, dice: &mut Dice) -> Vec<TargetView> {
    let mut views = own_views(&lens(), 120, 0.1, dice);
    for (index, view) in views.iter_mut().enumerate() {
        view.name = format!("left{index}.png");
        view.corners.retain(|corner| {
            lens().unproject::<vergence_vision::Camera>(corner.pixel).unwrap().angle_to_axis().deg() < largest_deg
        });
    }
    views.retain(|view| view.corners.len() >= 20);
    views
}

/// An image that is bright within `radius` pixels of the lens's centre and black outside.
fn circle(radius: f64) -> GrayImage {
    let (size, centre) = (lens().size(), lens().centre());
    GrayImage::from_fn(size.width, size.height, |x, y| {
        let distance = (f64::from(x) - centre.u).hypot(f64::from(y) - centre.v);
        Luma([if distance < radius { 200 } else { 2 }])
    })
}

#[test]
fn every_image_is_shown_with_its_corners() {
    let views = views_within(98.0, &mut Dice::new(3));
    let image = GrayImage::from_pixel(640, 480, Luma([120]));
    let mut images = vec![ReportImage::new("left0.png", &image), ReportImage::new("dark.png", &image)];
    images.truncate(2);
    let page = page(&views[..20], &ReportAbout { images: [images, Vec::new()], ..ReportAbout::default() });
    assert_eq!(page.matches("<image ").count(), 2);
    assert_eq!(page.matches("href=\"data:image/jpeg;base64,").count(), page.matches("href=").count());
    assert!(page.contains("dark.png: no target found"));
    assert!(page.contains(&format!("left0.png: {} corners", views[0].corners.len())), "all corners are used");
}

#[test]
fn views_are_not_asked_for_where_the_images_are_dark() {
    let views = views_within(60.0, &mut Dice::new(4));
    let blind = page(&views, &ReportAbout::default());
    assert!(blind.contains("No corners beyond"), "without images the sensor's border is the limit");
    let lit = circle(lens().pixels_per_radian(vergence_vision::Angle::from_deg(0.0)) * 62f64.to_radians());
    let images = vec![ReportImage::new("left0.png", &lit)];
    let about = ReportAbout { images: [images, Vec::new()], ..ReportAbout::default() };
    assert!(!page(&views, &about).contains("No corners beyond"));
}

/// Each view is bent by a wave of its own, so that the views average to nothing where they overlap.
#[test]
fn residuals_that_neighbours_share_do_not_look_like_noise() {
    let mut dice = Dice::new(5);
    let mut views = own_views(&lens(), 30, 0.1, &mut dice);
    assert!(page(&views, &ReportAbout::default()).contains("Residuals look like noise"));
    for view in &mut views {
        let (phase, size) = (dice.between(0.0, 6.0), 0.1);
        for corner in &mut view.corners {
            corner.pixel.u += size * (corner.target_mm[0] / 25.0 + phase).sin();
            corner.pixel.v += size * (corner.target_mm[1] / 25.0 + phase).cos();
        }
    }
    let page = page(&views, &ReportAbout::default());
    assert!(!page.contains("look like noise") && page.contains("Residuals are systematic"));
}

#[test]
fn both_cameras_are_drawn_to_one_scale() {
    let pair = Pair { left: lens(), right: other_lens(), left_from_right: pair_pose(20.0), noise_px: 0.1 };
    let mut dice = Dice::new(6);
    let mut views = pair.views(8, &mut dice);
    for corner in views.iter_mut().flat_map(|view| &mut view.right.corners) {
        corner.pixel.u += 0.5 * dice.normal();
    }
    let found = calibrate_extrinsics(&pair.left, &pair.right, &views, &ExtrinsicsOptions::default()).unwrap();
    let page = extrinsics_report(&found, &views, &ReportAbout::default());
    let figure = |title: &str| {
        let (_, figure) = page.split_once(&format!("<h3>{title}</h3>")).unwrap();
        figure.split_once("</figure>").unwrap().0.to_owned()
    };
    let ticks = |figure: &str| -> Vec<String> {
        let labels = figure.split("class=\"tick\"").skip(1);
        labels.map(|label| label.split_once('>').unwrap().1.split_once('<').unwrap().0.to_owned()).collect()
    };
    for title in ["Residual arrows", "Residual over field angle"] {
        let [left, right] = ["left", "right"].map(|side| ticks(&figure(&format!("{title}, {side} camera"))));
        assert!(!left.is_empty());
        assert_eq!(left, right, "{title}");
    }
}
