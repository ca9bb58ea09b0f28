//! Detection of a stated pose that is wrong by several degrees.
//!
//! Views made with a pose wrong by some degrees still look alike, so candidates that were compared in a very wide
//! epipolar band are still mostly right. Where many more of them agree on another pose than on the stated one, the pair
//! is matched again with that pose. Matches are pixels and remain valid for any pose; the stated pose itself is not
//! changed, and `vergence_alignment::pose_drift` computes from the matches how far it is off.

use vergence_vision::{Angle, Left, Right, Transform};

use crate::consensus::{BearingPair, Consensus};
use crate::epipolar_band::EpipolarBand;
use crate::matcher::ImagePair;
use crate::shared_views::SharedViews;

/// Standard deviation assumed for an untrusted pose. A pair is still matched if its pose is off by twice that.
pub(crate) const ANY_POSE: Angle = Angle::from_deg(3.0);
/// Another pose is used if it agrees with more matches than this factor times those of the stated one, plus this
/// number.
const MORE: (f64, f64) = (1.5, 20.0);
const EPIPOLAR_SIGMAS: f64 = 3.0;

/// The pose on which the candidates agree, if they refute the stated pose of `pair`.
pub(crate) fn pose_instead(
    candidates: &[BearingPair],
    views: &SharedViews<'_>,
    pair: &ImagePair<'_>,
) -> Option<Transform<Left, Right>> {
    let agreeing = |consensus: &Consensus| {
        let agrees = |bearing_pair: &&BearingPair| {
            consensus
                .off_plane(bearing_pair)
                .is_some_and(|(off, sigma)| off <= bearing_pair.sigma * EPIPOLAR_SIGMAS + sigma * EpipolarBand::SIGMAS)
        };
        candidates.iter().filter(agrees).count() as f64
    };
    let stated = Consensus::of(candidates, pair.pose_sigma);
    let any = Consensus::of(candidates, ANY_POSE);
    let refuted = agreeing(&any) > MORE.0 * agreeing(&stated) + MORE.1;
    refuted.then(|| any.pose(&views.frame, &pair.left_from_right))
}
