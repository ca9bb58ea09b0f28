//! The figures of a camera test, for people and programs.

use serde_json::{Value, json};

use crate::figures::{CameraFigures, Step, TestFigures};

/// A table with one line for each figure and one column for each camera.
#[must_use]
pub fn test_in_words(test: &TestFigures) -> Vec<String> {
    let row = |name: &str, value: &dyn Fn(&CameraFigures) -> Option<String>| {
        let [left, right] = test.cameras.each_ref().map(|camera| value(camera).unwrap_or_else(|| "-".into()));
        format!("{name:<34} {left:>12} {right:>12}")
    };
    let number = |value: Option<f64>, digits: usize| value.map(|value| format!("{value:.digits$}"));
    vec![
        format!("{:<34} {:>12} {:>12}", "", "left", "right"),
        row("images", &|camera| Some(camera.images.to_string())),
        row("lost by their numbers", &|camera| Some(camera.lost.to_string())),
        row("rate, images a second", &|camera| number(camera.rate_hz, 2)),
        row("jitter, ms", &|camera| number(camera.jitter_ms, 2)),
        row("mean level of 255", &|camera| number(camera.looks.map(|looks| looks.mean), 0)),
        row("saturated, % of the field", &|camera| number(camera.looks.map(|looks| looks.saturated * 100.0), 1)),
        row("black, % of the field", &|camera| number(camera.looks.map(|looks| looks.black * 100.0), 1)),
        row("sharpness, variance of Laplacian", &|camera| number(camera.looks.map(|looks| looks.sharpness), 0)),
        row("bandwidth, MB/s", &|camera| number(camera.mb_per_s(), 1)),
        row("pulse to exposure, ms", &|camera| number(camera.trigger?.stamp.map(|step| step.median_ms), 1)),
        row("pulse to arrival, ms", &|camera| number(camera.trigger?.arrival.map(|step| step.median_ms), 1)),
    ]
}

/// The figures for programs.
#[must_use]
pub fn test_json(test: &TestFigures) -> Value {
    let step = |step: Option<Step>| step.map(|step| json!({ "median_ms": step.median_ms, "most_ms": step.most_ms }));
    let camera = |camera: &CameraFigures| {
        json!({
            "images": camera.images,
            "lost": camera.lost,
            "rate_hz": camera.rate_hz,
            "expected_hz": camera.expected_hz,
            "jitter_ms": camera.jitter_ms,
            "mean_level": camera.looks.map(|looks| looks.mean),
            "saturated": camera.looks.map(|looks| looks.saturated),
            "black": camera.looks.map(|looks| looks.black),
            "laplacian_variance": camera.looks.map(|looks| looks.sharpness),
            "bytes_per_image": camera.bytes,
            "mb_per_s": camera.mb_per_s(),
            "usb": camera.usb.map(|usb| json!({ "bus": usb.bus, "mbit_per_s": usb.mbit_per_s })),
            "trigger": camera.trigger.map(|trigger| json!({
                "pulses": trigger.pulses, "paired": trigger.paired, "ambiguous": trigger.ambiguous,
                "pulse_to_exposure": step(trigger.stamp), "pulse_to_arrival": step(trigger.arrival),
            })),
            "troubles": camera.troubles,
        })
    };
    json!({
        "left": camera(&test.cameras[0]),
        "right": camera(&test.cameras[1]),
        "pairs": test.pairs,
        "alone": test.alone,
        "paired_by": if test.by_trigger { "trigger" } else { "time" },
        "difference": step(test.difference),
        "bound_ms": test.bound_ms,
    })
}
