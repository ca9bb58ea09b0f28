//! Both images of a pair, resampled on one grid in the shared axes.

use vergence_vision::{Angle, Frame, KannalaBrandt, Left, Length, MatchSigma, Pixel, Right, StereoPair};

use crate::corners::Keypoint;
use crate::epipolar_band::EpipolarBand;
use crate::grid::Extent;
use crate::matcher::{ImagePair, MatchError};
use crate::shared_field::SharedField;
use crate::view::Buffers;
use crate::{Grid, SharedFrame, View, ViewPixel};

/// Default density of a view in pixels per radian: small images are enlarged to it.
pub(crate) const DENSITY: f64 = 450.0;
/// The field of cameras with parallel axes, in square radians: 150° by 198°.
const WHOLE_FIELD: f64 = 9.05;

/// A turn that moves no pixel of a view by as much as this leaves the axes as they are. Places in the images stay exact, because they follow from the axes that the
/// views have; only rows are off the epipolar curves by it, where the band allows for 20 times as much. Encoders that flicker by a count to each side turn each
/// camera of the bench by up to 0.03 pixels.
const KEPT_PX: f64 = 0.05;

/// How dense views are, in pixels of the view per pixel of the denser fisheye image.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Density {
    /// Of the field of parallel axes.
    pub least: f64,
    /// Where the field is smaller, views have as many pixels, but are not denser than this.
    pub most: f64,
}

impl Density {
    fn over(self, extent: &Extent) -> f64 {
        let area = (extent.a_max - extent.a_min) * (extent.b_max - extent.b_min);
        (self.least * (WHOLE_FIELD / area).sqrt()).clamp(self.least, self.most.max(self.least))
    }
}

/// The two views of a pair on one grid, with the field that both cameras share.
pub(crate) struct SharedViews<'a> {
    pub frame: SharedFrame,
    pub grid: Grid,
    pub left: View<Left>,
    pub right: View<Right>,
    field: SharedField<'a>,
    pair: &'a ImagePair<'a>,
}

impl<'a> SharedViews<'a> {
    /// Resamples both images with `oversampling` pixels of the view per pixel of the denser fisheye image, from 1 to 2.
    /// `None` takes the value that gives 450 pixels per radian.
    ///
    /// # Errors
    /// [`MatchError::NoBaseline`] or [`MatchError::NoSharedField`].
    pub(crate) fn of(pair: &'a ImagePair<'a>, oversampling: Option<f64>) -> Result<Self, MatchError> {
        let density = pair.left_camera.k()[0].max(pair.right_camera.k()[0]);
        let oversampling = oversampling.filter(|o| o.is_finite()).unwrap_or(DENSITY / density).clamp(1.0, 2.0);
        let density = Density { least: oversampling, most: oversampling };
        Self::in_buffers(pair, density, None, &mut Default::default())
    }

    /// The same in memory that is taken from `buffers`, those of the left and of the right camera, and on the grid of an earlier pair, if its pose
    /// was nearly this one. Where the pose turned by less than shows, the axes are those of the pair before too, and so is where the pixels of the views lie.
    pub(crate) fn in_buffers(
        pair: &'a ImagePair<'a>,
        oversampling: Density,
        kept: Option<(Grid, SharedFrame)>,
        [of_left, of_right]: &mut [Buffers; 2],
    ) -> Result<Self, MatchError> {
        let frame = SharedFrame::new(&pair.left_from_right).ok_or(MatchError::NoBaseline)?;
        let density = pair.left_camera.k()[0].max(pair.right_camera.k()[0]);
        let frame = kept.map_or(frame, |(grid, before)| {
            frame.or_nearly(&before, Angle::from_rad(KEPT_PX / grid.pixels_per_radian()))
        });
        let field = SharedField::of(&frame, pair);
        let over = |extent: Extent| Grid::over(&extent, density * oversampling.over(&extent));
        let grid = kept.map(|(grid, _)| grid).or_else(|| field.extent().and_then(over));
        let grid = grid.ok_or(MatchError::NoSharedField)?;
        let [left, right] = [(pair.left, pair.masks[0]), (pair.right, pair.masks[1])];
        let (left, right) = rayon::join(
            || View::in_buffers(left, pair.left_camera, frame.shared_from_left(), grid, of_left),
            || View::in_buffers(right, pair.right_camera, frame.shared_from_right(), grid, of_right),
        );
        Ok(Self { frame, grid, left, right, field, pair })
    }

