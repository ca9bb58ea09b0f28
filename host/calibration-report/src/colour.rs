//! Colours for quantities: always from light to dark, so that they survive a printer without colour.

/// A scale of colours from low to high.
pub(crate) struct Ramp(&'static [[f64; 3]]);

/// Colour ramp of residuals.
pub(crate) const BLUES: Ramp =
    Ramp(&[[158.0, 190.0, 224.0], [86.0, 136.0, 193.0], [38.0, 84.0, 150.0], [16.0, 38.0, 88.0]]);
/// Colour ramp of uncertainty: dark is bad.
pub(crate) const EMBERS: Ramp = Ramp(&[
    [255.0, 248.0, 224.0],
    [252.0, 220.0, 150.0],
    [243.0, 170.0, 92.0],
    [221.0, 108.0, 58.0],
    [168.0, 52.0, 44.0],
    [98.0, 20.0, 38.0],
]);
/// Colour ramp of coverage.
pub(crate) const GREENS: Ramp = Ramp(&[[229.0, 243.0, 236.0], [150.0, 205.0, 180.0], [66.0, 148.0, 122.0]]);

impl Ramp {
    /// The colour at `share` of the scale, from 0 to 1.
    pub fn at(&self, share: f64) -> String {
        let last = self.0.len().saturating_sub(1);
        let place = if share.is_finite() { share.clamp(0.0, 1.0) * last as f64 } else { 0.0 };
        let below = (place.floor() as usize).min(last);
        let (a, b) = (self.0[below], self.0[(below + 1).min(last)]);
        let part = place - below as f64;
        let [red, green, blue] = [0, 1, 2].map(|i| (a[i] + (b[i] - a[i]) * part).round() as u8);
        format!("#{red:02x}{green:02x}{blue:02x}")
    }

    /// The colour of class `index` of `count`.
    pub fn class(&self, index: usize, count: usize) -> String {
        self.at(index as f64 / count.saturating_sub(1).max(1) as f64)
    }
}
