//! The dense result: a range, or the reason for none, for every pixel of the left image.

use std::collections::BTreeMap;
use std::fmt;

use vergence_vision::{ImageSize, Length};

/// Ranges from the left optical centre for all pixels of the left image, with the reason where there is none.
#[derive(Clone, Debug, PartialEq)]
pub struct DenseDepth {
    size: ImageSize,
    samples: Vec<DenseSample>,
}

/// The result of one pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DenseSample {
    /// The range of this pixel was measured.
    Measured(DenseRange),
    /// It is farther than can be measured: its parallax cannot be distinguished from zero.
    Far,
    /// The range of this pixel is unknown, for the reason given.
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
    /// It lies outside the left lens's valid cone, or so near its rim or the sensor's border that no window fits.
    OutsideField,
    /// The right camera does not see its direction, or the direction is within 15° of the baseline, where parallax says
    /// little.
    NotShared,
    /// The views disagree: only one camera sees the surface, or it resembles another along its epipolar curve.
    Inconsistent,
    /// The texture is too weak.
    Untextured,
    /// No neighbours on the same surface: a patch too small for a surface.
    Isolated,
    /// Beside an edge: it may belong to a surface that is too far to be measured.
    Edge,
}

/// Numbers of pixels by their result.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DenseCounts {
    /// Number of pixels with a measured range.
    pub measured: usize,
    /// Number of pixels farther than can be measured.
    pub far: usize,
    /// Number of pixels without a range for each reason.
    pub gaps: BTreeMap<Gap, usize>,
}

impl DenseDepth {
    /// Makes the result of `size.width * size.height` samples by rows.
    pub(super) const fn new(size: ImageSize, samples: Vec<DenseSample>) -> Self {
        Self { size, samples }
    }

    /// The left image's size.
    #[must_use]
    pub const fn size(&self) -> ImageSize {
        self.size
    }

    /// The `width * height` samples by rows.
    #[must_use]
    pub fn samples(&self) -> &[DenseSample] {
        &self.samples
    }

    /// The same, with every range beyond `farthest` as far.
    #[must_use]
    pub fn up_to(mut self, farthest: Length) -> Self {
        for sample in &mut self.samples {
            if matches!(sample, DenseSample::Measured(range) if range.range() > farthest) {
                *sample = DenseSample::Far;
            }
        }
        self
    }

    /// Counts the pixels by their result.
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

    /// Standard deviation of the range from noise, contrast, near edges and the pose.
    #[must_use]
    pub fn sigma(&self) -> Length {
        Length::from_mm(f64::from(self.sigma_mm))
    }

    /// Standard deviation of the range with the pose known exactly.
    #[must_use]
    pub fn own_sigma(&self) -> Length {
        Length::from_mm(f64::from(self.own_sigma_mm))
    }

    /// Confidence from 0 to 1: the fraction of the window's contrast that both views have in common.
    #[must_use]
    pub const fn confidence(&self) -> f32 {
        self.confidence
    }
}

impl fmt::Display for Gap {
    /// Prints the stable name in snake case, for reports and files.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::OutsideField => "outside_field",
            Self::NotShared => "not_shared",
            Self::Inconsistent => "inconsistent",
            Self::Untextured => "untextured",
            Self::Isolated => "isolated",
            Self::Edge => "edge",
        })
    }
}
