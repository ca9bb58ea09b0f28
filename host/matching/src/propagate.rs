//! Partners where the matches around say they are.
//!
//! A keypoint of the left view whose partner was not found among the keypoints of the right one is mostly there all the same:
//! two views of one surface share less than half of their best keypoints. Its neighbours that have partners say about where,
//! and registration finds the place (M. Lhuillier and L. Quan, "Match propagation for image-based modeling and rendering",
//! PAMI 24(8), 2002). What is found passes the tests that every registered match passes.

use rayon::prelude::*;

use crate::ViewPixel;
use crate::corners::Keypoint;
use crate::epipolar_band::EpipolarBand;
use crate::guided::LEVELS;
use crate::links::{Compared, Link, Links, Rows, registered};
use crate::matcher::Drop;

/// How often what was found serves as a neighbour of what was not.
const ROUNDS: usize = 3;
/// How many neighbours are asked.
const NEIGHBOURS: usize = 4;
/// Neighbours whose displacements differ by less say the same, in pixels of the view.
const SAME_GUESS: f64 = 2.0;

/// A match that says to its neighbours where their partners are.
struct Known {
    at: ViewPixel,
    /// From the left to the right view.
    moved: [f64; 2],
    /// Whether nobody has asked it yet.
    fresh: bool,
}

/// Seeks partners for the keypoints that have none, from the links there are, of which nearly all must be right.
pub(crate) fn propagate(links: &mut Links, compared: &Compared<'_>, rows: &Rows<'_>, band: &EpipolarBand) {
    let mut known = Vec::new();
    learn(&mut known, links, compared.keypoints);
    for _ in 0..ROUNDS {
        let seek = |(link, keypoint): (&Result<Link, Drop>, &Keypoint)| match link {
            Ok(_) => Err(Drop::Duplicate),
            Err(_) => partner(keypoint.at, &known, compared, band),
        };
        let mut found: Links = links.par_iter().zip(compared.keypoints).map(seek).collect();
        rows.drop_repeated(&mut found, compared.keypoints, band);
        known.iter_mut().for_each(|known| known.fresh = false);
        learn(&mut known, &found, compared.keypoints);
        for (link, found) in links.iter_mut().zip(found) {
            *link = link.or_else(|reason| found.map_err(|_| reason));
        }
    }
}

fn learn(known: &mut Vec<Known>, links: &Links, keypoints: &[Keypoint]) {
    let told = |(link, keypoint): (&Result<Link, Drop>, &Keypoint)| {
        let (at, right) = (keypoint.at, link.as_ref().ok()?.right);
        Some(Known { at, moved: [right.x - at.x, right.y - at.y], fresh: true })
    };
    known.extend(links.iter().zip(keypoints).filter_map(told));
}

/// The best of the partners that the nearest of `known` lead to, as far as they were not asked before.
fn partner(at: ViewPixel, known: &[Known], compared: &Compared<'_>, band: &EpipolarBand) -> Result<Link, Drop> {
    let tried = guesses(at, known).into_iter().filter_map(|[dx, dy]| {
        registered(compared, at, ViewPixel { x: at.x + dx, y: at.y + dy }, LEVELS - 1, band).ok()
    });
    tried.max_by(|p, q| p.score.total_cmp(&q.score)).ok_or(Drop::NotRefined)
}

/// By how much the nearest of `known` moved, nearest first, each only once.
fn guesses(at: ViewPixel, known: &[Known]) -> Vec<[f64; 2]> {
    let mut guesses: Vec<(bool, [f64; 2])> = Vec::with_capacity(NEIGHBOURS);
    for Known { moved, fresh, .. } in nearest(at, known) {
        if guesses.iter().all(|(_, other)| (other[0] - moved[0]).hypot(other[1] - moved[1]) >= SAME_GUESS) {
            guesses.push((*fresh, *moved));
        }
    }
    guesses.into_iter().filter(|(fresh, _)| *fresh).map(|(_, moved)| moved).collect()
}

/// So many of `known` as are asked, nearest first; of equally near ones the earlier.
fn nearest(at: ViewPixel, known: &[Known]) -> impl Iterator<Item = &Known> {
    let mut near: Vec<(f64, &Known)> = Vec::with_capacity(NEIGHBOURS + 1);
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
    /// Every surface point is so many pixels further left in the right view.
    const DISPARITY: usize = 13;
    /// From this row on the right view shows something else.
    const HIDDEN: usize = 170;

    /// Blurred noise, which is the same nowhere else.
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
    fn one_match_leads_to_the_partners_of_all_that_is_seen_twice_and_to_no_others() {
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
        let compared = Compared { left: &left, right: &right, keypoints: &keypoints };
        let mut links: Links = vec![Err(Drop::NoCandidate); keypoints.len()];
        let first = keypoints[12].at;
        links[12] = Ok(Link { right: ViewPixel { x: first.x - disparity + 1.0, y: first.y }, score: 1.0, sigma: 0.3 });
        propagate(&mut links, &compared, &Rows::of(&compared), &band());

        // As far as the window of the coarsest level reaches.
        let seen_twice = |keypoint: &Keypoint| keypoint.at.y < HIDDEN as f64 - 36.0;
        let (mut found, mut all) = (0, 0);
        for (i, (link, keypoint)) in links.iter().zip(&keypoints).enumerate().filter(|(i, _)| *i != 12) {
            all += usize::from(seen_twice(keypoint));
            let link = match link {
                Ok(link) => link,
                Err(reason) => {
                    assert_eq!(*reason, Drop::NoCandidate, "the first reason stays");
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
