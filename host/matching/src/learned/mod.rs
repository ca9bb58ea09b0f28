//! Matching with pre-trained networks of the LightGlue family, on views in the shared axes.
//!
//! The trait [`Network`] hides the runtime: this crate handles tensors, not runtimes or files. Keypoints outside the
//! field that both cameras share are removed before the best ones are taken, so that none of the budget is spent on
//! points that the other camera cannot see. The networks' matches are tested against the pose and thinned as in
//! [`crate::GuidedMatcher`]. Registered matches are known to a fraction of a pixel; the others are kept with the larger
//! uncertainty of the networks' own positions. Finally partners of unmatched keypoints are predicted from the matches
//! around them.

mod contract;
mod manifest;
mod model;
pub(crate) mod network;

use rayon::prelude::*;

use crate::ViewPixel;
use crate::corners::Keypoint;
use crate::guided::{KEYPOINT_TOLERANCE, LEVELS};
use crate::links::{Compared, Link, Links, Rows, agree_on_pose, bearing_pair, in_originals, register, thin};
use crate::match_errors::{UNREGISTERED_SIGMA, state_errors};
use crate::matcher::{ImagePair, Match, MatchError, Matcher, Matches, UnmatchedReason};
use crate::plane::{Plane, Pyramid};
use crate::propagate::propagate;
use crate::shared_views::SharedViews;
use crate::wrong_pose::pose_instead;

pub use manifest::{Coordinates, Extractor, Glue, ImageInput, Manifest, MatchForm, MatchOutput, Networks, Pipeline};
pub use model::{GreyImage, KeypointFilters, KeypointMatches, Model, Position};
pub use network::{Elements, Network, NetworkError, Outlet, Signature, Tensor};

/// A matcher that uses pre-trained networks.
pub struct LearnedMatcher {
    model: Model,
    /// Largest number of keypoints per view.
    pub keypoints: usize,
    /// Pixels of the view per pixel at the centre of the denser fisheye image, from 1 to 2. `None` takes the value that
    /// gives 450 pixels per radian.
    pub oversampling: Option<f64>,
}

impl LearnedMatcher {
    /// Makes a matcher that compares at most 2048 keypoints of each view.
    #[must_use]
    pub const fn new(model: Model) -> Self {
        Self { model, keypoints: 2048, oversampling: None }
    }

    /// Replaces every network by the result of `wrap`, see [`Model::wrapped`].
    #[must_use]
    pub fn wrapped(self, wrap: impl FnMut(Box<dyn Network>) -> Box<dyn Network>) -> Self {
        Self { model: self.model.wrapped(wrap), ..self }
    }

    /// The model with its networks.
    #[must_use]
    pub const fn model(&self) -> &Model {
        &self.model
    }

    /// Finds the matches of the networks, before registration and every other test.
    ///
    /// # Errors
    /// The errors of [`Matcher::find`].
    pub fn candidates(&self, pair: &ImagePair<'_>) -> Result<Vec<Match>, MatchError> {
        pair.check()?;
        let views = SharedViews::of(pair, self.oversampling)?;
        let seen = self.compare(&views)?;
        Ok(in_originals(&seen.links, &views, &seen.keypoints, seen.right_keypoints).pairs)
    }

    fn compare(&self, views: &SharedViews<'_>) -> Result<NetworkMatches, NetworkError> {
        let (width, height) = views.grid.size();
        let (left, right) = (lit(views.left.plane()), lit(views.right.plane()));
        let images = [&left, &right].map(|values| GreyImage { values, width, height });
        let filters: KeypointFilters<'_> =
            [&|at| views.shared_from_left(&keypoint(at)), &|at| views.shared_from_right(&keypoint(at))];
        let found = self.model.compare(images, self.keypoints, filters)?;
        let [left, right] = found.keypoints;
        let mut links: Links = vec![Err(UnmatchedReason::NoCandidate); left.len()];
        for (i, j, score) in found.matches {
            links[i] = Ok(Link::of_keypoints(view_pixel(right[j]), f64::from(score), UNREGISTERED_SIGMA));
        }
        Ok(NetworkMatches { keypoints: left.into_iter().map(keypoint).collect(), right_keypoints: right.len(), links })
    }
}

impl Matcher for LearnedMatcher {
    fn name(&self) -> &str {
        &self.model.manifest().name
    }

    fn find(&self, pair: &ImagePair<'_>) -> Result<Matches, MatchError> {
        pair.check()?;
        let views = SharedViews::of(pair, self.oversampling)?;
        let seen = self.compare(&views)?;
        let linked = seen.keypoints.iter().zip(&seen.links);
        let candidates: Vec<_> =
            linked.filter_map(|(keypoint, link)| bearing_pair(&views.grid, keypoint, link.as_ref().ok()?)).collect();
        let Some(pose) = pose_instead(&candidates, &views, pair) else { return Ok(seen.matched(&views, pair)) };
        let turned = ImagePair { left_from_right: pose, ..*pair };
        let views = SharedViews::of(&turned, self.oversampling)?;
        Ok(self.compare(&views)?.matched(&views, &turned))
    }
}

/// The result of the networks for two views.
struct NetworkMatches {
    keypoints: Vec<Keypoint>,
    right_keypoints: usize,
    links: Links,
}

impl NetworkMatches {
    /// Applies all tests: matches are registered where that succeeds, and stay at the networks' positions elsewhere.
    fn matched(self, views: &SharedViews<'_>, pair: &ImagePair<'_>) -> Matches {
        let Self { keypoints, right_keypoints, mut links } = self;
        let band = views.band();
        for (link, keypoint) in links.iter_mut().zip(&keypoints) {
            let allowed = |link: &Link| band.allows(keypoint.at, link.right, KEYPOINT_TOLERANCE);
            *link = link.and_then(|link| if allowed(&link) { Ok(link) } else { Err(UnmatchedReason::Epipolar) });
        }
        let (left, right) = (Pyramid::new(views.left.plane(), LEVELS), Pyramid::new(views.right.plane(), LEVELS));
        let oversampling = views.oversampling();
        let compared = Compared { left: &left, right: &right, keypoints: &keypoints, oversampling };
        register(&mut links, &compared, &band, true);
        agree_on_pose(&mut links, &keypoints, &views.grid, pair.pose_sigma);
        let rows = Rows::of(&compared);
        rows.drop_repeated(&mut links, &keypoints, &band);
        thin(&mut links, &keypoints);
        propagate(&mut links, &compared, &rows, &band);
        agree_on_pose(&mut links, &keypoints, &views.grid, pair.pose_sigma);
        thin(&mut links, &keypoints);
        state_errors(&mut links, &compared, &band);
        in_originals(&links, views, &keypoints, right_keypoints)
    }
}

/// The brightness of a plane scaled to 0 to 1.
fn lit(plane: &Plane) -> Vec<f32> {
    plane.values().par_iter().map(|value| (value / 255.0).clamp(0.0, 1.0)).collect()
}

fn keypoint(at: Position) -> Keypoint {
    Keypoint { at: view_pixel(at), level: 0 }
}

fn view_pixel([x, y]: Position) -> ViewPixel {
    ViewPixel { x: f64::from(x), y: f64::from(y) }
}
