//! Residuals over the angle to the optical axis.

use vergence_page::{Anchor, Axes, Drawing, Path};
use vergence_vision::Angle;

use crate::image_frame::WIDTH;
use crate::residuals::Observation;

/// Number of points of the running root mean square,
const POINTS: usize = 24;
/// each of this many corners or more.
const FEWEST: usize = 12;

/// One figure for each camera, all with the same axes: dots are corners, the line is the root mean square of
/// neighbours, and the angle given with the observations ends the valid cone.
pub(crate) fn field_angles<const N: usize>(cameras: [(&[Observation], Angle); N], sigma_px: f64) -> [Drawing; N] {
    let all = || cameras.iter().flat_map(|(observations, _)| observations.iter());
    let longest = all().filter(|observation| observation.used).filter_map(Observation::length).fold(0.0, f64::max);
    let widest = cameras.iter().map(|(_, valid)| valid.deg()).fold(0.0, f64::max);
    let right = all().map(|observation| observation.theta.to_degrees()).fold(widest, f64::max);
    let ends = [1.02 * right, longest.max(1e-9) * 1.06];
    cameras.map(|(observations, valid)| field_angle(observations, sigma_px, valid, ends))
}

/// `ends` are the ends of the axes, in degrees and pixels.
fn field_angle(observations: &[Observation], sigma_px: f64, valid: Angle, [right, highest]: [f64; 2]) -> Drawing {
    const HEIGHT: f64 = 360.0;
    let mut drawing = Drawing::new(WIDTH, HEIGHT);
    let used = observations.iter().filter(|observation| observation.used).count();
    let axes = Axes::filling(&drawing, [0.0, right], [0.0, highest]);
    drawing.rect(axes.corner(), axes.extent(), "sensor", "");
    axes.draw(&mut drawing, "angle to the optical axis (°)", "residual (px)");

    let [mut dots, mut crosses] = [Path::default(), Path::default()];
    for (observation, length) in
        observations.iter().filter_map(|observation| Some((observation, observation.length()?)))
    {
        let theta = observation.theta.to_degrees();
        if observation.used {
            dots.dot(axes.at(theta, length));
        } else {
            crosses.cross(axes.at(theta, length.min(0.985 * highest)), 3.5);
        }
    }
    drawing.path(&dots, if used > 2000 { "dot small" } else { "dot" }, "");
    drawing.path(&crosses, "cross out", "");

    let noise = sigma_px * std::f64::consts::SQRT_2;
    if noise < highest {
        drawing.line(axes.at(0.0, noise), axes.at(axes.x[1], noise), "level");
        let [x, y] = axes.at(axes.x[1], noise);
        drawing.text([x - 16.0, y - 5.0], Anchor::End, "halo", "noise, rms");
    }
    drawing.line(axes.at(valid.deg(), 0.0), axes.at(valid.deg(), highest), "cone");
    drawing.path(
        &Path::through(&running(observations).map(|(theta, rms)| axes.at(theta, rms)).collect::<Vec<_>>()),
        "run",
        "",
    );
    drawing
}

/// Angle in degrees and root mean square of groups of neighbours of equal number.
fn running(observations: &[Observation]) -> impl Iterator<Item = (f64, f64)> {
    let mut used: Vec<(f64, f64)> = observations
        .iter()
        .filter(|observation| observation.used)
        .filter_map(|observation| Some((observation.theta, observation.length()?)))
        .collect();
    used.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let group = used.len().div_ceil(POINTS).max(FEWEST);
    let figures: Vec<_> = used
        .chunks(group)
        // A short last group would jump.
        .filter(|chunk| 2 * chunk.len() >= group)
        .map(|chunk| {
            let count = chunk.len() as f64;
            let theta = chunk.iter().map(|(theta, _)| theta).sum::<f64>() / count;
            (theta.to_degrees(), (chunk.iter().map(|(_, e)| e * e).sum::<f64>() / count).sqrt())
        })
        .collect();
    figures.into_iter()
}
