//! Propagation of matches: partners of unmatched keypoints, predicted from the matches around them.
//!
//! Two views of one surface share less than half of their best keypoints, so the partner of a left keypoint is often
//! visible in the right view without being a keypoint there. The displacements of matched neighbours predict it, and
//! registration finds the position (M. Lhuillier and L. Quan, "Match propagation for image-based modeling and
//! rendering", PAMI 24(8), 2002). The results pass the tests of every registered match.

use rayon::prelude::*;

use crate::ViewPixel;
use crate::corners::Keypoint;
use crate::epipolar_band::EpipolarBand;
use crate::guided::LEVELS;
use crate::links::{Compared, Link, Links, Rows, registered};
use crate::matcher::UnmatchedReason;
use crate::refine::Scratch;

/// Number of rounds, each of which uses the matches found in the one before.
const ROUNDS: usize = 3;
/// Number of nearest matches that predict a displacement.
const NEIGHBOURS: usize = 4;
/// Displacements that differ by less than this, in pixels of the view, are tried once.
const SAME_GUESS: f64 = 2.0;

/// A match whose displacement predicts those of its neighbours.
struct KnownMatch {
    at: ViewPixel,
    /// Displacement from the left to the right view, in pixels of the view.
    moved: [f64; 2],
    /// Whether it was found in the latest round and not used yet.
    fresh: bool,
}

/// Searches partners for the keypoints without one. Nearly all existing `links` must be right.
pub(crate) fn propagate(links: &mut Links, compared: &Compared<'_>, rows: &Rows<'_>, band: &EpipolarBand) {
    let mut known = Vec::new();
    learn(&mut known, links, compared.keypoints);
    for _ in 0..ROUNDS {
        let seek = |scratch: &mut Box<Scratch>, (link, keypoint): (&Result<Link, _>, &Keypoint)| match link {
            Ok(_) => Err(UnmatchedReason::Duplicate),
            Err(_) => partner(scratch, keypoint.at, &known, compared, band),
        };
        let mut found: Links = links.par_iter().zip(compared.keypoints).map_init(Scratch::new, seek).collect();
        rows.drop_repeated(&mut found, compared.keypoints, band);
        known.iter_mut().for_each(|known| known.fresh = false);
        learn(&mut known, &found, compared.keypoints);
        for (link, found) in links.iter_mut().zip(found) {
            *link = link.or_else(|reason| found.map_err(|_| reason));
        }
    }
}

fn learn(known: &mut Vec<KnownMatch>, links: &Links, keypoints: &[Keypoint]) {
    let known_of = |(link, keypoint): (&Result<Link, UnmatchedReason>, &Keypoint)| {
        let (at, right) = (keypoint.at, link.as_ref().ok()?.right);
        Some(KnownMatch { at, moved: [right.x - at.x, right.y - at.y], fresh: true })
    };
    known.extend(links.iter().zip(keypoints).filter_map(known_of));
}

/// The best partner that the displacements of the nearest fresh matches of `known` lead to.
fn partner(
    scratch: &mut Scratch,
    at: ViewPixel,
    known: &[KnownMatch],
    compared: &Compared<'_>,
    band: &EpipolarBand,
) -> Result<Link, UnmatchedReason> {
    let tried = guesses(at, known).into_iter().filter_map(|[dx, dy]| {
        registered(scratch, compared, (at, LEVELS - 1), ViewPixel { x: at.x + dx, y: at.y + dy }, band).ok()
    });
    tried.max_by(|p, q| p.score.total_cmp(&q.score)).ok_or(UnmatchedReason::NotRefined)
}

/// The displacements of the nearest fresh matches of `known`, nearest first, similar ones only once.
fn guesses(at: ViewPixel, known: &[KnownMatch]) -> Vec<[f64; 2]> {
    let mut guesses: Vec<(bool, [f64; 2])> = Vec::with_capacity(NEIGHBOURS);
    for KnownMatch { moved, fresh, .. } in nearest(at, known) {
        if guesses.iter().all(|(_, other)| (other[0] - moved[0]).hypot(other[1] - moved[1]) >= SAME_GUESS) {
            guesses.push((*fresh, *moved));
        }
    }
    guesses.into_iter().filter(|(fresh, _)| *fresh).map(|(_, moved)| moved).collect()
}

