//! Which points go on where there are more than may: those that are spread over the view best, never the easiest ones alone.

use std::collections::BTreeMap;

use super::Track;
use crate::ViewPixel;

/// Smallest side of a cell, in pixels of the view.
const SMALLEST: f64 = 48.0;
/// Points in a cell on average, where they may be everywhere.
const IN_CELL: f64 = 2.0;

/// Cells over which points are spread.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cells {
    side: f64,
}

impl Cells {
    /// Cells for `most` points in a view of this width and height.
    pub(super) fn for_points(most: usize, (width, height): (usize, usize)) -> Self {
        let area = (width * height) as f64;
        Self { side: (IN_CELL * area / most.max(1) as f64).sqrt().max(SMALLEST) }
    }

    fn of(self, at: ViewPixel) -> [i64; 2] {
        [at.y, at.x].map(|place| (place / self.side).floor() as i64)
    }

    /// The places of `count` of the points at `candidates` in that slice: of every cell the first, then of every cell the second, and so on, after
    /// those that are `there` already. In a cell, and among cells that have as many, the earlier candidate is first.
    pub(super) fn choose(
        self,
        candidates: &[ViewPixel],
        there: impl Iterator<Item = ViewPixel>,
        count: usize,
    ) -> Vec<usize> {
        let mut held: BTreeMap<[i64; 2], usize> = BTreeMap::new();
        there.for_each(|at| *held.entry(self.of(at)).or_default() += 1);
        let rank = |(index, at): (usize, &ViewPixel)| {
            let held = held.entry(self.of(*at)).or_default();
            *held += 1;
            (*held, index)
        };
        let mut ranked: Vec<(usize, usize)> = candidates.iter().enumerate().map(rank).collect();
        ranked.sort_unstable();
        ranked.into_iter().take(count).map(|(_, index)| index).collect()
    }

    /// Leaves `most` tracks. In each cell their numbers decide, mixed: neither the oldest nor the newest stay, and from pair to pair the same.
    pub(super) fn thin(self, tracks: &mut Vec<Track>, most: usize) {
        if tracks.len() <= most {
            return;
        }
        tracks.sort_unstable_by_key(|track| mixed(track.number));
        let places: Vec<ViewPixel> = tracks.iter().map(|track| track.at).collect();
        let chosen = self.choose(&places, std::iter::empty(), most);
        *tracks = chosen.into_iter().map(|index| tracks[index]).collect();
        tracks.sort_unstable_by_key(|track| track.number);
    }
}

/// A number without order: D. Knuth, *The Art of Computer Programming* 3, 1998, §6.4, multiplicative hashing.
const fn mixed(number: u64) -> u64 {
    number.wrapping_mul(0x9E37_79B9_7F4A_7C15)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(number: u64, x: f64, y: f64) -> Track {
        Track { number, at: ViewPixel { x, y }, moved: [0.0; 2], missed: 0, departures: None }
    }

    /// One half of the view has nine points for each of the other.
    #[test]
    fn the_tracks_that_stay_are_spread() {
        let crowded = (0..450_u64).map(|i| track(i, (i % 30) as f64 * 16.0, (i / 30) as f64 * 64.0));
        let sparse = (450..500_u64).map(|i| track(i, 500.0 + (i % 5) as f64 * 96.0, (i % 50 / 5) as f64 * 96.0));
        let mut tracks: Vec<Track> = crowded.chain(sparse).collect();
        Cells::for_points(100, (960, 960)).thin(&mut tracks, 100);
        assert_eq!(tracks.len(), 100);
        let in_sparse = tracks.iter().filter(|track| track.at.x >= 500.0).count();
        assert!((30..=50).contains(&in_sparse), "{in_sparse} of 100 are in the half that has a tenth of the points");
        assert!(tracks.windows(2).all(|two| two[0].number < two[1].number), "they stay in order");
        let old = tracks.iter().filter(|track| track.number < 225).count();
        assert!((15..=40).contains(&old), "{old} of those in the crowded half are from its older half");
    }

    #[test]
    fn new_points_fill_empty_cells_first() {
        let at = |x: f64| ViewPixel { x, y: 10.0 };
        let cells = Cells::for_points(1000, (400, 400));
        assert_eq!(cells.choose(&[at(5.0), at(6.0), at(60.0), at(110.0)], [at(100.0)].into_iter(), 2), [0, 2]);
    }
}
