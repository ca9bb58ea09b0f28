//! Stereo pairs, and matches between their images.

use nalgebra::Vector3;

use crate::{KannalaBrandt, Left, Pixel, Point, Right, Transform, UnitRay};

/// A match: the pixels where both images show the same scene point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PixelPair {
    /// Pixel of the point in the left image.
    pub left: Pixel,
    /// Pixel of the point in the right image.
    pub right: Pixel,
}

/// Two cameras and their relative pose at one exposure.
#[derive(Clone, Copy, Debug)]
pub struct StereoPair<'a> {
    /// The left camera.
    pub left: &'a KannalaBrandt,
    /// The right camera.
    pub right: &'a KannalaBrandt,
    /// The pose of the right camera in the left frame.
    pub left_from_right: Transform<Left, Right>,
}

impl<'a> StereoPair<'a> {
    /// Whether all rays of each lens go through one point.
    #[must_use]
    pub fn is_central(&self) -> bool {
        self.left.is_central() && self.right.is_central()
    }

    /// This pair with the points where two rays start in place of the cameras' origins, and where the left ray starts in the left frame.
    /// `right` is in the right camera's own frame.
    ///
    /// Central lenses leave the pair as it is. In general the right centre moves from t to t + R o_right - o_left.
    #[must_use]
    pub fn at_origins(&self, left: &UnitRay<Left>, right: &UnitRay<Right>) -> (StereoPair<'a>, Point<Left>) {
        let [left, right] = [self.left.origin_of(left).mm(), self.right.origin_of(right).mm()];
        (self.between(left, right), Point::from_mm(left))
    }

    /// The pair between two points, in millimetres, each in its own camera's frame.
    pub(crate) fn between(&self, left: Vector3<f64>, right: Vector3<f64>) -> StereoPair<'a> {
        if self.is_central() {
            return *self;
        }
        let centre = (self.left_from_right * Point::from_mm(right)).mm() - left;
        StereoPair { left_from_right: Transform::new(self.left_from_right.rotation(), centre), ..*self }
    }
}
