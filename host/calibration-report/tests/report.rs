//! Reports: well-formed, self-contained, deterministic, and true to the calibration they are made of.
#![allow(clippy::expect_used, clippy::unwrap_used, clippy::panic, reason = "a test fails loudly")]

#[path = "../../calibration/tests/simulated/mod.rs"]
mod simulated;

use std::collections::BTreeMap;
use std::sync::LazyLock;

use simulated::stage::{Bench, SIX_POSES};
use simulated::{Dice, Pair, lens, other_lens, own_views, pair_pose};
use vergence_calibration::{
    ExtrinsicsCalibration, ExtrinsicsOptions, HeldOutPose, IntrinsicsCalibration, IntrinsicsOptions, RayUncertainty,
    StageCalibration, StageOptions, StereoView, calibrate_extrinsics, calibrate_intrinsics, calibrate_stage,
    validate_stage,
};
use vergence_calibration_report::{
    ReportAbout, VerdictPlaces, extrinsics_report, extrinsics_verdict, intrinsics_report, intrinsics_verdict,
    stage_report, stage_verdict,
};
use vergence_rig::{Rig, RigNumber};
use vergence_targets::TargetView;
use vergence_vision::{Angle, Side};

/// A name that would break a page that does not escape it.
const HOSTILE: &str = "</td><script>alert('a' & \"b\")</script>\u{1}";

fn about() -> ReportAbout {
    ReportAbout {
        title: format!("Left {HOSTILE}"),
        program_version: "vergence 0.1.0".into(),
        inputs_sha256: "2c26b46b68ffc68ff99b453c1d30413413422d706483bfa0f98a5e886266e7ae".into(),
        date: "2026-11-21".into(),
        target: "9 × 6 inner corners, 25 mm <card & glue>".into(),
        half_field: Some(Angle::from_deg(100.0)),
        ..ReportAbout::default()
    }
}

/// Twelve views of a 196° lens; the third has a hostile name and a corner 40 px off.
static LENS: LazyLock<(IntrinsicsCalibration, Vec<TargetView>)> = LazyLock::new(|| {
    let mut views = own_views(&lens(), 12, 0.1, &mut Dice::new(7));
    for (index, view) in views.iter_mut().enumerate() {
        view.name = format!("view {index}");
    }
    views[2].name = HOSTILE.into();
    views[2].corners[3].pixel.u += 40.0;
    (calibrate(&views), views)
});

static PAIR: LazyLock<(ExtrinsicsCalibration, Vec<StereoView>)> = LazyLock::new(|| {
    let pair = Pair { left: lens(), right: other_lens(), left_from_right: pair_pose(20.0), noise_px: 0.1 };
    let mut views = pair.views(8, &mut Dice::new(8));
    views[1].name = HOSTILE.into();
    views[1].right.corners[5].pixel.v -= 30.0;
    views.push(StereoView { name: "half <seen>".into(), ..views[0].clone() });
    views[8].left.corners.truncate(3);
    let found = calibrate_extrinsics(&pair.left, &pair.right, &views, &ExtrinsicsOptions::default()).unwrap();
    (found, views)
});

/// Four stage poses of a bench whose first axis and mode have a hostile name.
static STAGE: LazyLock<(StageCalibration, Rig, Vec<HeldOutPose>)> = LazyLock::new(|| {
    let mut dice = Dice::new(9);
    let mut bench = Bench::built(&mut dice);
    bench.drawn.axes[0].name = HOSTILE.into();
    bench.drawn.modes[0].name = HOSTILE.into();
    let poses: Vec<_> = SIX_POSES[..4].iter().map(|&at| bench.pose(at, 4, 0.1, &mut dice)).collect();
    let options = StageOptions::default();
    let stage = calibrate_stage(&bench.drawn, &poses, &options).unwrap();
    let held_out = validate_stage(&bench.drawn, &poses, &options).unwrap();
    (stage, bench.drawn, held_out)
});

