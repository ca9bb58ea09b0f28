//! Advice for the person who holds the target.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

use vergence_calibration::Coverage;
use vergence_targets::{Corner, TargetView};
use vergence_vision::{ImageSize, Pixel};

const SIZE: ImageSize = ImageSize { width: 900, height: 600 };

/// A 5 x 4 target about (u, v), its right side `ratio` times as long as its left one.
fn target_at(u: f64, v: f64, ratio: f64) -> TargetView {
    let corners = (0..20).map(|index| {
        let (column, row) = (f64::from(index % 5), f64::from(index / 5));
        let stretch = 1.0 + (ratio - 1.0) * column / 4.0;
        let pixel = Pixel { u: u + (column - 2.0) * 20.0, v: v + (row - 1.5) * 20.0 * stretch };
        Corner::new([column * 20.0, row * 20.0], pixel)
    });
    TargetView { name: "view".into(), corners: corners.collect() }
}

#[test]
fn it_asks_for_what_is_missing_and_stops_when_all_is_there() {
    let mut coverage = Coverage::new(SIZE);
    assert_eq!(coverage.advice().expect("nothing yet").to_string(), "show the target upper left, tilted");
    let places = [150.0, 450.0, 750.0].map(|u| [100.0, 300.0, 500.0].map(|v| (u, v)));
    for ratio in [1.5, 1.0] {
        for &(u, v) in places.iter().flatten() {
            assert!(coverage.advice().is_some());
            let view = target_at(u, v, ratio);
            assert!(coverage.is_news(&view));
            coverage.add(&view);
        }
    }
    assert_eq!((coverage.views(), coverage.advice()), (18, None));
    assert!(!coverage.is_news(&target_at(450.0, 300.0, 1.5)));
}

#[test]
fn frontal_views_alone_are_not_enough() {
    let mut coverage = Coverage::new(SIZE);
    for round in 0..2 {
        for (u, v) in [150.0, 450.0, 750.0].into_iter().flat_map(|u| [100.0, 300.0, 500.0].map(|v| (u, v))) {
            coverage.add(&target_at(u + f64::from(round), v, 1.0));
        }
    }
    assert!(coverage.advice().expect("no tilt").to_string().ends_with(", tilted"));
    assert!(coverage.is_news(&target_at(450.0, 300.0, 1.5)) && !coverage.is_news(&target_at(450.0, 300.0, 1.0)));
}

#[test]
fn it_points_to_the_corner_that_was_left_out() {
    let mut coverage = Coverage::new(SIZE);
    for _ in 0..2 {
        for (u, v) in [150.0, 450.0, 750.0].into_iter().flat_map(|u| [100.0, 300.0, 500.0].map(|v| (u, v))) {
            if (u, v) != (150.0, 500.0) {
                coverage.add(&target_at(u, v, 1.5));
            }
        }
    }
    assert_eq!(coverage.advice().expect("a corner is missing").to_string(), "show the target lower left");
}

#[test]
fn parts_out_of_reach_are_not_asked_for() {
    // The other camera sees the right third only.
    let mut coverage = Coverage::within(SIZE, |pixel| pixel.u > 600.0);
    for ratio in [1.5, 1.0] {
        for v in [100.0, 300.0, 500.0] {
            assert!(coverage.advice().expect("more").to_string().contains("right"), "{:?}", coverage.advice());
            coverage.add(&target_at(750.0, v, ratio));
        }
    }
    assert_eq!(coverage.advice(), None);
    assert_eq!(Coverage::within(SIZE, |_| false).advice(), None);
}