    /// Gives the memory back.
    pub(crate) fn recycle(self, [of_left, of_right]: &mut [Buffers; 2]) {
        self.left.recycle(of_left);
        self.right.recycle(of_right);
    }

    /// The epipolar band for the uncertainty of the pair's pose.
    pub(crate) fn band(&self) -> EpipolarBand {
        self.band_for(self.pair.pose_sigma)
    }

    /// The epipolar band for a standard deviation `pose_sigma` of the pose.
    pub(crate) fn band_for(&self, pose_sigma: Angle) -> EpipolarBand {
        let shift = |lens: &KannalaBrandt| lens.pupil().shift(lens.measured_field()).mm().abs();
        let [left, right] = [self.pair.left_camera, self.pair.right_camera].map(shift);
        EpipolarBand::new(self.grid, self.frame.baseline(), self.pair.nearest, pose_sigma)
            .with_pupils(Length::from_mm(left.max(right)))
    }

    /// The uncertainty of the pair's pose.
    pub(crate) const fn pose_sigma(&self) -> Angle {
        self.pair.pose_sigma
    }

    /// Pixels of a view per pixel at the centre of the denser image.
    pub(crate) fn oversampling(&self) -> f64 {
        self.grid.pixels_per_radian() / self.pair.left_camera.k()[0].max(self.pair.right_camera.k()[0])
    }

    /// The standard deviations in pixels of the images of a match whose parallax has the standard deviation `turns[0]`, and whose
    /// angle between the epipolar planes `turns[1]`. `None` beyond a lens's field, and for a bearing along the baseline.
    pub(crate) fn pixel_sigma(&self, turns: [Angle; 2], [left, right]: [Pixel; 2]) -> Option<MatchSigma> {
        let ImagePair { left_camera, right_camera, left_from_right, .. } = *self.pair;
        let stereo = StereoPair { left: left_camera, right: right_camera, left_from_right };
        let (left, right) = (left_camera.unproject(left).ok()?, right_camera.unproject(right).ok()?);
        MatchSigma::of_turns(turns, &left, &right, &stereo)
    }

    /// Whether a keypoint of the left view is compared: the left camera sees its surroundings, and the right camera may
    /// see it.
    pub(crate) fn shared_from_left(&self, keypoint: &Keypoint) -> bool {
        surrounded(&self.left, keypoint)
            && self.grid.bearing(keypoint.at).is_some_and(|b| self.field.seen_from_left(&b))
    }

    /// Whether a keypoint of the right view is compared: the right camera sees its surroundings, and the left camera
    /// may see it.
    pub(crate) fn shared_from_right(&self, keypoint: &Keypoint) -> bool {
        surrounded(&self.right, keypoint)
            && self.grid.bearing(keypoint.at).is_some_and(|b| self.field.seen_from_right(&b))
    }
}

/// Whether the camera sees the surroundings of a keypoint. The rim of the field would look like an edge of the scene.
fn surrounded<F: Frame>(view: &View<F>, keypoint: &Keypoint) -> bool {
    const MARGIN: f64 = 6.0; // of the level
    let reach = MARGIN * (1_usize << keypoint.level) as f64;
    let ViewPixel { x, y } = keypoint.at;
    [-reach, 0.0, reach]
        .iter()
        .all(|dy| [-reach, 0.0, reach].iter().all(|dx| view.sees(ViewPixel { x: x + dx, y: y + dy })))
}