fn stage_page() -> String {
    stage_report(&STAGE.0, &STAGE.1, &STAGE.2, &about())
}

#[test]
fn the_page_of_a_stage_is_sound_and_says_what_the_json_says() {
    let page = stage_page();
    let found = elements(&page);
    assert_eq!((found["h1"], found["figure"]), (1, 2));
    assert!(!found.contains_key("script"));
    for forbidden in ["http", "url(", "src=", "href=", "@import", "NaN", "inf "] {
        assert!(!page.contains(forbidden), "{forbidden}");
    }
    let verdict = stage_verdict(&STAGE.0, &STAGE.1, &about().places);
    assert!(page.contains(&verdict.sentence.split(" in ").next().unwrap().to_owned()), "{}", verdict.sentence);
    assert!(verdict.depth_sigma.unwrap().mm() <= verdict.worst_sigma.unwrap().mm());
    assert_eq!(page.matches("<td>turns about").count(), 2);
    assert!(page == stage_page());
}

/// The sentence, the page and the figures are of one piece.
#[test]
fn verdicts_are_those_of_the_pages() {
    let (lens, pair) = (intrinsics_verdict(&LENS.0, &LENS.1), extrinsics_verdict(&PAIR.0, &about().places));
    assert!(lens_page().contains(&lens.sentence) && pair_page().contains(&pair.sentence));
    for verdict in [lens, pair] {
        let stated = number_after(&verdict.sentence, "Good to ");
        assert!((stated / verdict.depth_sigma.unwrap().mm() - 1.0).abs() < 0.06, "{verdict:?}");
        assert!(verdict.worst_sigma.unwrap().mm() >= verdict.depth_sigma.unwrap().mm());
    }
}

fn calibrate(views: &[TargetView]) -> IntrinsicsCalibration {
    calibrate_intrinsics(views, lens().size(), &IntrinsicsOptions::default()).unwrap()
}

fn lens_page() -> String {
    intrinsics_report(&LENS.0, &LENS.1, &about())
}

fn pair_page() -> String {
    extrinsics_report(&PAIR.0, &PAIR.1, &about())
}

