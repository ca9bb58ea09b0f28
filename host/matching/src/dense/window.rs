//! Windows around sixteen neighbouring pixels of a row at a time, so that loops become vector instructions.

/// Number of pixels processed together.
pub(super) const LANES: usize = 16;

/// One value for each of these pixels.
pub(super) type Lanes = [f32; LANES];

/// The values outside the view: unknown.
const OUTSIDE: Lanes = [f32::NAN; LANES];

/// Values padded with NaN, so that windows and lanes never leave them.
pub(super) struct Padded {
    values: Vec<f32>,
    stride: usize,
    reach: usize,
}

impl Padded {
    /// Pads `values`, by rows of `width`, for windows that extend `reach` pixels in each direction.
    pub(super) fn new(values: &[f32], width: usize, reach: usize) -> Self {
        let stride = width.next_multiple_of(LANES) + 2 * reach;
        let height = values.len() / width.max(1);
        let mut padded = vec![f32::NAN; stride * (height + 2 * reach)];
        for (row, from) in padded.chunks_exact_mut(stride).skip(reach).zip(values.chunks_exact(width)) {
            row[reach..reach + width].copy_from_slice(from);
        }
        Self { values: padded, stride, reach }
    }

    /// The values from column `x` of row `y` on, displaced by `offset` columns and rows.
    #[inline(always)]
    pub(super) fn lanes(&self, x: usize, y: usize, [i, j]: [isize; 2]) -> &Lanes {
        let row = (y + self.reach).wrapping_add_signed(j);
        let column = (x + self.reach).wrapping_add_signed(i);
        self.values[row * self.stride + column..].first_chunk().unwrap_or(&OUTSIDE)
    }
}

/// Visits a row of `width` pixels in blocks, with the first column and the number of lanes on the row.
#[inline(always)]
pub(super) fn for_blocks(width: usize, mut visit: impl FnMut(usize, usize)) {
    for x in (0..width).step_by(LANES) {
        visit(x, (width - x).min(LANES));
    }
}
