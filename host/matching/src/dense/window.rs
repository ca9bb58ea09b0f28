//! Windows around sixteen neighbouring pixels of a row at a time, so that loops become vector instructions, in bands of rows, so that what is
//! made on the way stays in the cache.

/// Number of pixels processed together.
pub(super) const LANES: usize = 16;
/// Number of rows of a band.
pub(super) const BAND: usize = 32;

/// One value for each of these pixels.
pub(super) type Lanes = [f32; LANES];

/// The values outside the view: unknown.
const OUTSIDE: Lanes = [f32::NAN; LANES];

/// Values of a band of rows, padded with NaN, so that windows and lanes never leave them.
pub(super) struct Padded {
    values: Vec<f32>,
    width: usize,
    stride: usize,
    reach: usize,
}

impl Padded {
    /// Makes room for bands of rows of `width` values, for windows that extend `reach` pixels in each direction.
    pub(super) fn new(width: usize, reach: usize) -> Self {
        let stride = width.next_multiple_of(LANES) + 2 * reach;
        Self { values: vec![f32::NAN; stride * (BAND + 2 * reach)], width, stride, reach }
    }

    /// The rows that windows around those from `top` on reach, in a view of `height` rows: the row here and the row of the view.
    pub(super) fn rows(&self, top: usize, height: usize) -> impl Iterator<Item = (usize, Option<usize>)> + use<> {
        let reach = self.reach;
        (0..BAND + 2 * reach).map(move |row| (row, (top + row).checked_sub(reach).filter(|y| *y < height)))
    }

    /// A row, as [`Self::rows`] counts them.
    pub(super) fn row_mut(&mut self, row: usize) -> &mut [f32] {
        &mut self.values[row * self.stride + self.reach..][..self.width]
    }

    /// Takes what windows around the rows from `top` on reach.
    pub(super) fn fill(&mut self, values: &[f32], top: usize) {
        let width = self.width;
        for (row, y) in self.rows(top, values.len() / width) {
            match y {
                Some(y) => self.row_mut(row).copy_from_slice(&values[y * width..][..width]),
                None => self.row_mut(row).fill(f32::NAN),
            }
        }
    }

    /// The values from column `x` of row `y` of the band on, displaced by `offset` columns and rows.
    #[inline(always)]
    pub(super) fn lanes(&self, x: usize, y: usize, [i, j]: [isize; 2]) -> &Lanes {
        let row = (y + self.reach).wrapping_add_signed(j);
        let column = (x + self.reach).wrapping_add_signed(i);
        self.values[row * self.stride + column..].first_chunk().unwrap_or(&OUTSIDE)
    }
}

/// a b + c, rounded once where the processor does that in one step.
#[inline(always)]
pub(super) fn multiply_add<const FUSED: bool>(a: f32, b: f32, c: f32) -> f32 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}
