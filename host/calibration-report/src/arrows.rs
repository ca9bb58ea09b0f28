//! Residual arrows over the image.

use vergence_page::{Anchor, Drawing, Path, round_step, significant};
use vergence_vision::KannalaBrandt;

use crate::colour::BLUES;
use crate::image_frame::ImageFrame;
use crate::pattern::Patch;
use crate::residuals::Observation;

/// Shortest and longest drawn length of the 95 % quantile of residuals; shorter where there are many arrows.
const LONG: [f64; 2] = [13.0, 26.0];
/// Drawn length of the 95 % quantile, in mean distances between corners.
const NEIGHBOURS: f64 = 2.2;
/// Longest arrow, in units of the 95 % quantile; those of outliers are cut off there.
const LONGEST: f64 = 2.3;
const CLASSES: usize = 5;

/// Every residual of each camera, enlarged by one scale; corners left out in red.
pub(crate) fn arrows<const N: usize>(cameras: [(&KannalaBrandt, &[Observation]); N]) -> [Drawing; N] {
    let scales = cameras.iter().map(|(camera, observations)| {
        let used = observations.iter().filter(|observation| observation.used);
        let lengths = sorted(used.filter_map(Observation::length));
        Scale::showing(quantile(&lengths, 0.95), &ImageFrame::of(camera), lengths.len())
    });
    let scale = scales.reduce(Scale::shared);
    cameras.map(|(camera, observations)| {
        let drawn = scale.as_ref().map(|scale| residual_arrows(camera, observations, scale));
        drawn.unwrap_or_else(|| ImageFrame::of(camera).drawing())
    })
}

fn residual_arrows(camera: &KannalaBrandt, observations: &[Observation], scale: &Scale) -> Drawing {
    let frame = ImageFrame::of(camera);
    let mut drawing = frame.drawing();
    frame.background(&mut drawing);
    frame.rings(&mut drawing);
    frame.inside(&mut drawing, |drawing| {
        let mut classes: Vec<Path> = (0..CLASSES).map(|_| Path::default()).collect();
        let (mut left_out, mut crosses) = (Path::default(), Path::default());
        for observation in observations {
            let Some(error) = observation.error else { continue };
            if observation.used {
                let class = scale.class(error);
                classes
                    .iter_mut()
                    .skip(class)
                    .take(1)
                    .for_each(|path| path.arrow(frame.at(observation.observed), scale.of(error)));
            } else {
                left_out.arrow(frame.at(observation.observed), scale.of(error));
                crosses.cross(frame.at(observation.observed), 3.5);
            }
        }
        for (class, path) in classes.iter().enumerate() {
            drawing.path(path, "arrow", &format!("stroke:{}", BLUES.class(class, CLASSES)));
        }
        drawing.path(&left_out, "arrow out", "");
        drawing.path(&crosses, "cross out", "");
    });
    let [x, y] = frame.legend();
    scale.legend(&mut drawing, [x, y]);
    colour_legend(&mut drawing, [x + 190.0, y], scale);
    let mut cross = Path::default();
    cross.cross([x + 470.0, y + 7.0], 3.5);
    drawing.path(&cross, "cross out", "");
    drawing.text([x + 481.0, y + 11.0], Anchor::Start, "tick", "left out");
    drawing
}

