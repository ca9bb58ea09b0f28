//! The uncertainty of rays over the image, as filled contours.

use std::f64::consts::TAU;

use vergence_calibration::{IntrinsicsCalibration, RayUncertainty};
use vergence_page::{Anchor, Drawing, Path, significant};

use crate::arrows::{quantile, sorted};
use crate::colour::EMBERS;
use crate::image_frame::{ImageFrame, direction};

/// Cells from the axis to the rim, and around.
const RINGS: u32 = 72;
const SECTORS: u32 = 144;
/// Share of the cells, the best ones in the middle, that the first class takes.
const BEST_SHARE: f64 = 0.15;
/// Most classes between the outermost levels.
const MOST_CLASSES: usize = 11;
/// Levels within a factor of ten, from coarse to fine; the finest are the series E12 of IEC 60063.
const SERIES: [&[f64]; 3] =
    [&[1.0, 2.0, 5.0], &[1.0, 1.5, 2.0, 3.0, 5.0, 7.0], &[1.0, 1.2, 1.5, 1.8, 2.2, 2.7, 3.3, 3.9, 4.7, 5.6, 6.8, 8.2]];

pub(crate) fn ray_map(calibration: &IntrinsicsCalibration) -> Drawing {
    let frame = ImageFrame::of(&calibration.camera);
    let mut drawing = frame.drawing();
    frame.background(&mut drawing);
    let cells = cells(calibration, frame.valid().rad());
    let sigmas = sorted(cells.iter().filter(|cell| cell.on_sensor).map(|cell| cell.sigma_mrad));
    let levels = levels(quantile(&sigmas, BEST_SHARE), quantile(&sigmas, 1.0));
    let classes = levels.len().saturating_sub(1).max(1);
    let class = |cell: &MapCell| class_of(&levels, cell.sigma_mrad);
    let mut paths: Vec<Path> = (0..classes).map(|_| Path::default()).collect();
    for run in cells.chunk_by(|a, b| a.ring == b.ring && class(a) == class(b)) {
        if let Some((first, last)) = run.first().zip(run.last()) {
            let outline = frame.cell(first.theta, [first.phi[0], last.phi[1]]);
            paths.iter_mut().skip(class(first)).take(1).for_each(|path| path.polygon(&outline));
        }
    }
    frame.inside(&mut drawing, |drawing| {
        for (class, path) in paths.iter().enumerate() {
            let colour = EMBERS.class(class, classes);
            drawing.path(path, "patch", &format!("fill:{colour};stroke:{colour}"));
        }
    });
    frame.rings(&mut drawing);
    legend(&mut drawing, frame.legend(), &levels, calibration.opencv.fx);
    drawing
}

struct MapCell {
    ring: u32,
    theta: [f64; 2],
    phi: [f64; 2],
    sigma_mrad: f64,
    on_sensor: bool,
}

/// Ring by ring.
fn cells(calibration: &IntrinsicsCalibration, rim: f64) -> Vec<MapCell> {
    let uncertainty = RayUncertainty::of(calibration);
    let theta = |ring: u32, part: f64| rim * (f64::from(ring) + part) / f64::from(RINGS);
    let phi = |sector: u32, part: f64| TAU * (f64::from(sector) + part) / f64::from(SECTORS);
    let cell = |ring: u32, sector: u32| {
        let pixel = calibration.camera.project(&direction(theta(ring, 0.5), phi(sector, 0.5))?).ok()?;
        let sigma_mrad = 1e3 * uncertainty.at(pixel).ok()?.sigma().rad();
        Some(MapCell {
            ring,
            theta: [theta(ring, 0.0), theta(ring, 1.0)],
            phi: [phi(sector, 0.0), phi(sector, 1.0)],
            sigma_mrad,
            on_sensor: calibration.camera.on_sensor(pixel),
        })
    };
    let places = (0..RINGS).flat_map(|ring| (0..SECTORS).map(move |sector| (ring, sector)));
    places.filter_map(|(ring, sector)| cell(ring, sector)).filter(|cell| cell.sigma_mrad.is_finite()).collect()
}

/// Round numbers from below `least` to above `most`, in the finest series with few enough classes.
fn levels(least: f64, most: f64) -> Vec<f64> {
    if !(least > 0.0 && most.is_finite()) {
        return Vec::new();
    }
    let decades = || least.log10().floor() as i32..=most.log10().floor() as i32;
    let every = |series: &[f64]| -> Vec<f64> {
        let round: Vec<f64> = decades().flat_map(|decade| series.iter().map(move |s| s * 10f64.powi(decade))).collect();
        let below = round.iter().rposition(|level| *level <= least).unwrap_or(0);
        let top = 10f64.powi(decades().end() + 1);
        let above = round.iter().position(|level| *level >= most).unwrap_or(round.len());
        round.into_iter().chain([top]).skip(below).take(above + 1 - below).collect()
    };
    let fine_enough = SERIES.iter().rev().map(|series| every(series)).find(|levels| levels.len() <= MOST_CLASSES + 1);
    fine_enough.unwrap_or_else(|| every(&[1.0]))
}

fn class_of(levels: &[f64], sigma_mrad: f64) -> usize {
    let above = levels.iter().skip(1).take_while(|level| sigma_mrad > **level).count();
    above.min(levels.len().saturating_sub(2))
}

/// Levels in milliradians, and in pixels at the scale of the image's middle.
fn legend(drawing: &mut Drawing, [x, y]: [f64; 2], levels: &[f64], pixels_per_radian: f64) {
    const WIDE: f64 = 430.0;
    let classes = levels.len().saturating_sub(1);
    let part = WIDE / classes.max(1) as f64;
    for class in 0..classes {
        let style = format!("fill:{}", EMBERS.class(class, classes));
        drawing.rect([x + 14.0 + part * class as f64, y - 4.0], [part, 12.0], "swatch", &style);
    }
    for (edge, level) in levels.iter().enumerate() {
        let place = x + 14.0 + part * edge as f64;
        drawing.text(
            [place, y + 22.0],
            Anchor::Middle,
            "tick",
            &if edge == 0 { "0".to_owned() } else { significant(*level, 2) },
        );
        let pixels = significant(if edge == 0 { 0.0 } else { level * 1e-3 * pixels_per_radian }, 2);
        drawing.text([place, y + 37.0], Anchor::Middle, "tick pale", &pixels);
    }
    drawing.text([x + WIDE + 50.0, y + 22.0], Anchor::Start, "tick", "mrad");
    drawing.text([x + WIDE + 50.0, y + 37.0], Anchor::Start, "tick pale", "px at the axis");
}
