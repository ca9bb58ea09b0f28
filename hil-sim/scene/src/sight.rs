//! What rays meet first, and what stands before lamps, in single precision: for images in real time.

use multiversion::multiversion;
use nalgebra::Vector3;

use crate::outlook::Outlook;
use crate::packet::{Packet, QUICK_LANES, Singles, any_above, dots, less};
use crate::scene::Solid;
use crate::span::{SolidFrom, Spans};
use crate::trace::NOTHING;

/// The solids about a place, and which of them stand in each direction.
#[derive(Clone, Debug, PartialEq)]
pub struct Sight {
    place: Vector3<f64>,
    outlook: Outlook,
    solids: Vec<SolidFrom>,
}

impl Sight {
    /// Cells of the outlook over which rays that are followed together are spread: of neighbouring pixels seldom more.
    pub const OVERLAP: usize = 2;

    /// Of these of all `solids` that `outlook` shows, about its place.
    pub fn new(solids: &[Solid], outlook: Outlook) -> Self {
        let place = outlook.place();
        Self { place, solids: solids.iter().map(|solid| SolidFrom::new(solid, &place)).collect(), outlook }
    }

    /// The first surfaces on rays of unit length, and how far they are (mm): [`NOTHING`] where there is none or the ray does not count.
    #[inline(always)]
    fn first<const N: usize>(&self, rays: &Packet<f32, N>) -> ([u32; N], [f32; N]) {
        let offsets = less(&rays.origin, &self.place);
        let (mut surfaces, mut ranges) = ([NOTHING; N], [f32::NEG_INFINITY; N]);
        for (range, counts) in ranges.iter_mut().zip(&rays.counts) {
            // Nothing is nearer than what a ray that does not count meets.
            *range = if *counts { f32::INFINITY } else { f32::NEG_INFINITY };
        }
        let mut candidates = self.outlook.candidates(&rays.counts, &self.outlook.cells(&rays.direction));
        while let Some(candidate) = candidates.next() {
            if !any_above(&ranges, candidate.from_mm) {
                break;
            }
            let Spans { enter, leave } = self.solids[candidate.shape as usize].spans(&offsets, &rays.direction);
            for i in 0..N {
                let range = if enter[i] > 0.0 { enter[i] } else { leave[i] };
                let nearer = (enter[i] <= leave[i]) & (range > 0.0) & (range < ranges[i]);
                surfaces[i] = if nearer { candidate.shape } else { surfaces[i] };
                ranges[i] = if nearer { range } else { ranges[i] };
            }
        }
        (surfaces, ranges)
    }

    /// Those of the points asked for, all of the surface `own`, between which and the place nothing stands.
    #[inline(always)]
    pub fn reached<const N: usize>(&self, points: &Singles<N>, own: u32, asked: &[bool; N]) -> [bool; N] {
        // So near its end, as a share of its length, a ray has met the surface that it is to reach.
        const END: f32 = 1.0 - 2e-5;
        let directions = less(points, &self.place);
        // Of those that are not reached the distance is less than any.
        let mut distances = dots(&directions, &directions);
        for i in 0..N {
            distances[i] = if asked[i] { distances[i].sqrt() } else { f32::NEG_INFINITY };
        }
        let mut candidates = self.outlook.candidates(asked, &self.outlook.cells(&directions));
        while let Some(candidate) = candidates.next() {
            if !any_above(&distances, candidate.from_mm) {
                break;
            }
            // A convex surface that faces the place does not stand before itself.
            if candidate.shape == own {
                continue;
            }
            let Spans { enter, leave } = self.solids[candidate.shape as usize].spans_from_place(&directions);
            for i in 0..N {
                let is_between = (enter[i] <= leave[i]) & (leave[i] > 0.0) & (enter[i] < END);
                distances[i] = if is_between { f32::NEG_INFINITY } else { distances[i] };
            }
        }
        let mut reached = [false; N];
        for i in 0..N {
            reached[i] = distances[i] >= 0.0;
        }
        reached
    }
}

/// [`Sight::first`] of many rays, by the instructions of this machine: the same numbers on all.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
pub fn first_many(sight: &Sight, rays: &Packet<f32, QUICK_LANES>) -> ([u32; QUICK_LANES], [f32; QUICK_LANES]) {
    sight.first(rays)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::Scene;
    use crate::packet::{LANES, alone, singles};
    use crate::trace::meet_many;

    #[test]
    fn single_precision_finds_the_surfaces_that_double_precision_does() {
        let room = Scene::room();
        let place = Vector3::new(-60.0, 20.0, 10.0);
        let (sight, outlook) = (room.sight(place, 1.0), room.outlook(place, 1.0));
        let mut random = Pcg64Mcg::seed_from_u64(8);
        let mut vector = |reach: f64| Vector3::from_fn(|_, _| random.random_range(-reach..reach));
        let mut differ = 0;
        for _ in 0..2000 {
            let towards = vector(1.0).normalize();
            let mut rays =
                Packet::<f64, LANES> { origin: [[0.0; LANES]; 3], direction: [[0.0; LANES]; 3], counts: [true; LANES] };
            for i in 0..LANES {
                let (origin, direction) = (place + vector(0.5), (towards + vector(0.02)).normalize());
                for axis in 0..3 {
                    let [[origin], [direction]] = [alone(&origin)[axis], alone(&direction)[axis]];
                    (rays.origin[axis][i], rays.direction[axis][i]) = (origin, direction);
                }
            }
            let exact = meet_many(&room, &outlook, &rays).surfaces;
            let quick =
                Packet { origin: singles(&rays.origin), direction: singles(&rays.direction), counts: rays.counts };
            let (quick, _) = sight.first(&quick);
            differ += exact.iter().zip(&quick).filter(|(exact, quick)| exact != quick).count();
        }
        // Of 32 000 rays: those within a thousandth of a millimetre of an edge.
        assert!(differ <= 10, "{differ} rays meet other surfaces");
    }
}
