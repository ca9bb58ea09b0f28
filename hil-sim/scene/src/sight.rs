//! What rays meet first, and what stands before lamps, in single precision: for images in real time.

use multiversion::multiversion;
use nalgebra::Vector3;

use crate::outlook::Outlook;
use crate::packet::{LANES, Singles, Triples, largest, singles};
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
    pub const OVERLAP: usize = 1;

    /// Of these of all `solids` that `outlook` shows, about its place.
    pub fn new(solids: &[Solid], outlook: Outlook) -> Self {
        let place = outlook.place();
        Self { place, solids: solids.iter().map(|solid| SolidFrom::new(solid, &place)).collect(), outlook }
    }

    /// `points` in the world less the place.
    #[inline(always)]
    fn offsets<const N: usize>(&self, points: &Triples<N>) -> Singles<N> {
        let mut offsets = [[0.0; N]; 3];
        for axis in 0..3 {
            for i in 0..N {
                offsets[axis][i] = (points[axis][i] - self.place[axis]) as f32;
            }
        }
        offsets
    }

    /// The first surfaces on rays of unit length, and [`NOTHING`] where there is none or the ray does not count.
    #[inline(always)]
    fn first<const N: usize>(&self, origins: &Triples<N>, directions: &Triples<N>, counts: &[bool; N]) -> [u32; N] {
        let (offsets, singles) = (self.offsets(origins), singles(directions));
        let (mut surfaces, mut ranges) = ([NOTHING; N], [f32::INFINITY; N]);
        let cells = self.outlook.cells(&singles);
        let mut candidates = self.outlook.candidates(counts, &cells);
        while let Some(candidate) = candidates.next() {
            if candidate.from_mm > largest(&ranges, counts, f32::NEG_INFINITY) {
                break;
            }
            let Spans { enter, leave } = self.solids[candidate.shape as usize].spans(&offsets, &singles);
            for i in 0..N {
                let range = if enter[i] > 0.0 { enter[i] } else { leave[i] };
                let nearer = (enter[i] <= leave[i]) & (range > 0.0) & (range < ranges[i]);
                surfaces[i] = if nearer { candidate.shape } else { surfaces[i] };
                ranges[i] = if nearer { range } else { ranges[i] };
            }
        }
        surfaces
    }

    /// Those of the points asked for, all of the surface `own`, between which and the place nothing stands.
    #[inline(always)]
    pub fn reached<const N: usize>(&self, points: &Triples<N>, own: u32, asked: &[bool; N]) -> [bool; N] {
        // So near its end, as a share of its length, a ray has met the surface that it is to reach.
        const END: f32 = 1.0 - 2e-5;
        let directions = self.offsets(points);
        let mut distances = [0.0; N];
        for i in 0..N {
            let [x, y, z] = [directions[0][i], directions[1][i], directions[2][i]];
            distances[i] = (x * x + y * y + z * z).sqrt();
        }
        let mut reached = *asked;
        let mut candidates = self.outlook.candidates(asked, &self.outlook.cells(&directions));
        while let Some(candidate) = candidates.next() {
            if candidate.from_mm > largest(&distances, &reached, f32::NEG_INFINITY) {
                break;
            }
            // A convex surface that faces the place does not stand before itself.
            if candidate.shape == own {
                continue;
            }
            let Spans { enter, leave } = self.solids[candidate.shape as usize].spans_from_place(&directions);
            for i in 0..N {
                let is_between = (enter[i] <= leave[i]) & (leave[i] > 0.0) & (enter[i] < END);
                reached[i] &= !is_between;
            }
        }
        reached
    }
}

/// [`Sight::first`] of many rays, by the instructions of this machine: the same numbers on all.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
pub fn first_many(
    sight: &Sight,
    origins: &Triples<LANES>,
    directions: &Triples<LANES>,
    counts: &[bool; LANES],
) -> [u32; LANES] {
    sight.first(origins, directions, counts)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::Scene;
    use crate::packet::{Packet, alone};
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
                Packet::<LANES> { origin: [[0.0; LANES]; 3], direction: [[0.0; LANES]; 3], counts: [true; LANES] };
            for i in 0..LANES {
                let (origin, direction) = (place + vector(0.5), (towards + vector(0.02)).normalize());
                for axis in 0..3 {
                    let [[origin], [direction]] = [alone(&origin)[axis], alone(&direction)[axis]];
                    (rays.origin[axis][i], rays.direction[axis][i]) = (origin, direction);
                }
            }
            let exact = meet_many(&room, &outlook, &rays).surfaces;
            let quick = first_many(&sight, &rays.origin, &rays.direction, &rays.counts);
            differ += exact.iter().zip(&quick).filter(|(exact, quick)| exact != quick).count();
        }
        // Of 32 000 rays: those within a thousandth of a millimetre of an edge.
        assert!(differ <= 10, "{differ} rays meet other surfaces");
    }
}
