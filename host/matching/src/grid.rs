//! The pixel grid common to both views of a pair.
//!
//! It is equirectangular with its poles on the baseline: d = (sin a, cos a sin b, cos a cos b), column ∝ a, row ∝ b. A
//! plane through both cameras has one b, so a scene point has the same row in both views at any range.

use nalgebra::Vector3;
use vergence_vision::UnitRay;

use crate::Shared;

/// A position in pixels of a [`crate::View`]. (0, 0) is the centre of the top-left pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ViewPixel {
    /// Column, growing with a.
    pub x: f64,
    /// Row, growing with b.
    pub y: f64,
}

/// The pixel grid common to both views of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    a_min: f64,
    b_min: f64,
    pixels_per_radian: f64,
    width: usize,
    height: usize,
}

impl Grid {
    /// Makes the grid over a field with `wanted` pixels per radian, or fewer where a side would exceed 4096 pixels.
    pub(crate) fn over(extent: &Extent, wanted: f64) -> Option<Self> {
        const LARGEST: f64 = 4096.0;
        let (wide, tall) = (extent.a_max - extent.a_min, extent.b_max - extent.b_min);
        let pixels_per_radian = if wanted > 0.0 { wanted.min((LARGEST - 1.0) / wide.max(tall)) } else { return None };
        let count = |angle: f64| (angle * pixels_per_radian) as usize + 1;
        Some(Self {
            a_min: extent.a_min,
            b_min: extent.b_min,
            pixels_per_radian,
            width: count(wide),
            height: count(tall),
        })
    }

    /// The bearing of a position, which may lie beyond the grid.
    #[must_use]
    pub fn bearing(&self, at: ViewPixel) -> Option<UnitRay<Shared>> {
        UnitRay::new(direction(self.a(at.x), self.b(at.y)))
    }

    /// The position of a bearing, possibly beyond the grid.
    #[must_use]
    pub fn position(&self, bearing: &UnitRay<Shared>) -> ViewPixel {
        let d = bearing.vector();
        self.position_of(d.x.atan2(d.y.hypot(d.z)), d.y.atan2(d.z))
    }

    /// The position of the angles a and b in radians, possibly beyond the grid.
    pub(crate) fn position_of(&self, a: f64, b: f64) -> ViewPixel {
        ViewPixel { x: (a - self.a_min) * self.pixels_per_radian, y: (b - self.b_min) * self.pixels_per_radian }
    }

    /// The index, by rows, of the pixel nearest to a position; `None` beyond the grid.
    pub(crate) fn index_nearest(&self, at: ViewPixel) -> Option<usize> {
        let nearest = |at: f64, count: usize| {
            let whole = at as u32;
            let nearest = whole as usize + usize::from(at - f64::from(whole) >= 0.5);
            (at > -0.5 && nearest < count).then_some(nearest)
        };
        Some(nearest(at.y, self.height)? * self.width + nearest(at.x, self.width)?)
    }

    /// Number of columns and rows.
    #[must_use]
    pub const fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// Density in pixels per radian, of a along rows and of b along columns.
    #[must_use]
    pub const fn pixels_per_radian(&self) -> f64 {
        self.pixels_per_radian
    }

    /// The angle a of a column, in radians.
    pub(crate) fn a(&self, x: f64) -> f64 {
        self.a_min + x / self.pixels_per_radian
    }

    /// The angle b of a row, in radians.
    pub(crate) fn b(&self, y: f64) -> f64 {
        self.b_min + y / self.pixels_per_radian
    }
}

/// The bounds of a field in the angles a and b, in radians.
pub(crate) struct Extent {
    pub a_min: f64,
    pub a_max: f64,
    pub b_min: f64,
    pub b_max: f64,
}

/// The direction d = (sin a, cos a sin b, cos a cos b), for angles in radians.
pub(crate) fn direction(a: f64, b: f64) -> Vector3<f64> {
    direction_of(a.sin_cos(), b.sin_cos())
}

/// The direction from the sines and cosines of both angles.
pub(crate) fn direction_of((sin_a, cos_a): (f64, f64), (sin_b, cos_b): (f64, f64)) -> Vector3<f64> {
    Vector3::new(sin_a, cos_a * sin_b, cos_a * cos_b)
}
