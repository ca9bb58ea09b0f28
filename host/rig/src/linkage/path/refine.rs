//! Makes a path faster: leaves places out, and moves those that stay.

use super::Space;
use super::leg::Driven;

/// How far places are moved, in radians: 8 degrees down to half a degree.
const MOVES: [f64; 5] = [0.1396, 0.0698, 0.0349, 0.0175, 0.0087];
/// A change must save this share of the time.
const WORTH: f64 = 1e-3;

impl Space<'_> {
    /// The path, with as few places and in as little time as changes of one place reach.
    pub(super) fn refine(&self, places: Vec<Driven>) -> Vec<Driven> {
        let mut places = self.shorten(places);
        for by in MOVES {
            while let Some(better) = self.moved(&places, by) {
                places = self.shorten(better);
            }
        }
        places
    }

    /// Leaves out each place without which the path is allowed and faster.
    fn shorten(&self, mut places: Vec<Driven>) -> Vec<Driven> {
        let mut place = 1;
        while place + 1 < places.len() {
            let with = self.seconds(&places[place - 1..=place + 1]);
            let without = self.seconds(&[places[place - 1], places[place + 1]]);
            if without.is_some_and(|without| with.is_none_or(|with| without <= with)) {
                places.remove(place);
                place = place.saturating_sub(1).max(1);
            } else {
                place += 1;
            }
        }
        places
    }

    /// The path with one corner of one place moved, where that is faster.
    fn moved(&self, places: &[Driven], by: f64) -> Option<Vec<Driven>> {
        for place in 1..places.len().saturating_sub(1) {
            let before = self.seconds(&places[place - 1..=place + 1])?;
            for (corner, sign) in [(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0), (2, 1.0), (2, -1.0)] {
                let mut changed = places.to_vec();
                changed[place][corner] += sign * by;
                let after = self.seconds(&changed[place - 1..=place + 1]);
                if after.is_some_and(|after| after < before * (1.0 - WORTH)) {
                    return Some(changed);
                }
            }
        }
        None
    }
}