/// How often each element begins; panics where tags do not match or text holds a bare `<`, `>` or `&`.
fn elements(page: &str) -> BTreeMap<String, usize> {
    let mut counts = BTreeMap::new();
    let mut open: Vec<&str> = Vec::new();
    let mut rest = page.strip_prefix("<!DOCTYPE html>").expect("a document type");
    while let Some((text, after)) = rest.split_once('<') {
        check_text(text, open.last() == Some(&"style"));
        let (tag, after) = after.split_once('>').expect("a tag ends");
        rest = after;
        if let Some(name) = tag.strip_prefix('/') {
            assert_eq!(open.pop(), Some(name), "closes what is open");
            continue;
        }
        let name = tag.split([' ', '/']).next().unwrap();
        assert_eq!(tag.matches('"').count() % 2, 0, "quotes in <{tag}>");
        check_text(tag, false);
        *counts.entry(name.to_owned()).or_default() += 1;
        if !tag.ends_with('/') {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
    counts
}

fn check_text(text: &str, style: bool) {
    assert!(style || !text.contains('>'), "bare > in {text:?}");
    assert!(!text.chars().any(|c| c.is_control() && c != '\n'), "control character in {text:?}");
    for part in text.split('&').skip(1) {
        let (entity, _) = part.split_once(';').unwrap_or_else(|| panic!("bare & in {text:?}"));
        assert!(["amp", "lt", "gt", "quot", "#39"].contains(&entity), "&{entity};");
    }
}

/// The number after `words`.
fn number_after(page: &str, words: &str) -> f64 {
    let (_, after) = page.split_once(words).unwrap_or_else(|| panic!("no '{words}'"));
    let end = after.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(after.len());
    after[..end].parse().unwrap()
}

#[test]
fn pages_are_well_formed_and_hold_all_their_figures() {
    let (lens, pair) = (elements(&lens_page()), elements(&pair_page()));
    assert_eq!((lens["figure"], pair["figure"]), (5, 5));
    assert!(!lens.contains_key("script") && !pair.contains_key("script"));
    assert_eq!(lens["h1"], 1);
    for title in ["Residual arrows", "Coverage", "Ray uncertainty", "Residual over field angle", "Mean residual"] {
        assert!(lens_page().contains(&format!("<h3>{title}</h3>")), "{title}");
    }
    for title in ["Residual arrows, left camera", "Residual arrows, right camera", "Relative pose"] {
        assert!(pair_page().contains(&format!("<h3>{title}</h3>")), "{title}");
    }
}

#[test]
fn pages_load_nothing_and_hold_no_number_that_is_none() {
    for page in [lens_page(), pair_page()] {
        for forbidden in ["http", "url(", "src=", "href=", "@import", "NaN", "inf ", "inf\"", "inf<"] {
            assert!(!page.contains(forbidden), "{forbidden}");
        }
    }
}

#[test]
fn names_are_escaped_wherever_they_appear() {
    let escaped = "&lt;/td&gt;&lt;script&gt;alert(&#39;a&#39; &amp; &quot;b&quot;)&lt;/script&gt;\u{fffd}";
    let (lens, pair) = (lens_page(), pair_page());
    // Title and heading, the view's row, and its outlier.
    assert!(lens.matches(escaped).count() >= 4 && pair.matches(escaped).count() >= 4);
    assert!(!lens.contains("<script") && !pair.contains("<script"));
    assert!(lens.contains("&lt;card &amp; glue&gt;") && pair.contains("half &lt;seen&gt;"));
}

#[test]
fn the_same_calibration_gives_the_same_bytes() {
    assert!(lens_page() == lens_page() && pair_page() == pair_page());
}

#[test]
fn the_corner_that_is_off_is_listed_with_its_reason() {
    let page = lens_page();
    let list = page.split_once("<h2>Corners left out</h2>").expect("a list").1;
    let pixel = LENS.1[2].corners[3].pixel;
    assert!(list.contains(&format!("pixel ({:.1}, {:.1})", pixel.u, pixel.v)));
    assert_eq!(list.matches("too far from its reprojection").count(), LENS.0.outliers.len());
    let page = pair_page();
    let list = page.split_once("<h2>Corners left out</h2>").expect("a list").1;
    assert!(list.contains("too far from where the rest of its image puts it"));
    assert!(list.contains("Views that do not count"));
}

#[test]
fn the_coverage_counts_every_corner_used() {
    let page = lens_page();
    let counts = page.split("<text class=\"count").skip(1).map(|text| {
        let (_, text) = text.split_once('>').unwrap();
        text.split_once('<').unwrap().0.parse::<usize>().unwrap()
    });
    assert_eq!(counts.sum::<usize>(), LENS.0.corners_inlier);
}

/// The median is taken here over the pixels of a grid, each weighted by the solid angle it sees, instead of over
/// directions.
#[test]
fn the_verdict_is_the_stated_formula_of_the_ray_uncertainty() {
    let uncertainty = RayUncertainty::of(&LENS.0);
    let camera = &LENS.0.camera;
    let weighted = |point: &vergence_calibration::MapPoint| {
        let ray = point.ray?;
        let theta = ray.ray.angle_to_axis();
        let pixel = point.pixel;
        let radius = (pixel.u - camera.centre().u).hypot(pixel.v - camera.centre().v);
        // dΩ / dA = sin θ / (r dr/dθ).
        let weight = theta.rad().sin() / (radius.max(1e-6) * camera.pixels_per_radian(theta));
        Some((ray.sigma().rad(), weight))
    };
    let mut sigmas: Vec<(f64, f64)> = uncertainty.map(160, 160).iter().filter_map(weighted).collect();
    sigmas.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = 0.5 * sigmas.iter().map(|(_, weight)| weight).sum::<f64>();
    let mut sum = 0.0;
    let below = sigmas.iter().take_while(|(_, weight)| {
        sum += weight;
        sum < half
    });
    let median = below.last().unwrap().0;
    let expected = 350.0 * 350.0 * median * 2f64.sqrt() / 145.0;
    let stated = number_after(&lens_page(), "Good to ");
    assert!((stated / expected - 1.0).abs() < 0.06, "{stated} mm, expected {expected} mm");
}

/// As [`about`], with matches that have no noise, so that a verdict counts the calibration alone.
fn exact_matches() -> ReportAbout {
    ReportAbout { places: "350mm at 0deg with 0px".parse().unwrap(), ..about() }
}

#[test]
fn verdicts_count_lenses_pose_and_pixels_along_and_across() {
    let at = |places: &str, pair: &ExtrinsicsCalibration| {
        let verdict = extrinsics_verdict(pair, &places.parse().unwrap());
        let sigma = |place: &vergence_calibration_report::PlaceVerdict| place.sigma.unwrap().map(|sigma| sigma.mm());
        verdict.places.iter().map(sigma).collect::<Vec<_>>()
    };
    let pair = &PAIR.0;
    let places = "350mm,1m at -30deg,0deg,30deg with 0.1px";
    let stated = at(places, pair);
    assert_eq!(stated.len(), 6);
    assert!(stated.iter().all(|[along, across]| along > across), "{stated:?}");
    // Numerically: pixels alone, and a point straight ahead of parallel cameras, dZ = Z² σ √2 / (f B).
    let mut exact = pair.clone();
    exact.full_covariance.fill(0.0);
    let pixels = at(places, &exact);
    let pose = at("350mm,1m at -30deg,0deg,30deg with 0px", pair);
    for ((stated, pixels), pose) in stated.iter().zip(&pixels).zip(&pose) {
        let whole = (pixels[0].powi(2) + pose[0].powi(2)).sqrt();
        assert!((stated[0] / whole - 1.0).abs() < 1e-6 && pixels[0] > 0.0 && pose[0] > 0.0);
        assert!(stated[1] >= pixels[1] && stated[1] >= pose[1]);
    }
    let baseline = pair.joint.left_from_right.origin().mm().norm();
    let expected = 1000.0 * 1000.0 * 0.1 * 2f64.sqrt() / (600.0 * baseline);
    assert!((pixels[4][0] / expected - 1.0).abs() < 0.15, "{} mm, expected {expected} mm", pixels[4][0]);
    // An uncertain lens counts where it was refined, behind the six numbers of the pose.
    let mut lenses = exact.clone();
    lenses.full_covariance = nalgebra::DMatrix::zeros(7, 7);
    lenses.lens_numbers = vec![RigNumber::Lens { side: Side::Left, parameter: 0 }];
    lenses.full_covariance[(6, 6)] = 1.0;
    let centre = at("350mm at 0deg with 0px", &lenses)[0];
    assert!(centre[0] + centre[1] > 0.01, "{centre:?}");
    assert!(
        "350mm at 0deg".parse::<VerdictPlaces>().is_err() && "-1m at 0deg with 1px".parse::<VerdictPlaces>().is_err()
    );
}

#[test]
fn verdicts_grow_with_the_standard_deviations() {
    let mut lens = LENS.0.clone();
    lens.covariance *= 1e4;
    let ratio =
        number_after(&intrinsics_report(&lens, &LENS.1, &about()), "Good to ") / number_after(&lens_page(), "Good to ");
    assert!((ratio / 100.0 - 1.0).abs() < 0.06, "{ratio}");
    let mut pair = PAIR.0.clone();
    pair.full_covariance *= 1e4;
    let ratio = number_after(&extrinsics_report(&pair, &PAIR.1, &exact_matches()), "Good to ")
        / number_after(&extrinsics_report(&PAIR.0, &PAIR.1, &exact_matches()), "Good to ");
    assert!((ratio / 100.0 - 1.0).abs() < 0.06, "{ratio}");
}

#[test]
fn the_depth_error_is_that_of_the_points_both_cameras_triangulate() {
    // A turn of the right camera about y alone; numerically, on the distance that the two rays measure.
    let mut pair = PAIR.0.clone();
    let sigma = 1e-4f64;
    pair.full_covariance.fill(0.0);
    pair.full_covariance[(1, 1)] = sigma * sigma;
    let stated = number_after(&extrinsics_report(&pair, &PAIR.1, &exact_matches()), "Good to ");

    let pose = pair.joint.left_from_right;
    let (centre, right_axis) = (pose.origin().mm(), pose.rotation() * nalgebra::Vector3::z());
    let along = centre.normalize();
    let between = nalgebra::Vector3::z() + right_axis;
    let point = 0.5 * centre + 350.0 * (between - along * along.dot(&between)).normalize();
    let turned = nalgebra::Rotation3::from_scaled_axis(nalgebra::Vector3::y() * sigma) * (point - centre);
    // Closest approach of the left ray to the turned right ray (least squares in both ranges).
    let rays = nalgebra::Matrix3x2::from_columns(&[point.normalize(), -turned.normalize()]);
    let ranges = (rays.transpose() * rays).try_inverse().unwrap() * rays.transpose() * centre;
    let expected = (ranges[0] - point.norm()).abs();
    assert!((stated / expected - 1.0).abs() < 0.06, "{stated} mm, expected {expected} mm");
}

#[test]
fn advice_names_the_side_without_corners() {
    let middle = lens().centre().u;
    let mut views = own_views(&lens(), 40, 0.1, &mut Dice::new(9));
    for view in &mut views {
        view.corners.retain(|corner| corner.pixel.u > middle - 150.0);
    }
    views.retain(|view| view.corners.len() >= 20);
    let page = intrinsics_report(&calibrate(&views), &views, &about());
    let (_, advice) = page.split_once("No corners beyond ").expect("advice");
    let (advice, _) = advice.split_once("</li>").unwrap();
    assert!(advice.contains("(left)"), "{advice}");
    assert!(!advice.contains("(right)"), "{advice}");
}

#[test]
fn targets_that_moved_between_the_two_images_are_noticed() {
    let agree = "Both cameras agree on where the targets were";
    assert!(pair_page().contains(agree));
    let pair = Pair { left: lens(), right: other_lens(), left_from_right: pair_pose(20.0), noise_px: 0.1 };
    let mut dice = Dice::new(11);
    let mut views = pair.views(12, &mut dice);
    for view in &mut views {
        let [du, dv] = [dice.normal(), dice.normal()];
        for corner in &mut view.right.corners {
            corner.pixel.u += du;
            corner.pixel.v += dv;
        }
    }
    let found = calibrate_extrinsics(&pair.left, &pair.right, &views, &ExtrinsicsOptions::default()).unwrap();
    let page = extrinsics_report(&found, &views, &about());
    assert!(!page.contains(agree) && page.contains("The views disagree"));
    // The sentence grows by the scatter of the views on top of the larger residual.
    let mm =
        |found: &ExtrinsicsCalibration| extrinsics_verdict(found, &exact_matches().places).depth_sigma.unwrap().mm();
    let ratio = mm(&found) / mm(&PAIR.0);
    assert!(ratio > 2.0 * found.sigma_px / PAIR.0.sigma_px, "{ratio}");
    // The shift of a view is shared by both cameras: half of √2 px rms for each but for what the poses take up.
    let shift = number_after(&page, "Whole targets are off by ");
    assert!((0.2..0.9).contains(&shift), "{shift}");
}