/// The [`NEIGHBOURS`] nearest of `known`, nearest first; of equally near ones the earlier.
fn nearest(at: ViewPixel, known: &[KnownMatch]) -> impl Iterator<Item = &KnownMatch> {
    let mut near: Vec<(f64, &KnownMatch)> = Vec::with_capacity(NEIGHBOURS + 1);
    for known in known {
        let squared = (known.at.x - at.x).powi(2) + (known.at.y - at.y).powi(2);
        if near.get(NEIGHBOURS - 1).is_none_or(|(farthest, _)| squared < *farthest) {
            near.insert(near.partition_point(|(other, _)| *other <= squared), (squared, known));
            near.truncate(NEIGHBOURS);
        }
    }
    near.into_iter().map(|(_, known)| known)
}

#[cfg(test)]
mod tests {
    use vergence_vision::{Angle, ImageSize, KannalaBrandt, Left, Length, Pixel, Right, Transform};

    use super::*;
    use crate::plane::{Plane, Pyramid};
    use crate::{Grid, SharedFrame};

    const SIZE: usize = 256;
    /// Displacement of every surface point to the left in the right view, in pixels.
    const DISPARITY: usize = 13;
    /// First row from which the right view shows another surface.
    const HIDDEN: usize = 170;

    /// Blurred noise without repetitions.
    fn noise(mut state: u32) -> Plane {
        let mut next = || {
            // Numerical Recipes, 2nd ed., §7.1.
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as f32
        };
        Plane::new(SIZE, SIZE, (0..SIZE * SIZE).map(|_| next()).collect()).blurred(2.0)
    }

    fn band() -> EpipolarBand {
        let size = ImageSize { width: 600, height: 600 };
        let centre = Pixel { u: 299.5, v: 299.5 };
        let lens = KannalaBrandt::new([170.0, 0.0, 0.0, 0.0, 0.0], 1.0, centre, Angle::from_deg(98.0), size).unwrap();
        let pose: Transform<Left, Right> =
            Transform::new(nalgebra::UnitQuaternion::identity(), nalgebra::Vector3::new(145.0, 0.0, 0.0));
        let frame = SharedFrame::new(&pose).unwrap();
        let grid = Grid::covering(&frame, &lens, &lens, 1.0).unwrap();
        EpipolarBand::new(grid, frame.baseline(), Length::from_mm(200.0), Angle::from_deg(0.0))
    }

    #[test]
    fn one_match_propagates_over_the_common_surface_only() {
        let (seen, other) = (noise(1), noise(2));
        let moved = other.like(|y, row| {
            let from = if y < HIDDEN { seen.row(y) } else { other.row(y) };
            row[..SIZE - DISPARITY].copy_from_slice(&from[DISPARITY..]);
        });
        let (left, right) = (Pyramid::new(&seen, LEVELS), Pyramid::new(&moved, LEVELS));
        let disparity = DISPARITY as f64;
        let at = |i: usize, j: usize| ViewPixel { x: 56.0 + 20.0 * i as f64, y: 40.0 + 21.0 * j as f64 };
        let keypoints: Vec<Keypoint> =
            (0..9).flat_map(|j| (0..9).map(move |i| Keypoint { at: at(i, j), level: 0 })).collect();
        let compared = Compared { left: &left, right: &right, keypoints: &keypoints, oversampling: 1.0 };
        let mut links: Links = vec![Err(UnmatchedReason::NoCandidate); keypoints.len()];
        let first = keypoints[12].at;
        links[12] = Ok(Link::of_keypoints(ViewPixel { x: first.x - disparity + 1.0, y: first.y }, 1.0, [0.3; 2]));
        propagate(&mut links, &compared, &Rows::of(&compared), &band());

        // Rows whose window of the coarsest level shows the same surface in both views.
        let seen_twice = |keypoint: &Keypoint| keypoint.at.y < HIDDEN as f64 - 36.0;
        let (mut found, mut all) = (0, 0);
        for (i, (link, keypoint)) in links.iter().zip(&keypoints).enumerate().filter(|(i, _)| *i != 12) {
            all += usize::from(seen_twice(keypoint));
            let link = match link {
                Ok(link) => link,
                Err(reason) => {
                    assert_eq!(*reason, UnmatchedReason::NoCandidate, "the first reason stays");
                    continue;
                }
            };
            assert!(seen_twice(keypoint) || keypoint.at.y < HIDDEN as f64 + 8.0, "{i}: {keypoint:?} is not there");
            found += usize::from(seen_twice(keypoint));
            let off = (keypoint.at.x - disparity - link.right.x).hypot(keypoint.at.y - link.right.y);
            assert!(off < 0.1, "{i}: {off} px off");
        }
        assert!(found * 5 >= all * 4, "{found} of {all}");
    }
}
