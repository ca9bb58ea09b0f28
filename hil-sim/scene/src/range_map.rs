//! The true range of each pixel.

use vergence_vision::{ImageSize, Length};

/// For each pixel of an image the distance from the optical centre, of a lens without one from where the ray crosses the axis, along the ray through the pixel's centre.
#[derive(Clone, Debug)]
pub struct RangeMap {
    size: ImageSize,
    mm: Vec<f32>,
}

impl RangeMap {
    /// From `size.width * size.height` ranges in mm, row by row.
    pub(crate) const fn new(size: ImageSize, mm: Vec<f32>) -> Self {
        Self { size, mm }
    }

    /// The image's size.
    #[must_use]
    pub const fn size(&self) -> ImageSize {
        self.size
    }

    /// The range at column `x` and row `y`; `None` outside the image or the field, and where nothing is met.
    #[must_use]
    pub fn at(&self, x: u32, y: u32) -> Option<Length> {
        if x >= self.size.width {
            return None;
        }
        let mm = self.mm.get(y as usize * self.size.width as usize + x as usize)?;
        mm.is_finite().then(|| Length::from_mm(f64::from(*mm)))
    }

    /// Ranges in mm, row by row, `width * height` of them; not a number where [`Self::at`] has none.
    #[must_use]
    pub fn as_mm(&self) -> &[f32] {
        &self.mm
    }
}

impl PartialEq for RangeMap {
    /// Equal bit for bit, so that two pixels outside the field are equal.
    fn eq(&self, other: &Self) -> bool {
        self.size == other.size && self.mm.iter().map(|x| x.to_bits()).eq(other.mm.iter().map(|x| x.to_bits()))
    }
}
