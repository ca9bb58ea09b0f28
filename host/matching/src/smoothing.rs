//! Smoothing by a Gaussian, row by row: what is in between never leaves the cache.
//!
//! A separable filter that writes whole images in between spends its time on memory, and most of that on pages which the system clears first.
//! Here each band of rows keeps the last few rows, smoothed along themselves, in a ring.

use std::ops::Range;

use multiversion::multiversion;
use rayon::prelude::*;

/// Rows that one thread smooths in a piece: each band smooths some rows of its neighbours again.
const BAND: usize = 64;

/// A normalised Gaussian that is cut off at three sigma.
pub(crate) struct Gaussian {
    weights: Vec<f32>,
}

impl Gaussian {
    pub(crate) fn new(sigma: f32) -> Self {
        let radius = (3.0 * sigma).ceil() as i32;
        let weights: Vec<f32> = (-radius..=radius).map(|i| (-0.5 * (i as f32 / sigma).powi(2)).exp()).collect();
        let sum: f32 = weights.iter().sum();
        Self { weights: weights.iter().map(|w| w / sum).collect() }
    }

    const fn radius(&self) -> usize {
        self.weights.len() / 2
    }

    /// Smooths `N` images of `width` × `height` pixels at once, whose row y `source` writes, and writes what `finish` makes of them to the
    /// rows `wanted` of `out`, which holds these alone. The border is repeated outwards.
    pub(crate) fn smooth<const N: usize>(
        &self,
        [width, height]: [usize; 2],
        wanted: Range<usize>,
        out: &mut [f32],
        source: impl Fn(usize, [&mut [f32]; N]) + Sync,
        finish: impl Fn([&[f32]; N], &mut [f32]) + Sync,
    ) {
        let start = || Ring::<N>::new(self, width);
        out.par_chunks_mut((BAND * width).max(1)).enumerate().for_each_init(start, |ring, (band, out)| {
            let first = wanted.start + band * BAND;
            let mut next = first.saturating_sub(self.radius());
            for (y, out) in (first..).zip(out.chunks_exact_mut(width)) {
                while next <= (y + self.radius()).min(height - 1) {
                    ring.push(self, next, &source);
                    next += 1;
                }
                finish(ring.down(self, y, height), out);
            }
        });
    }
}

/// The last rows of `N` images, smoothed along themselves.
struct Ring<const N: usize> {
    width: usize,
    /// A row of each image before it is smoothed, with its border.
    padded: [Vec<f32>; N],
    /// Row y of an image is at y modulo their number.
    across: [Vec<f32>; N],
    /// A row that is smoothed both ways.
    both: [Vec<f32>; N],
}

impl<const N: usize> Ring<N> {
    fn new(gaussian: &Gaussian, width: usize) -> Self {
        let of = |length: usize| std::array::from_fn(|_| vec![0.0; length]);
        let taps = gaussian.weights.len();
        Self { width, padded: of(width + taps - 1), across: of(width * taps), both: of(width) }
    }

    fn push(&mut self, gaussian: &Gaussian, y: usize, source: &impl Fn(usize, [&mut [f32]; N])) {
        let (radius, width) = (gaussian.radius(), self.width);
        source(y, self.padded.each_mut().map(|padded| &mut padded[radius..][..width]));
        let place = y % gaussian.weights.len() * width;
        for (padded, across) in self.padded.iter_mut().zip(&mut self.across) {
            let (left, right) = (padded[radius], padded[radius + width - 1]);
            padded[..radius].fill(left);
            padded[radius + width..].fill(right);
            let rows: Vec<&[f32]> = (0..gaussian.weights.len()).map(|k| &padded[k..][..width]).collect();
            weigh(&gaussian.weights, &rows, &mut across[place..][..width]);
        }
    }

    fn down(&mut self, gaussian: &Gaussian, y: usize, height: usize) -> [&[f32]; N] {
        let taps = gaussian.weights.len();
        for (across, both) in self.across.iter().zip(&mut self.both) {
            let row = |k: usize| (y + k).saturating_sub(gaussian.radius()).min(height - 1) % taps * self.width;
            let rows: Vec<&[f32]> = (0..taps).map(|k| &across[row(k)..][..self.width]).collect();
            weigh(&gaussian.weights, &rows, both);
        }
        self.both.each_ref().map(Vec::as_slice)
    }
}

/// The weighted sum of rows, in the order of the weights.
///
/// Four rows at a time are added to what there is: a loop over the columns alone is what compilers turn into vector instructions.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
fn weigh(weights: &[f32], rows: &[&[f32]], out: &mut [f32]) {
    let width = out.len();
    out.fill(0.0);
    let (fours, last) = (weights.chunks_exact(4).zip(rows.chunks_exact(4)), weights.len() / 4 * 4);
    for (weights, rows) in fours {
        let (&[a, b, c, d], &[p, q, r, s]) = (weights, rows) else { continue };
        let (p, q, r, s) = (&p[..width], &q[..width], &r[..width], &s[..width]);
        for (x, out) in out.iter_mut().enumerate() {
            *out = *out + a * p[x] + b * q[x] + c * r[x] + d * s[x];
        }
    }
    for (weight, row) in weights[last..].iter().zip(&rows[last..]) {
        out.iter_mut().zip(*row).for_each(|(out, value)| *out += weight * value);
    }
}
