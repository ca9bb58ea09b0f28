//! Ranges as colours, and the bar that explains them.

use image::{Rgb, RgbImage};
use vergence_vision::Length;

use super::colour_map::viridis;
use super::text::{fill, write_text};

/// Room around texts and bar, in pixels.
pub const MARGIN: u32 = 16;
/// Height of the strip with the bar, in pixels.
pub const BAR_HEIGHT: u32 = 72;

/// Ranges on a logarithmic scale: a step of colour is a step in per cent.
pub struct RangeScale {
    nearest: f64,
    farthest: f64,
}

impl RangeScale {
    /// From the 2 % to the 98 % quantile, so that a stray point does not take all the colours.
    pub fn of(ranges: impl Iterator<Item = Length>) -> Self {
        let mut ranges: Vec<f64> = ranges.map(Length::mm).collect();
        ranges.sort_by(f64::total_cmp);
        let quantile = |share: f64| ranges.get(((ranges.len() as f64 - 1.0) * share).round() as usize).copied();
        let nearest = quantile(0.02).unwrap_or(100.0);
        Self { nearest, farthest: quantile(0.98).unwrap_or(1000.0).max(nearest * 1.01) }
    }

    pub fn colour(&self, range: Length) -> Rgb<u8> {
        Rgb(viridis((range.mm() / self.nearest).ln() / (self.farthest / self.nearest).ln()))
    }

    /// A bar with its ranges below the picture.
    pub fn draw(&self, canvas: &mut RgbImage, note: &str) {
        const TICKS: u32 = 6;
        let (width, top) = (canvas.width().saturating_sub(2 * MARGIN), canvas.height().saturating_sub(BAR_HEIGHT) + 8);
        for column in 0..width {
            let colour = viridis(f64::from(column) / f64::from(width));
            fill(canvas, (MARGIN + column, top), (1, 20), colour);
        }
        for tick in 0..=TICKS {
            let share = f64::from(tick) / f64::from(TICKS);
            let mm = self.nearest * (self.farthest / self.nearest).powf(share);
            let label = format!("{:.2} m", mm / 1000.0);
            let long = (label.len() as u32) * 16;
            let last = (MARGIN + width).saturating_sub(long);
            let x = (MARGIN + (share * f64::from(width)) as u32).saturating_sub(long / 2).max(MARGIN).min(last);
            write_text(canvas, (x, top + 26), 2, &label);
        }
        write_text(canvas, (MARGIN, top + 46), 2, note);
    }
}

/// Half as bright and grey, so that colours stand out.
pub fn dimmed(image: &RgbImage) -> RgbImage {
    let mut dim = image.clone();
    for pixel in dim.pixels_mut() {
        let [r, g, b] = pixel.0.map(u16::from);
        *pixel = Rgb([((r + g + b) / 6) as u8; 3]);
    }
    dim
}
