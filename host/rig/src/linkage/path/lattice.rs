//! The search for a way round obstacles: A* over a lattice of driven corners (P. Hart, N. Nilsson and B. Raphael, 1968).

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use super::Space;
use super::leg::{Driven, longest};

/// Distance of the lattice's places in radians: 7.5 degrees.
const STEP: f64 = 0.1309;
/// Micro-radians: the heap compares whole numbers.
const TO_WHOLE: f64 = 1e6;

/// A place of the lattice: steps from its origin.
type Place = [i16; 3];

/// The 26 directions to the neighbours of a place.
pub(super) fn directions() -> impl Iterator<Item = Driven> {
    neighbours().map(|way| way.map(f64::from))
}

fn neighbours() -> impl Iterator<Item = Place> {
    (0..27_i16).filter(|&number| number != 13).map(|number| [number / 9 - 1, number / 3 % 3 - 1, number % 3 - 1])
}

impl Space<'_> {
    /// A path over the lattice from the first exit to the first entrance that has one.
    pub(super) fn by_lattice(&self, ends: [Driven; 2], leave: &[Driven], enter: &[Driven]) -> Option<Vec<Driven>> {
        let (&out, &into) = (leave.first()?, enter.first()?);
        let mut places = vec![ends[0]];
        places.extend(self.walk(out, into)?);
        places.push(ends[1]);
        places.dedup();
        Some(places)
    }

    /// Places of the lattice from `out` to `into`, with both.
    fn walk(&self, out: Driven, into: Driven) -> Option<Vec<Driven>> {
        let at =
            |place: Place| -> Driven { std::array::from_fn(|corner| out[corner] + STEP * f64::from(place[corner])) };
        let whole = |way: f64| (way * TO_WHOLE) as u64;
        let origin: Place = [0; 3];
        let mut open = BinaryHeap::from([Reverse((whole(longest(out, into)), 0_u64, origin))]);
        let mut reached: HashMap<Place, (u64, Place)> = HashMap::from([(origin, (0, origin))]);
        let mut free: HashMap<Place, bool> = HashMap::new();
        while let Some(Reverse((_, way, place))) = open.pop() {
            if reached.get(&place).is_some_and(|&(best, _)| best < way) {
                continue;
            }
            let here = at(place);
            if longest(here, into) <= 1.5 * STEP && self.leg(here, into).is_some() {
                let mut places = backwards(&reached, place).into_iter().map(at).collect::<Vec<_>>();
                places.push(into);
                return Some(places);
            }
            for by in neighbours() {
                let next: Place = std::array::from_fn(|corner| place[corner] + by[corner]);
                let there = at(next);
                if !*free.entry(next).or_insert_with(|| self.is_free(there)) {
                    continue;
                }
                let total = way + whole(longest(here, there));
                let is_better = reached.get(&next).is_none_or(|&(best, _)| total < best);
                if is_better && self.leg(here, there).is_some() {
                    reached.insert(next, (total, place));
                    open.push(Reverse((total + whole(longest(there, into)), total, next)));
                }
            }
        }
        None
    }
}

/// The places that led to `last`, the first one first.
fn backwards(reached: &HashMap<Place, (u64, Place)>, last: Place) -> Vec<Place> {
    let mut places = vec![last];
    let mut here = last;
    while let Some(&(_, before)) = reached.get(&here).filter(|&&(_, before)| before != here) {
        places.push(before);
        here = before;
    }
    places.reverse();
    places
}
