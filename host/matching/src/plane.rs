//! A brightness image in floating point, its smoothing and its pyramid.

use rayon::prelude::*;

/// Values by rows, sampled at whole positions from (0, 0).
#[derive(Clone, Debug)]
pub(crate) struct Plane {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl Plane {
    pub(crate) fn new(width: usize, height: usize, values: Vec<f32>) -> Self {
        debug_assert_eq!(values.len(), width * height);
        Self { width, height, values }
    }

    pub(crate) const fn width(&self) -> usize {
        self.width
    }

    pub(crate) const fn height(&self) -> usize {
        self.height
    }

    pub(crate) fn values(&self) -> &[f32] {
        &self.values
    }

    pub(crate) fn row(&self, y: usize) -> &[f32] {
        &self.values[y * self.width..][..self.width]
    }

    pub(crate) fn at(&self, x: usize, y: usize) -> f32 {
        self.values[y * self.width + x]
    }

    /// A plane of the same size whose row y is filled in by `fill(y, row)`.
    pub(crate) fn like(&self, fill: impl Fn(usize, &mut [f32]) + Sync) -> Self {
        let mut values = vec![0.0; self.values.len()];
        values.par_chunks_mut(self.width).enumerate().for_each(|(y, row)| fill(y, row));
        Self { width: self.width, height: self.height, values }
    }

    /// Convolved with a Gaussian of `sigma` pixels, the border repeated.
    pub(crate) fn blurred(&self, sigma: f32) -> Self {
        let kernel = gaussian(sigma);
        let radius = kernel.len() / 2;
        let across = self.like(|y, out| {
            let row = self.row(y);
            let padded: Vec<f32> =
                (0..self.width + 2 * radius).map(|i| row[i.saturating_sub(radius).min(self.width - 1)]).collect();
            for (k, weight) in kernel.iter().enumerate() {
                out.iter_mut().zip(&padded[k..]).for_each(|(o, v)| *o += weight * v);
            }
        });
        across.like(|y, out| {
            for (k, weight) in kernel.iter().enumerate() {
                let from = across.row((y + k).saturating_sub(radius).min(self.height - 1));
                out.iter_mut().zip(from).for_each(|(o, v)| *o += weight * v);
            }
        })
    }

    /// Every second pixel of every second row: position (x, y) comes from (2x, 2y).
    fn decimated(&self) -> Self {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let values = (0..height).flat_map(|y| self.row(2 * y).iter().step_by(2).copied()).collect();
        Self { width, height, values }
    }

    /// The value between pixels by cubic convolution; `None` within a pixel of the border or outside.
    pub(crate) fn sample(&self, x: f64, y: f64) -> Option<f32> {
        let inside = |x: f64, n: usize| x >= 1.0 && x < n as f64 - 2.0;
        if !(inside(x, self.width) && inside(y, self.height)) {
            return None;
        }
        let (column, row) = (x as usize, y as usize);
        let (wx, wy) = (cubic_weights((x - column as f64) as f32), cubic_weights((y - row as f64) as f32));
        let mut sum = 0.0;
        for (j, w) in wy.iter().enumerate() {
            let t = &self.values[(row - 1 + j) * self.width + column - 1..][..4];
            sum += w * (wx[0] * t[0] + wx[1] * t[1] + wx[2] * t[2] + wx[3] * t[3]);
        }
        Some(sum)
    }
}

/// Smoothed planes at resolutions halved from one to the next: position x of level l is 2^l x of level 0.
#[derive(Clone, Debug)]
pub(crate) struct Pyramid {
    levels: Vec<Plane>,
}

impl Pyramid {
    /// Smoothing of each level, in its own pixels: enough for halving to lose little and for derivatives to be smooth.
    const SIGMA: f32 = 1.0;
    /// A level smaller than this has no room for a descriptor.
    const SMALLEST: usize = 32;

    /// At most `levels` levels of `plane`, fewer where it is small.
    pub(crate) fn new(plane: &Plane, levels: usize) -> Self {
        let mut pyramid: Vec<Plane> = Vec::with_capacity(levels);
        while pyramid.len() < levels {
            let next = pyramid.last().map_or_else(|| plane.clone(), Plane::decimated);
            if next.width.min(next.height) < Self::SMALLEST {
                break;
            }
            pyramid.push(next.blurred(Self::SIGMA));
        }
        Self { levels: pyramid }
    }

    /// Finest first.
    pub(crate) fn levels(&self) -> &[Plane] {
        &self.levels
    }
}

/// Weights of the four pixels around a position `t` past the second of them (Keys 1981, a = −1/2).
pub(crate) fn cubic_weights(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [0.5 * (2.0 * t2 - t3 - t), 0.5 * (3.0 * t3 - 5.0 * t2 + 2.0), 0.5 * (4.0 * t2 - 3.0 * t3 + t), 0.5 * (t3 - t2)]
}

/// A normalised Gaussian cut at three sigma.
fn gaussian(sigma: f32) -> Vec<f32> {
    let radius = (3.0 * sigma).ceil() as i32;
    let weights: Vec<f32> = (-radius..=radius).map(|i| (-0.5 * (i as f32 / sigma).powi(2)).exp()).collect();
    let sum: f32 = weights.iter().sum();
    weights.iter().map(|w| w / sum).collect()
}
