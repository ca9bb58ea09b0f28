//! What is known of the pixels of the left image.

use std::collections::BTreeMap;
use std::fmt;

use vergence_vision::{ImageSize, Length};

/// For every pixel of the left image its distance from the left optical centre, or why there is none.
#[derive(Clone, Debug, PartialEq)]
pub struct DenseDepth {
    size: ImageSize,
    samples: Vec<DenseSample>,
}

/// What is known of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DenseSample {
    /// It has a range.
    Measured(DenseRange),
    /// Its parallax is not distinguishable from none: it is farther than can be measured.
    Far,
    /// Nothing is known.
    Gap(Gap),
}

/// The range of a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DenseRange {
    pub(super) range_mm: f32,
    pub(super) sigma_mm: f32,
    pub(super) own_sigma_mm: f32,
    pub(super) confidence: f32,
}

/// Why a pixel has no range.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Gap {
    /// Outside the left lens's valid cone, or so near its rim or the sensor's border that no window fits.
    OutsideField,
    /// The right camera does not see there, or the direction is within 15° of the baseline, where parallax says little.
    NotShared,
    /// The views disagree: only one eye sees it, or it looks like something else along its epipolar curve.
    Inconsistent,
    /// Too little texture to tell.
    Untextured,
}

/// How many pixels are what.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DenseCounts {
    /// With a range.
    pub measured: usize,
    /// Farther than can be measured.
    pub far: usize,
    /// Without, by reason.
    pub gaps: BTreeMap<Gap, usize>,
}

impl DenseDepth {
    /// From `size.width * size.height` samples by rows.
    pub(super) const fn new(size: ImageSize, samples: Vec<DenseSample>) -> Self {
        Self { size, samples }
    }

    /// The left image's size.
    #[must_use]
    pub const fn size(&self) -> ImageSize {
        self.size
    }

    /// By rows, `width * height` of them.
    #[must_use]
    pub fn samples(&self) -> &[DenseSample] {
        &self.samples
    }

    /// How many pixels are what.
    #[must_use]
    pub fn counts(&self) -> DenseCounts {
        let mut counts = DenseCounts::default();
        for sample in &self.samples {
            match sample {
                DenseSample::Measured(_) => counts.measured += 1,
                DenseSample::Far => counts.far += 1,
                DenseSample::Gap(gap) => *counts.gaps.entry(*gap).or_default() += 1,
            }
        }
        counts
    }
}

impl DenseRange {
    /// The distance from the left optical centre along the pixel's ray.
    #[must_use]
    pub fn range(&self) -> Length {
        Length::from_mm(f64::from(self.range_mm))
    }

    /// Standard deviation of the range from all that is uncertain: noise, contrast, near edges, and the pose.
    #[must_use]
    pub fn sigma(&self) -> Length {
        Length::from_mm(f64::from(self.sigma_mm))
    }

    /// The same with the pose known exactly.
    #[must_use]
    pub fn own_sigma(&self) -> Length {
        Length::from_mm(f64::from(self.own_sigma_mm))
    }

    /// The share of the window's contrast that both views have in common, 0 to 1.
    #[must_use]
    pub const fn confidence(&self) -> f32 {
        self.confidence
    }
}

impl fmt::Display for Gap {
    /// A stable name in snake case, for reports and files.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::OutsideField => "outside_field",
            Self::NotShared => "not_shared",
            Self::Inconsistent => "inconsistent",
            Self::Untextured => "untextured",
        })
    }
}
