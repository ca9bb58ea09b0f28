//! What of the bench is in undistorted pictures.

use vergence_targets::TargetView;

use crate::bench::scene_target;
use crate::target_shot::{FoundCorners, in_both};
use crate::undistort::Pinhole;

/// A target in one undistorted picture.
pub struct InPicture {
    /// Where the corners that are in the picture truly are.
    pub truth: TargetView,
    /// What was found of them.
    pub found: Option<FoundCorners>,
}

impl InPicture {
    /// The corners found, where their labels are certain.
    pub fn labelled(&self) -> Option<&FoundCorners> {
        self.found.as_ref().filter(|found| found.labelled)
    }
}

/// What the undistorted pictures of a mode show.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Undistorted {
    /// Corners before the rig.
    pub corners: usize,
    /// Those of them that are in both undistorted pictures.
    pub inside: usize,
    /// Those of them that were found in both.
    pub found: usize,
    /// Sum over the corners inside of how many times larger the left picture is there than in its middle.
    pub stretch: f64,
    /// Sum of the squared errors of u and v in both pictures, in pixels of the undistorted picture, and their number.
    pub squares_px2: (f64, usize),
    /// Targets that the pair was calibrated from, and how many were held up for that.
    pub views: [usize; 2],
}

impl Undistorted {
    /// Adds a target; `left` is the camera of the left picture.
    pub fn count(&mut self, seen: &[Option<InPicture>; 2], left_camera: &Pinhole<'_>) {
        self.corners += (scene_target().columns * scene_target().rows) as usize;
        let [Some(left), Some(right)] = seen else { return };
        for corner in in_both(&left.truth.corners, &right.truth.corners) {
            self.inside += 1;
            self.stretch += left_camera.stretch(corner.pixel);
        }
        let (Some(left), Some(right)) = (left.labelled(), right.labelled()) else { return };
        self.found += in_both(&left.view.corners, &right.view.corners).count();
        for error in left.errors_px.iter().chain(&right.errors_px) {
            self.squares_px2.0 += error * error;
            self.squares_px2.1 += 1;
        }
    }

    /// All of both.
    #[must_use]
    pub fn and(self, other: &Self) -> Self {
        Self {
            corners: self.corners + other.corners,
            inside: self.inside + other.inside,
            found: self.found + other.found,
            stretch: self.stretch + other.stretch,
            squares_px2: (self.squares_px2.0 + other.squares_px2.0, self.squares_px2.1 + other.squares_px2.1),
            views: [self.views[0] + other.views[0], self.views[1] + other.views[1]],
        }
    }

    /// How many times larger the picture is at the corners inside than in its middle, on average.
    #[must_use]
    pub fn mean_stretch(&self) -> f64 {
        self.stretch / self.inside.max(1) as f64
    }

    /// Root mean square error of a corner's u or v, in pixels of the undistorted picture.
    #[must_use]
    pub fn off_px(&self) -> f64 {
        (self.squares_px2.0 / self.squares_px2.1.max(1) as f64).sqrt()
    }
}
