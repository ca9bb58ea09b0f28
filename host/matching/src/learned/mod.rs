//! Matching with pre-trained networks of the LightGlue family, on views turned into the shared direction.
//!
//! The networks are behind [`Network`]: this crate knows tensors, not runtimes or files. Keypoints outside the field
//! that both cameras share are left out before the best are taken, so that none of the budget is spent on what the
//! other camera cannot see. What the networks match is then registered, checked against the pose and thinned exactly
//! as [`crate::GuidedMatcher`] does it.

mod contract;
mod manifest;
mod model;
mod network;

use vergence_vision::{Left, Right};

use crate::corners::Keypoint;
use crate::epipolar_band::EpipolarBand;
use crate::guided::{
    DENSITY, Features, KEYPOINT_TOLERANCE, LEVELS, Link, Links, agree_on_pose, drop_repeated, in_originals, keep,
    register, surrounded,
};
use crate::matcher::{Drop, ImagePair, MatchError, Matcher, Matches};
use crate::neighbours;
use crate::plane::{Plane, Pyramid};
use crate::shared_field::SharedField;
use crate::{Grid, SharedFrame, View, ViewPixel};

pub use manifest::{Coordinates, Extractor, Glue, ImageInput, Manifest, MatchForm, MatchOutput, Networks, Pipeline};
pub use model::{Found, Model, Picture, Position, Worth};
pub use network::{Elements, Network, NetworkError, Outlet, Signature, Tensor};

/// Matches what pre-trained networks find alike.
pub struct LearnedMatcher {
    model: Model,
    /// Most keypoints per view.
    pub keypoints: usize,
    /// Pixels of the view per pixel at the centre of the denser fisheye image, from 1 to 2. `None` takes what makes
    /// 450 pixels per radian.
    pub oversampling: Option<f64>,
    /// Whether matches are registered to a fraction of a pixel, and those that cannot be are dropped.
    pub registered: bool,
}

impl LearnedMatcher {
    /// A matcher that compares at most 2048 keypoints of each view and registers what matches.
    #[must_use]
    pub const fn new(model: Model) -> Self {
        Self { model, keypoints: 2048, oversampling: None, registered: true }
    }

    /// The networks it asks.
    #[must_use]
    pub const fn model(&self) -> &Model {
        &self.model
    }
}

impl Matcher for LearnedMatcher {
    fn name(&self) -> &str {
        &self.model.manifest().name
    }

    fn find(&self, pair: &ImagePair<'_>) -> Result<Matches, MatchError> {
        pair.check()?;
        let frame = SharedFrame::new(&pair.left_from_right).ok_or(MatchError::NoBaseline)?;
        let density = pair.left_camera.k()[0].max(pair.right_camera.k()[0]);
        let oversampling = self.oversampling.filter(|o| o.is_finite()).unwrap_or(DENSITY / density).clamp(1.0, 2.0);
        let grid = Grid::covering(&frame, pair.left_camera, pair.right_camera, oversampling)
            .ok_or(MatchError::NoSharedField)?;
        let field = SharedField::new(&frame, pair.left_camera, pair.right_camera);
        let left_view: View<Left> = View::new(pair.left, pair.left_camera, frame.shared_from_left(), grid);
        let right_view: View<Right> = View::new(pair.right, pair.right_camera, frame.shared_from_right(), grid);

        let in_left = |at: Position| {
            surrounded(&left_view, &keypoint(at))
                && grid.bearing(view_pixel(at)).is_some_and(|bearing| field.seen_from_left(&bearing))
        };
        let in_right = |at: Position| {
            surrounded(&right_view, &keypoint(at))
                && grid.bearing(view_pixel(at)).is_some_and(|bearing| field.seen_from_right(&bearing))
        };
        let (lit_left, lit_right) = (lit(left_view.plane()), lit(right_view.plane()));
        let (width, height) = grid.size();
        let pictures = [&lit_left, &lit_right].map(|values| Picture { values, width, height });
        let found = self.model.compare(pictures, self.keypoints, [&in_left, &in_right])?;

        let left = features(left_view.plane(), &found.keypoints[0]);
        let right = features(right_view.plane(), &found.keypoints[1]);
        let band = EpipolarBand::new(grid, frame.baseline(), pair.nearest, pair.pose_sigma);
        let mut links: Links = vec![Err(Drop::NoCandidate); left.keypoints.len()];
        for &(i, j, score) in &found.matches {
            let (from, to) = (left.keypoints[i].at, right.keypoints[j].at);
            let allowed = band.allows(from, to, KEYPOINT_TOLERANCE);
            links[i] = if allowed { Ok(Link { right: to, score: f64::from(score) }) } else { Err(Drop::Epipolar) };
        }
        if self.registered {
            register(&mut links, &left, &right, &band);
            agree_on_pose(&mut links, &left, &grid, pair.pose_sigma);
            drop_repeated(&mut links, &left, &right, &band);
        }
        keep(&mut links, &left, neighbours::supported, Drop::Isolated);
        keep(&mut links, &left, |placed| neighbours::duplicated(placed).iter().map(|d| !d).collect(), Drop::Duplicate);

        let mut matches = Matches {
            left_keypoints: left.keypoints.len(),
            right_keypoints: right.keypoints.len(),
            ..Matches::default()
        };
        for (keypoint, link) in left.keypoints.iter().zip(&links) {
            match link.and_then(|link| in_originals(&left_view, &right_view, keypoint, &link)) {
                Ok(found) => matches.pairs.push(found),
                Err(reason) => *matches.dropped.entry(reason).or_default() += 1,
            }
        }
        Ok(matches)
    }
}

/// Brightness from 0 to 1.
fn lit(plane: &Plane) -> Vec<f32> {
    plane.values().iter().map(|value| (value / 255.0).clamp(0.0, 1.0)).collect()
}

fn features(plane: &Plane, positions: &[Position]) -> Features {
    Features {
        pyramid: Pyramid::new(plane, LEVELS),
        keypoints: positions.iter().map(|&at| keypoint(at)).collect(),
        descriptors: Vec::new(),
    }
}

fn keypoint(at: Position) -> Keypoint {
    Keypoint { at: view_pixel(at), level: 0 }
}

fn view_pixel([x, y]: Position) -> ViewPixel {
    ViewPixel { x: f64::from(x), y: f64::from(y) }
}