/// Mean residual of each patch of the image; those that noise explains are pale.
pub(crate) fn mean_arrows(camera: &KannalaBrandt, patches: &[Patch]) -> Drawing {
    let frame = ImageFrame::of(camera);
    let mut drawing = frame.drawing();
    frame.background(&mut drawing);
    frame.rings(&mut drawing);
    let lengths = sorted(patches.iter().map(|patch| patch.mean[0].hypot(patch.mean[1])));
    let scale = Scale::showing(quantile(&lengths, 0.95), &frame, lengths.len());
    frame.inside(&mut drawing, |drawing| {
        let [mut noise, mut real] = [Path::default(), Path::default()];
        for patch in patches {
            let path = if patch.is_significant() { &mut real } else { &mut noise };
            path.arrow(frame.at(patch.middle), scale.of(patch.mean));
        }
        drawing.path(&noise, "arrow pale", "");
        drawing.path(&real, "arrow strong", "");
    });
    let [x, y] = frame.legend();
    scale.legend(&mut drawing, [x, y]);
    for (place, class, text) in [(190.0, "strong", "more than noise"), (340.0, "pale", "may be noise")] {
        let mut path = Path::default();
        path.arrow([x + place, y + 7.0], [22.0, 0.0]);
        drawing.path(&path, &format!("arrow {class}"), "");
        drawing.text([x + place + 28.0, y + 11.0], Anchor::Start, "tick", text);
    }
    drawing
}

/// Scale of drawn residuals.
#[derive(Clone, Copy)]
struct Scale {
    /// Residual in pixels that the legend's arrow stands for.
    unit: f64,
    /// Drawn length of one pixel of residual.
    factor: f64,
    /// Drawn length of the 95 % quantile of residuals.
    long: f64,
}

impl Scale {
    fn showing(large_px: f64, frame: &ImageFrame, arrows: usize) -> Self {
        const SMALLEST_PX: f64 = 1e-9;
        let large = large_px.max(SMALLEST_PX);
        let [width, height] = frame.extent();
        let long = (NEIGHBOURS * (width * height / arrows.max(1) as f64).sqrt()).clamp(LONG[0], LONG[1]);
        Self { unit: round_step(large, 1.5), factor: long / large, long }
    }

    /// One scale for two figures: the larger residual, drawn as long as in the fuller figure.
    fn shared(self, other: Self) -> Self {
        let large = self.large().max(other.large());
        let long = self.long.min(other.long);
        Self { unit: self.unit.max(other.unit), factor: long / large, long }
    }

    fn of(&self, error: [f64; 2]) -> [f64; 2] {
        let length = self.factor * error[0].hypot(error[1]);
        let longest = LONGEST * self.long;
        let cut = if length > longest { longest / length } else { 1.0 };
        error.map(|e| e * self.factor * cut)
    }

    /// Residual in pixels where the last class ends; longer ones belong to it too.
    fn large(&self) -> f64 {
        self.long / self.factor
    }

    fn class(&self, error: [f64; 2]) -> usize {
        ((error[0].hypot(error[1]) / self.large() * CLASSES as f64) as usize).min(CLASSES - 1)
    }

    fn legend(&self, drawing: &mut Drawing, [x, y]: [f64; 2]) {
        let mut path = Path::default();
        path.arrow([x + 2.0, y + 7.0], [self.unit * self.factor, 0.0]);
        drawing.path(&path, "arrow strong", "");
        let text = format!("{} px of residual", significant(self.unit, 1));
        drawing.text([x + 10.0 + self.unit * self.factor, y + 11.0], Anchor::Start, "tick", &text);
    }
}

fn colour_legend(drawing: &mut Drawing, [x, y]: [f64; 2], scale: &Scale) {
    const WIDE: f64 = 46.0;
    for class in 0..CLASSES {
        let style = format!("fill:{}", BLUES.class(class, CLASSES));
        drawing.rect([x + WIDE * class as f64, y], [WIDE, 12.0], "swatch", &style);
    }
    for edge in 0..=CLASSES {
        let value = scale.large() * edge as f64 / CLASSES as f64;
        let text = match edge {
            0 => "0 px".to_owned(),
            CLASSES => "more".to_owned(),
            _ => significant(value, 2),
        };
        drawing.text([x + WIDE * edge as f64, y + 26.0], Anchor::Middle, "tick", &text);
    }
}

pub(crate) fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Quantile of sorted values; zero of none.
pub(crate) fn quantile(sorted: &[f64], share: f64) -> f64 {
    let last = sorted.len().saturating_sub(1);
    sorted.get((share * last as f64).round() as usize).copied().unwrap_or(0.0)
}
