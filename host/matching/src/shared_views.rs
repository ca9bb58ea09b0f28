//! Both images of a pair turned into the direction that the cameras share.

use vergence_vision::{Angle, Frame, Left, Right};

use crate::corners::Keypoint;
use crate::epipolar_band::EpipolarBand;
use crate::matcher::{ImagePair, MatchError};
use crate::shared_field::SharedField;
use crate::{Grid, SharedFrame, View, ViewPixel};

/// Density of a view in pixels per radian that small images are enlarged to and large ones need not exceed.
const DENSITY: f64 = 450.0;

/// The two views of a pair on one grid, and what of them is worth comparing.
pub(crate) struct SharedViews<'a> {
    pub frame: SharedFrame,
    pub grid: Grid,
    pub left: View<Left>,
    pub right: View<Right>,
    field: SharedField<'a>,
    pair: &'a ImagePair<'a>,
}

impl<'a> SharedViews<'a> {
    /// The views of a pair, with `oversampling` pixels for each of the denser fisheye image, from 1 to 2. `None` takes what
    /// makes 450 pixels per radian.
    ///
    /// # Errors
    /// Where the pair has no baseline or shares no field.
    pub(crate) fn of(pair: &'a ImagePair<'a>, oversampling: Option<f64>) -> Result<Self, MatchError> {
        let frame = SharedFrame::new(&pair.left_from_right).ok_or(MatchError::NoBaseline)?;
        let density = pair.left_camera.k()[0].max(pair.right_camera.k()[0]);
        let oversampling = oversampling.filter(|o| o.is_finite()).unwrap_or(DENSITY / density).clamp(1.0, 2.0);
        let field = SharedField::of(&frame, pair);
        let grid = Grid::over(&field, density * oversampling).ok_or(MatchError::NoSharedField)?;
        Ok(Self {
            frame,
            grid,
            left: View::new(pair.left, pair.left_camera, frame.shared_from_left(), grid),
            right: View::new(pair.right, pair.right_camera, frame.shared_from_right(), grid),
            field,
            pair,
        })
    }

    /// Where partners may lie, given how well the pose is known.
    pub(crate) fn band(&self) -> EpipolarBand {
        self.band_for(self.pair.pose_sigma)
    }

    /// The same where the pose is known to `pose_sigma`.
    pub(crate) fn band_for(&self, pose_sigma: Angle) -> EpipolarBand {
        EpipolarBand::new(self.grid, self.frame.baseline(), self.pair.nearest, pose_sigma)
    }

    /// Whether the left camera sees all around a keypoint, and the right camera may see it too.
    pub(crate) fn shared_from_left(&self, keypoint: &Keypoint) -> bool {
        surrounded(&self.left, keypoint)
            && self.grid.bearing(keypoint.at).is_some_and(|b| self.field.seen_from_left(&b))
    }

    /// The same for a keypoint of the right view.
    pub(crate) fn shared_from_right(&self, keypoint: &Keypoint) -> bool {
        surrounded(&self.right, keypoint)
            && self.grid.bearing(keypoint.at).is_some_and(|b| self.field.seen_from_right(&b))
    }
}

/// Whether the camera sees all around a keypoint: its rim would look like an edge of the scene.
fn surrounded<F: Frame>(view: &View<F>, keypoint: &Keypoint) -> bool {
    const MARGIN: f64 = 6.0; // of the level
    let reach = MARGIN * (1_usize << keypoint.level) as f64;
    let ViewPixel { x, y } = keypoint.at;
    [-reach, 0.0, reach]
        .iter()
        .all(|dy| [-reach, 0.0, reach].iter().all(|dx| view.sees(ViewPixel { x: x + dx, y: y + dy })))
}
