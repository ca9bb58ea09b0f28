//! Images side by side as SVG, with marks on them and a scale of colours below. Text stays sharp at every size.

use std::fmt::Write;
use std::io::Cursor;

use image::{ImageError, ImageFormat, Rgb, RgbImage};
use vergence_page::{data_url, escape};
use vergence_vision::Pixel;

/// Text height, as a part of the width of the picture, and at least as a part of that of a panel.
const TEXT: [f64; 2] = [1.0 / 64.0, 1.0 / 40.0];

/// A logarithmic scale of colours, from dark blue at the low end to yellow at the high end.
#[derive(Clone, Copy, Debug)]
pub struct ColourScale {
    low: f64,
    high: f64,
    /// Writes a value of the scale.
    label: fn(f64) -> String,
}

impl ColourScale {
    /// From `low` to `high`, both positive.
    #[must_use]
    pub fn new(low: f64, high: f64, label: fn(f64) -> String) -> Self {
        Self { low, high: high.max(low * 1.01), label }
    }

    /// Ranges in millimetres from the 2 % to the 98 % quantile, so that a stray point does not take all the colours.
    pub fn of_ranges(ranges: impl Iterator<Item = f64>) -> Self {
        let mut ranges: Vec<f64> = ranges.collect();
        ranges.sort_by(f64::total_cmp);
        let quantile = |share: f64| ranges.get(((ranges.len() as f64 - 1.0) * share).round() as usize).copied();
        let label = |mm: f64| format!("{:.2} m", mm / 1000.0);
        Self::new(quantile(0.02).unwrap_or(100.0), quantile(0.98).unwrap_or(1000.0), label)
    }

    /// The sRGB colour of a value; values beyond the ends have the colour of the end.
    #[must_use]
    pub fn colour(&self, value: f64) -> [u8; 3] {
        viridis((value / self.low).ln() / (self.high / self.low).ln())
    }
}

/// A colour for `share` in [0, 1] on the viridis map (S. van der Walt and N. Smith, 2015), dark blue to yellow:
/// even in lightness and readable without red-green vision.
fn viridis(share: f64) -> [u8; 3] {
    const STOPS: [[f64; 3]; 9] = [
        [68.0, 1.0, 84.0],
        [71.0, 44.0, 122.0],
        [59.0, 81.0, 139.0],
        [44.0, 113.0, 142.0],
        [33.0, 144.0, 141.0],
        [39.0, 173.0, 129.0],
        [92.0, 200.0, 99.0],
        [170.0, 220.0, 50.0],
        [253.0, 231.0, 37.0],
    ];
    let position = share.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let index = (position as usize).min(STOPS.len() - 2);
    let weight = position - index as f64;
    std::array::from_fn(|channel| {
        let [from, to] = [STOPS[index][channel], STOPS[index + 1][channel]];
        (from + weight * (to - from)).round() as u8
    })
}

/// An image in light grey, from medium grey to nearly white: the dark end of every scale of colours is darker.
#[must_use]
pub fn light_grey(image: &RgbImage) -> RgbImage {
    let mut light = image.clone();
    for pixel in light.pixels_mut() {
        let [red, green, blue] = pixel.0.map(u16::from);
        *pixel = Rgb([90 + ((red + green + blue) / 5) as u8; 3]);
    }
    light
}

/// A picture of equal panels in a row.
pub struct Panels {
    svg: String,
    panel: [f64; 2],
    columns: usize,
}

