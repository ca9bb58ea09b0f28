//! Brightness images in floating point, their smoothing and their pyramids.

use rayon::prelude::*;

use crate::smoothing::Gaussian;

/// An image of one floating-point value per pixel, by rows.
#[derive(Clone, Debug, Default)]
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

    /// Makes a plane of the same size whose row y is filled by `fill(y, row)`, starting from zeros.
    pub(crate) fn like(&self, fill: impl Fn(usize, &mut [f32]) + Sync) -> Self {
        let mut values = vec![0.0; self.values.len()];
        values.par_chunks_mut(self.width).enumerate().for_each(|(y, row)| fill(y, row));
        Self { width: self.width, height: self.height, values }
    }

    /// Convolves with a Gaussian of `sigma` pixels; the border is repeated outwards.
    #[cfg(test)]
    pub(crate) fn blurred(&self, sigma: f32) -> Self {
        self.smoothed(&Gaussian::new(sigma), 1, Vec::new())
    }

    /// Takes every pixel of every row that `step` divides, smoothed as they are beside each other: position (x, y) comes from (step x,
    /// step y). The values go to `buffer`.
    fn smoothed(&self, gaussian: &Gaussian, step: usize, mut buffer: Vec<f32>) -> Self {
        let (width, height) = (self.width.div_ceil(step), self.height.div_ceil(step));
        buffer.resize(width * height, 0.0);
        let source = |y: usize, [row]: [&mut [f32]; 1]| {
            let from = self.row(step * y);
            match step {
                1 => row.copy_from_slice(from),
                _ => row.iter_mut().zip(from.iter().step_by(step)).for_each(|(to, from)| *to = *from),
            }
        };
        let finish = |[row]: [&[f32]; 1], out: &mut [f32]| out.copy_from_slice(row);
        gaussian.smooth([width, height], 0..height, &mut buffer, source, finish);
        Self { width, height, values: buffer }
    }

    /// The memory of the values, to be used again.
    pub(crate) fn into_values(self) -> Vec<f32> {
        self.values
    }

    /// Interpolates `N` values in row y, at the columns x, x + step and so on, by cubic convolution. The step is
    /// positive.
    ///
    /// `None` where a position is within a pixel of the border or outside, where the positions spread over more than 45
    /// pixels, and where they spread over more than 27 pixels in a plane narrower than 48.
    #[inline(always)]
    pub(crate) fn sample_row<const N: usize>(&self, x: f64, step: f64, y: f64) -> Option<[f32; N]> {
        let inside = |x: f64, n: usize| x >= 1.0 && x < n as f64 - 2.0;
        let last = x + step * (N - 1) as f64;
        if !(step > 0.0 && inside(y, self.height) && inside(x, self.width) && inside(last, self.width)) {
            return None;
        }
        // Most calls span few pixels, and the shorter span is faster.
        match last - x {
            ..19.0 => self.sample_within::<N, 24>(x, step, y),
            ..27.0 => self.sample_within::<N, 32>(x, step, y),
            _ => self.sample_within::<N, 48>(x, step, y),
        }
    }

    /// The loop of [`Self::sample_row`] within `SPAN` pixels of a row; all positions are inside the plane.
    #[inline(always)]
    fn sample_within<const N: usize, const SPAN: usize>(&self, x: f64, step: f64, y: f64) -> Option<[f32; N]> {
        let first = (x as usize - 1).min(self.width.checked_sub(SPAN)?);
        if (x + step * (N - 1) as f64) as usize + 3 > first + SPAN {
            return None;
        }
        let row = y as usize;
        let line = |j: usize| self.values.get((row - 1 + j) * self.width + first..)?.first_chunk::<SPAN>();
        let (lines, wy) = ([line(0)?, line(1)?, line(2)?, line(3)?], cubic_weights((y - row as f64) as f32));
        let mut mixed = [0.0_f32; MIXED];
        let inner = mixed[FARTHEST_DRIFT..].first_chunk_mut::<SPAN>()?;
        for i in 0..SPAN {
            inner[i] = wy[0] * lines[0][i] + wy[1] * lines[1][i] + wy[2] * lines[2][i] + wy[3] * lines[3][i];
        }
        // Positions in fixed point, rounded down and so never beyond the last: splitting them needs no saturating
        // conversion.
        const FRACTION: u32 = 25;
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
        let taps = taps(&mixed, &columns)?;
        let mut values = [0.0; N];
        for i in 0..N {
            values[i] = weights[0][i] * taps[0][i]
                + weights[1][i] * taps[1][i]
                + weights[2][i] * taps[2][i]
                + weights[3][i] * taps[3][i];
        }
        Some(values)
    }
}

/// Values of a row that are kept, with room on both sides for those that are read and not used.
const MIXED: usize = 80;
/// By so many columns the last of some positions may be off where the first and their number put it.
const FARTHEST_DRIFT: usize = 2;

