//! The warp of a window between two views with epipolar rows.

/// The warp x' = x + tx + sx x + sy y, y' = y + ty, about the centre of the window, in pixels of a level.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Warp {
    pub tx: f64,
    pub ty: f64,
    pub sx: f64,
    pub sy: f64,
}

impl Warp {
    #[inline]
    pub(super) fn apply(&self, x: f64, y: f64) -> (f64, f64) {
        (x + self.tx + self.sx * x + self.sy * y, y + self.ty)
    }

    /// Returns this warp at a resolution `factor` times as high.
    #[inline]
    pub(super) fn scaled(&self, factor: f64) -> Self {
        Self { tx: self.tx * factor, ty: self.ty * factor, ..*self }
    }

    /// The inverse warp, about the warped centre.
    #[inline]
    pub(super) fn inverse(&self) -> Self {
        let stretch = 1.0 + self.sx;
        Self { tx: -self.tx, ty: -self.ty, sx: 1.0 / stretch - 1.0, sy: -self.sy / stretch }
    }

    /// The composition of this warp with the inverse of `step`.
    #[inline]
    pub(super) fn after_undoing(&self, step: &Self) -> Self {
        let stretch = 1.0 + step.sx;
        // The inverse of the step maps x to (x − tx − sy (y − ty)) / stretch and y to y − ty.
        let (x0, xx, xy) = ((step.sy * step.ty - step.tx) / stretch, 1.0 / stretch, -step.sy / stretch);
        let (sx, sy) = (1.0 + self.sx, self.sy);
        Self { tx: self.tx + sx * x0 - sy * step.ty, ty: self.ty - step.ty, sx: sx * xx - 1.0, sy: sx * xy + sy }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn undoing_a_warp_after_itself_leaves_nothing(
            tx in -3.0..3.0, ty in -3.0..3.0, sx in -0.5..0.5, sy in -0.5..0.5, x in -8.0..8.0, y in -8.0..8.0,
        ) {
            let warp = Warp { tx, ty, sx, sy };
            let (u, v) = warp.after_undoing(&warp).apply(x, y);
            prop_assert!((u - x).abs() < 1e-9 && (v - y).abs() < 1e-9);
        }
    }
}