impl Panels {
    /// A panel of `width` by `height` pixels for each title.
    #[must_use]
    pub fn new((width, height): (u32, u32), titles: &[&str]) -> Self {
        let mut panels =
            Self { svg: String::new(), panel: [f64::from(width), f64::from(height)], columns: titles.len().max(1) };
        let (text, [wide, tall]) = (panels.text(), panels.panel);
        let (width, height) = (panels.width(), tall + 6.5 * text);
        let _ = writeln!(
            panels.svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height:.1}\" font-family=\"sans-serif\" \
             font-size=\"{text:.1}\">\n<rect width=\"{width}\" height=\"{height:.1}\" fill=\"white\"/>"
        );
        for (index, title) in titles.iter().enumerate() {
            let x = (index as f64 + 0.5) * wide;
            let _ = writeln!(
                panels.svg,
                "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                1.2 * text,
                escape(title)
            );
        }
        panels
    }

    fn width(&self) -> f64 {
        self.panel[0] * self.columns as f64
    }

    fn text(&self) -> f64 {
        (self.width() * TEXT[0]).max(self.panel[0] * TEXT[1])
    }

    /// Where a pixel of a panel lies: positions are at pixel centres.
    fn place(&self, panel: usize, pixel: Pixel) -> (f64, f64) {
        (panel as f64 * self.panel[0] + pixel.u + 0.5, 1.7 * self.text() + pixel.v + 0.5)
    }

    /// Fills a panel with an image: as JPEG for photographs, as PNG for flat colours.
    ///
    /// # Errors
    /// Where the image cannot be encoded.
    pub fn image(&mut self, panel: usize, image: &RgbImage, format: ImageFormat) -> Result<(), ImageError> {
        let mut bytes = Cursor::new(Vec::new());
        image.write_to(&mut bytes, format)?;
        let (x, [wide, tall]) = (panel as f64 * self.panel[0], self.panel);
        let y = 1.7 * self.text();
        let url = data_url(format.to_mime_type(), bytes.get_ref());
        let _ = writeln!(self.svg, "<image x=\"{x}\" y=\"{y:.1}\" width=\"{wide}\" height=\"{tall}\" href=\"{url}\"/>");
        Ok(())
    }

    /// A dot at a pixel of a panel.
    pub fn dot(&mut self, panel: usize, pixel: Pixel, [red, green, blue]: [u8; 3]) {
        let (x, y) = self.place(panel, pixel);
        let radius = self.panel[0] / 320.0;
        let _ = writeln!(
            self.svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius:.1}\" fill=\"rgb({red},{green},{blue})\" stroke=\"#222\" \
             stroke-width=\"{:.1}\"/>",
            radius / 6.0
        );
    }

    /// A line between two pixels, each with its panel.
    pub fn line(&mut self, from: (usize, Pixel), to: (usize, Pixel), [red, green, blue]: [u8; 3]) {
        let ((x1, y1), (x2, y2)) = (self.place(from.0, from.1), self.place(to.0, to.1));
        let _ = writeln!(
            self.svg,
            "<line x1=\"{x1:.1}\" y1=\"{y1:.1}\" x2=\"{x2:.1}\" y2=\"{y2:.1}\" stroke=\"rgb({red},{green},{blue})\" \
             stroke-width=\"{:.1}\"/>",
            self.panel[0] / 800.0
        );
    }

    /// The picture, with `scale` and a note below the panels.
    #[must_use]
    pub fn finish(mut self, scale: &ColourScale, note: &str) -> String {
        const STEPS: u32 = 64;
        const TICKS: u32 = 5;
        let text = self.text();
        let (left, wide) = (2.0 * text, self.width() - 4.0 * text);
        let top = self.panel[1] + 2.2 * text;
        for step in 0..STEPS {
            let share = f64::from(step) / f64::from(STEPS);
            let [red, green, blue] = viridis(share);
            let _ = writeln!(
                self.svg,
                "<rect x=\"{:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"rgb({red},{green},{blue})\"/>",
                left + share * wide,
                // Neighbours overlap, so that no gap shines through.
                wide / f64::from(STEPS) + 1.0,
                0.8 * text
            );
        }
        for tick in 0..=TICKS {
            let share = f64::from(tick) / f64::from(TICKS);
            let value = scale.low * (scale.high / scale.low).powf(share);
            let _ = writeln!(
                self.svg,
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                left + share * wide,
                top + 2.0 * text,
                escape(&(scale.label)(value))
            );
        }
        let _ = writeln!(
            self.svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\n</svg>",
            0.5 * self.width(),
            top + 3.6 * text,
            escape(note)
        );
        self.svg
    }
}
