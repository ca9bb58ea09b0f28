//! Residuals over the angle to the optical axis.

use vergence_page::{Anchor, Axes, Drawing, Path};
use vergence_vision::Angle;

use super::arrows::{quantile, sorted};
use super::image_frame::WIDTH;
use super::residuals::Sight;

/// The running figure has about so many points,
const POINTS: usize = 24;
/// each of so many corners at least.
const FEWEST: usize = 12;

/// Dots are corners, the line is the root mean square of neighbours; `valid` ends the valid cone.
pub(super) fn field_angle(sights: &[Sight], sigma_px: f64, valid: Angle) -> Drawing {
    const HEIGHT: f64 = 360.0;
    let mut drawing = Drawing::new(WIDTH, HEIGHT);
    let lengths = sorted(sights.iter().filter(|sight| sight.used).filter_map(Sight::length));
    let highest = quantile(&lengths, 1.0).max(1e-9) * 1.06;
    let right = sights.iter().map(|sight| sight.theta.to_degrees()).fold(valid.deg(), f64::max);
    let axes = Axes::filling(&drawing, [0.0, 1.02 * right], [0.0, highest]);
    drawing.rect(axes.corner(), axes.extent(), "sensor", "");
    axes.draw(&mut drawing, "angle to the optical axis (°)", "residual (px)");

    let [mut dots, mut crosses] = [Path::default(), Path::default()];
    for (sight, length) in sights.iter().filter_map(|sight| Some((sight, sight.length()?))) {
        let theta = sight.theta.to_degrees();
        if sight.used {
            dots.dot(axes.at(theta, length));
        } else {
            crosses.cross(axes.at(theta, length.min(0.985 * highest)), 3.5);
        }
    }
    drawing.path(&dots, if lengths.len() > 2000 { "dot small" } else { "dot" }, "");
    drawing.path(&crosses, "cross out", "");

    let noise = sigma_px * std::f64::consts::SQRT_2;
    if noise < highest {
        drawing.line(axes.at(0.0, noise), axes.at(axes.x[1], noise), "level");
        let [x, y] = axes.at(axes.x[1], noise);
        drawing.text([x - 16.0, y - 5.0], Anchor::End, "halo", "noise, rms");
    }
    drawing.line(axes.at(valid.deg(), 0.0), axes.at(valid.deg(), highest), "cone");
    drawing.path(
        &Path::through(&running(sights).map(|(theta, rms)| axes.at(theta, rms)).collect::<Vec<_>>()),
        "run",
        "",
    );
    drawing
}

/// Angle in degrees and root mean square of groups of neighbours of equal number.
fn running(sights: &[Sight]) -> impl Iterator<Item = (f64, f64)> {
    let mut used: Vec<(f64, f64)> =
        sights.iter().filter(|sight| sight.used).filter_map(|sight| Some((sight.theta, sight.length()?))).collect();
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