/// The four pixels around each of `N` positions that lie past `columns`, the first pixels of all, then the second ones, and so on. Column 0 is at
/// [`FARTHEST_DRIFT`] of `mixed`.
///
/// Where positions are nearly a pixel apart, columns follow one another but in one or two places, and are copied as they lie.
#[inline(always)]
fn taps<const N: usize>(mixed: &[f32; MIXED], columns: &[u32; N]) -> Option<[[f32; N]; 4]> {
    let mut taps = [[0.0; N]; 4];
    let (first, last) = (*columns.first()?, *columns.last()?);
    let drift = last.wrapping_sub(first).wrapping_sub(N as u32 - 1) as i32;
    let start = first as usize + FARTHEST_DRIFT - 1;
    if drift.unsigned_abs() as usize > FARTHEST_DRIFT {
        for i in 0..N {
            let found = mixed[columns[i] as usize + FARTHEST_DRIFT - 1..].first_chunk::<4>()?;
            (taps[0][i], taps[1][i], taps[2][i], taps[3][i]) = (found[0], found[1], found[2], found[3]);
        }
        return Some(taps);
    }
    for (k, taps) in taps.iter_mut().enumerate() {
        *taps = *mixed[start + k..].first_chunk::<N>()?;
    }
    for by in 1..=drift.abs() {
        let by = by * drift.signum();
        let from = start.checked_add_signed(by as isize)?;
        for (k, taps) in taps.iter_mut().enumerate() {
            let moved = mixed[from + k..].first_chunk::<N>()?;
            for i in 0..N {
                let is_moved = columns[i] == first.wrapping_add(i as u32).wrapping_add_signed(by);
                taps[i] = if is_moved { moved[i] } else { taps[i] };
            }
        }
    }
    Some(taps)
}

/// Smoothed planes of halved resolutions: position x of level l is 2^l x of level 0.
#[derive(Clone, Debug, Default)]
pub(crate) struct Pyramid {
    levels: Vec<Plane>,
}

impl Pyramid {
    /// Smoothing of each level in its own pixels, enough for halving without aliasing and for smooth derivatives.
    const SIGMA: f32 = 1.0;
    /// Smallest side of a level, which has room for a descriptor.
    const SMALLEST: usize = 32;

    /// Makes at most `levels` levels of `plane`, fewer where it is small.
    pub(crate) fn new(plane: &Plane, levels: usize) -> Self {
        Self::in_buffers(plane, levels, &mut Vec::new())
    }

    /// The same in memory that is taken from `buffers`.
    pub(crate) fn in_buffers(plane: &Plane, levels: usize, buffers: &mut Vec<Vec<f32>>) -> Self {
        let gaussian = Gaussian::new(Self::SIGMA);
        let mut pyramid: Vec<Plane> = Vec::with_capacity(levels);
        while pyramid.len() < levels {
            let (finer, step) = pyramid.last().map_or((plane, 1), |finer| (finer, 2));
            if finer.width.min(finer.height).div_ceil(step) < Self::SMALLEST {
                break;
            }
            pyramid.push(finer.smoothed(&gaussian, step, buffers.pop().unwrap_or_default()));
        }
        Self { levels: pyramid }
    }

    /// Gives the memory of all levels back.
    pub(crate) fn recycle(self, buffers: &mut Vec<Vec<f32>>) {
        // The largest is taken first again.
        buffers.extend(self.levels.into_iter().rev().map(Plane::into_values));
    }

    /// The levels, finest first.
    pub(crate) fn levels(&self) -> &[Plane] {
        &self.levels
    }
}

/// Weights of the four pixels around a position `t` past the second of them, by cubic convolution (Keys 1981, a =
/// −1/2).
#[inline(always)]
pub(crate) fn cubic_weights(t: f32) -> [f32; 4] {
    let (t2, t3) = (t * t, t * t * t);
    [0.5 * (2.0 * t2 - t3 - t), 0.5 * (3.0 * t3 - 5.0 * t2 + 2.0), 0.5 * (4.0 * t2 - 3.0 * t3 + t), 0.5 * (t3 - t2)]
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SIZE: usize = 70;

    proptest! {
        /// Compares with the sum over the sixteen pixels around each position.
        #[test]
        fn a_row_is_sampled_as_its_places_are(
            seed in 0u64..1000, x in 0.0..60.0f64, y in 0.0..70.0f64, step in 0.3..2.6f64,
        ) {
            let noise = |i: usize| (((i as u64 + seed).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40) % 256) as f32;
            let plane = Plane::new(SIZE, SIZE, (0..SIZE * SIZE).map(noise).collect());
            let inside = |place: f64| (1.0..(SIZE - 2) as f64).contains(&place);
            let last = x + 16.0 * step;
            let found = plane.sample_row::<17>(x, step, y);
            prop_assert_eq!(found.is_some(), inside(x) && inside(y) && inside(last));
            for (i, found) in found.iter().flatten().enumerate() {
                let (column, row) = (x + step * i as f64, y);
                let wx = cubic_weights(column.fract() as f32);
                let wy = cubic_weights(row.fract() as f32);
                let tap = |i: usize, j: usize| plane.at(column as usize - 1 + i, row as usize - 1 + j) * wx[i] * wy[j];
                let expected: f32 = (0..16).map(|k| tap(k % 4, k / 4)).sum();
                prop_assert!((found - expected).abs() < 1e-2, "{found} {expected}");
            }
        }
    }
}
