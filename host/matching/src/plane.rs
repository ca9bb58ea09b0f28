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

    /// The values between pixels by cubic convolution, along a row at the columns x, x + step and so on, with a step above 0;
    /// `None` where one is within a pixel of the border or outside, where they spread over nearly [`Self::SPAN`] pixels, and
    /// where the plane is narrower than that.
    #[inline(always)]
    pub(crate) fn sample_row<const N: usize>(&self, x: f64, step: f64, y: f64) -> Option<[f32; N]> {
        let inside = |x: f64, n: usize| x >= 1.0 && x < n as f64 - 2.0;
        let last = x + step * (N - 1) as f64;
        if !(step > 0.0 && inside(y, self.height) && inside(x, self.width) && inside(last, self.width)) {
            return None;
        }
        let first = (x as usize - 1).min(self.width.checked_sub(Self::SPAN)?);
        // A column to spare, for rounding.
        if last as usize + 4 > first + Self::SPAN {
            return None;
        }
        let row = y as usize;
        let line = |j: usize| self.values.get((row - 1 + j) * self.width + first..)?.first_chunk::<{ Self::SPAN }>();
        let (lines, wy) = ([line(0)?, line(1)?, line(2)?, line(3)?], cubic_weights((y - row as f64) as f32));
        let mut mixed = [0.0_f32; Self::SPAN];
        for i in 0..Self::SPAN {
            mixed[i] = wy[0] * lines[0][i] + wy[1] * lines[1][i] + wy[2] * lines[2][i] + wy[3] * lines[3][i];
        }
        // Places as whole numbers: their parts are had without a conversion that must look out for what is too large.
        const FRACTION: u32 = 26;
        let fixed = |length: f64| (length * f64::from(1 << FRACTION)) as u32;
        let (start, step) = (fixed(x - first as f64), fixed(step));
        let (mut columns, mut past) = ([0; N], [0.0; N]);
        for i in 0..N {
            let place = start.wrapping_add(step.wrapping_mul(i as u32));
            columns[i] = place >> FRACTION;
            past[i] = (place & ((1 << FRACTION) - 1)) as i32 as f32 * (1.0 / (1 << FRACTION) as f32);
        }
        let mut weights = [[0.0; N]; 4];
        for i in 0..N {
            let found = cubic_weights(past[i]);
            (weights[0][i], weights[1][i], weights[2][i], weights[3][i]) = (found[0], found[1], found[2], found[3]);
        }
        let mut taps = [[0.0; N]; 4];
        for i in 0..N {
            let found = mixed[columns[i] as usize - 1..].first_chunk::<4>()?;
            (taps[0][i], taps[1][i], taps[2][i], taps[3][i]) = (found[0], found[1], found[2], found[3]);
        }
        let mut values = [0.0; N];
        for i in 0..N {
            values[i] = weights[0][i] * taps[0][i]
                + weights[1][i] * taps[1][i]
                + weights[2][i] * taps[2][i]
                + weights[3][i] * taps[3][i];
        }
        Some(values)
    }

    /// How many pixels of a row are looked at together.
    const SPAN: usize = 32;
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
            let coarser = pyramid.last().map(Plane::decimated);
            let next = coarser.as_ref().unwrap_or(plane);
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
#[inline(always)]
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
