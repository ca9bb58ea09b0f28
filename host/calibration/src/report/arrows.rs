//! Residual arrows over the image.

use vergence_page::{Anchor, Drawing, Path, round_step, significant};
use vergence_vision::KannalaBrandt;

use super::colour::BLUES;
use super::image_frame::ImageFrame;
use super::pattern::Patch;
use super::residuals::Sight;

/// A large arrow (all but one in twenty are shorter) is so long, and shorter where there are many.
const LONG: [f64; 2] = [13.0, 26.0];
/// It reaches over so many mean distances between corners.
const NEIGHBOURS: f64 = 2.2;
/// No arrow is longer than so many large ones: those of outliers say their direction only.
const LONGEST: f64 = 2.3;
const CLASSES: usize = 5;

/// Every residual, enlarged; corners left out in red.
pub(super) fn arrows(camera: &KannalaBrandt, sights: &[Sight]) -> Drawing {
    let frame = ImageFrame::of(camera);
    let mut drawing = frame.drawing();
    frame.background(&mut drawing);
    frame.rings(&mut drawing);
    let lengths = sorted(sights.iter().filter(|sight| sight.used).filter_map(Sight::length));
    let scale = Scale::showing(quantile(&lengths, 0.95), &frame, lengths.len());
    frame.inside(&mut drawing, |drawing| {
        let mut classes: Vec<Path> = (0..CLASSES).map(|_| Path::default()).collect();
        let (mut left_out, mut crosses) = (Path::default(), Path::default());
        for sight in sights {
            let Some(error) = sight.error else { continue };
            if sight.used {
                let class = scale.class(error);
                classes
                    .iter_mut()
                    .skip(class)
                    .take(1)
                    .for_each(|path| path.arrow(frame.at(sight.seen), scale.of(error)));
            } else {
                left_out.arrow(frame.at(sight.seen), scale.of(error));
                crosses.cross(frame.at(sight.seen), 3.5);
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
    colour_legend(&mut drawing, [x + 190.0, y], &scale);
    let mut cross = Path::default();
    cross.cross([x + 470.0, y + 7.0], 3.5);
    drawing.path(&cross, "cross out", "");
    drawing.text([x + 481.0, y + 11.0], Anchor::Start, "tick", "left out");
    drawing
}

/// The mean residual of patches of the image; those that noise explains are pale.
pub(super) fn mean_arrows(camera: &KannalaBrandt, patches: &[Patch]) -> Drawing {
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

/// How long a residual is drawn.
struct Scale {
    /// Residual in pixels of a legend's arrow.
    unit: f64,
    /// Drawn length of one pixel of residual.
    factor: f64,
    /// Drawn length of a large residual.
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

    fn of(&self, error: [f64; 2]) -> [f64; 2] {
        let length = self.factor * error[0].hypot(error[1]);
        let longest = LONGEST * self.long;
        let cut = if length > longest { longest / length } else { 1.0 };
        error.map(|e| e * self.factor * cut)
    }

    /// The longest residual of the last class but for those that exceed it.
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

pub(super) fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values
}

/// Of values in order; zero of none.
pub(super) fn quantile(sorted: &[f64], share: f64) -> f64 {
    let last = sorted.len().saturating_sub(1);
    sorted.get((share * last as f64).round() as usize).copied().unwrap_or(0.0)
}
