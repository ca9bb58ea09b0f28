//! What if the pose is far off what is said of it?
//!
//! A view turned by a pose wrong by some degrees still looks like its partner, so candidates that were compared without an
//! epipolar band are still mostly right. Where many more of them agree on another pose than on the stated one, the pair is
//! matched again with that pose. Matches are pixels and hold whatever the pose; nobody's pose is corrected, and
//! [`vergence_vision::pose_drift`] tells from the matches how far the stated one is off.

use vergence_vision::{Angle, Left, Right, Transform};

use crate::consensus::{Consensus, Sighting};
use crate::epipolar_band::EpipolarBand;
use crate::matcher::ImagePair;
use crate::shared_views::SharedViews;

/// Standard deviation of a pose that may be anything: a pair is still matched if it is twice that off.
pub(crate) const ANY_POSE: Angle = Angle::from_deg(3.0);
/// So many times as many must agree on another pose, and so many more.
const MORE: (f64, f64) = (1.5, 20.0);
const EPIPOLAR_SIGMAS: f64 = 3.0;

/// The pose that the candidates agree on, where they refute that of `pair`.
pub(crate) fn pose_instead(
    candidates: &[Sighting],
    views: &SharedViews<'_>,
    pair: &ImagePair<'_>,
) -> Option<Transform<Left, Right>> {
    let agreeing = |consensus: &Consensus| {
        let agrees = |sighting: &&Sighting| {
            consensus
                .off_plane(sighting)
                .is_some_and(|(off, sigma)| off <= sighting.sigma * EPIPOLAR_SIGMAS + sigma * EpipolarBand::SIGMAS)
        };
        candidates.iter().filter(agrees).count() as f64
    };
    let stated = Consensus::of(candidates, pair.pose_sigma);
    let any = Consensus::of(candidates, ANY_POSE);
    let refuted = agreeing(&any) > MORE.0 * agreeing(&stated) + MORE.1;
    refuted.then(|| any.pose(&views.frame, &pair.left_from_right))
}
