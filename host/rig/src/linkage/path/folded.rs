//! Paths to, from and among folded shapes.
//!
//! Flat shapes have three freedoms, folded ones two: they meet where the trunk is flat with both sides alike. There alone it can begin to
//! fold, so that a path between flat and folded shapes leads through one of these places, its junction. Every junction but an end of
//! the path has the wanted clearance.

use std::f64::consts::PI;

use super::leg::{Driven, longest};
use super::shapes::Shapes;
use super::{Branch, Leg, NoPath, PathEnd, RELAXED, Space, TrunkPath, driven_of};
use crate::linkage::{Clearance, Corners, FoldingTrunk, TrunkShape, WantedClearance};

/// Distance of the junctions that are tried first, in radians of the side joint, and of those around the best: 5 degrees, and less.
const JUNCTIONS: f64 = 0.0873;
const NEARER: [f64; 3] = [0.0436, 0.0218, 0.0109];

impl FoldingTrunk {
    /// The fastest path found from one closed shape to another, as [`super::FlatTrunk::path`]. It takes no longer than to straighten the
    /// folds, to move the flat trunk, and to fold again, where that is allowed.
    ///
    /// # Errors
    /// [`NoPath`] if an end is forbidden, or no way was found.
    pub fn path(&self, start: &TrunkShape, goal: &TrunkShape, wanted: &WantedClearance) -> Result<TrunkPath, NoPath> {
        if start.is_flat() && goal.is_flat() {
            return self.flat.path(&start.corners, &goal.corners, wanted);
        }
        let ends = [self.folded_end(start, PathEnd::Start)?, self.folded_end(goal, PathEnd::Goal)?];
        let branch = match ends.map(|end| Branch::of(&end.corners)) {
            [Some(one), Some(other)] if one != other => return Err(NoPath::OtherBranch),
            [one, other] => one.or(other).unwrap_or(Branch::Outward),
        };
        for share in RELAXED {
            let kept = WantedClearance { loop_reserve: wanted.loop_reserve * share, gap_mm: wanted.gap_mm * share };
            let spaces = Spaces {
                flat: Space { shapes: Shapes::Flat(&self.flat, branch), wanted: kept },
                alike: Space { shapes: Shapes::Alike(self, branch), wanted: kept },
            };
            if let Some(legs) = spaces.fastest(&ends) {
                return Ok(TrunkPath { legs, kept });
            }
        }
        Err(NoPath::NoWay)
    }

    /// Checks an end of a path.
    fn folded_end(&self, shape: &TrunkShape, end: PathEnd) -> Result<TrunkShape, NoPath> {
        if shape.is_flat() {
            return self.flat.end(&self.flat.closed(&shape.corners), end).map(TrunkShape::flat);
        }
        let side_joint = shape.side_joint_alike().ok_or_else(|| {
            let alike = Corners::alike(shape.corners.0[1]).0;
            let by = alike.iter().zip(shape.corners.0).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max);
            NoPath::NotAlike { end, by }
        })?;
        let shape = TrunkShape::alike(side_joint, shape.fold);
        match self.clearance(&shape) {
            Clearance { gap, .. } if gap.mm <= 0.0 => Err(NoPath::Collides { end, gap }),
            room if room.is_forbidden() => Err(NoPath::BeyondRange { end, by: -room.joint_range }),
            _ => Ok(shape),
        }
    }
}

/// Flat shapes, and those with both sides alike.
struct Spaces<'a> {
    flat: Space<'a>,
    alike: Space<'a>,
}

/// Legs, and their time in seconds.
type Timed = (f64, Vec<Leg>);

impl Spaces<'_> {
    /// The legs of the fastest path found.
    fn fastest(&self, ends: &[TrunkShape; 2]) -> Option<Vec<Leg>> {
        let [start, goal] = ends;
        let found = match [start.is_flat(), goal.is_flat()] {
            [false, true] => self.unfolded(start, &goal.corners, false),
            [true, false] => self.unfolded(goal, &start.corners, true),
            _ => faster(self.among_alike([start, goal].map(alike_place)), self.straightened(start, goal)),
        };
        found.map(|(_, legs)| legs)
    }

    fn among_alike(&self, ends: [Driven; 2]) -> Option<Timed> {
        timed(&self.alike, ends)
    }

    fn among_flat(&self, ends: [&Corners; 2]) -> Option<Timed> {
        timed(&self.flat, ends.map(driven_of))
    }

    /// Straightens the folds, moves the flat trunk, and folds again.
    fn straightened(&self, start: &TrunkShape, goal: &TrunkShape) -> Option<Timed> {
        let [from, to] = [start, goal].map(|end| TrunkShape::flat(end.corners));
        if ![&from, &to].iter().all(|junction| self.is_free(junction.corners.0[1])) {
            return None;
        }
        let parts = [
            self.among_alike([start, &from].map(alike_place))?,
            self.among_flat([&from.corners, &to.corners])?,
            self.among_alike([&to, goal].map(alike_place))?,
        ];
        parts.into_iter().reduce(joined)
    }

    /// The fastest path from a folded shape over a junction to a flat one, or the other way where it `folds`.
    fn unfolded(&self, folded: &TrunkShape, flat: &Corners, folds: bool) -> Option<Timed> {
        let over = |side_joint: f64| self.over(folded, flat, side_joint, folds);
        let steps = (PI / JUNCTIONS) as u32;
        let even = (1..=2 * steps).map(|step| f64::from(step) * JUNCTIONS);
        let at_ends = [folded.corners.0[1]].into_iter().chain(TrunkShape::flat(*flat).side_joint_alike());
        let mut junctions: Vec<(f64, f64)> =
            at_ends.chain(even).map(|side_joint| (self.least_seconds(folded, flat, side_joint), side_joint)).collect();
        junctions.sort_by(|one, other| one.0.total_cmp(&other.0));
        let mut best: Option<(Timed, f64)> = None;
        for (least, side_joint) in junctions {
            if best.as_ref().is_some_and(|((seconds, _), _)| *seconds <= least) {
                break;
            }
            best = faster_at(best, over(side_joint), side_joint);
        }
        for by in NEARER {
            let Some((_, middle)) = best else { break };
            for side_joint in [middle - by, middle + by] {
                best = faster_at(best, over(side_joint), side_joint);
            }
        }
        best.map(|(path, _)| path)
    }

    /// The path over the flat shape with both sides alike and this angle of the side joints.
    fn over(&self, folded: &TrunkShape, flat: &Corners, side_joint: f64, folds: bool) -> Option<Timed> {
        let junction = TrunkShape::alike(side_joint, PI);
        let is_end = longest(driven_of(&junction.corners), driven_of(flat)) < super::SAME;
        if !is_end && !self.is_free(side_joint) {
            return None;
        }
        let (mut in_folds, mut in_plane) = ([folded, &junction].map(alike_place), [&junction.corners, flat]);
        if folds {
            in_folds.reverse();
            in_plane.reverse();
        }
        let [alike, plane] = [self.among_alike(in_folds)?, self.among_flat(in_plane)?];
        Some(if folds { joined(plane, alike) } else { joined(alike, plane) })
    }

    /// Less time than which no path over this junction takes: each part straight, at full speed.
    fn least_seconds(&self, folded: &TrunkShape, flat: &Corners, side_joint: f64) -> f64 {
        let junction = TrunkShape::alike(side_joint, PI);
        let ways = [
            longest(alike_place(folded), alike_place(&junction)),
            longest(driven_of(&junction.corners), driven_of(flat)),
        ];
        ways.into_iter().map(|way| self.flat.shapes.limits().seconds(way)).sum()
    }

    /// Whether the flat shape with both sides alike has the wanted clearance, as a flat shape and as one that begins to fold.
    fn is_free(&self, side_joint: f64) -> bool {
        let junction = TrunkShape::alike(side_joint, PI);
        self.flat.is_free(driven_of(&junction.corners)) && self.alike.is_free(alike_place(&junction))
    }
}

/// The place of a shape among those with both sides alike.
fn alike_place(shape: &TrunkShape) -> Driven {
    [shape.corners.0[1], shape.fold, 0.0]
}

fn timed(space: &Space<'_>, ends: [Driven; 2]) -> Option<Timed> {
    let legs = space.legs(&space.search(ends)?);
    Some((legs.iter().map(|leg| leg.seconds).sum(), legs))
}

fn joined((first, mut legs): Timed, (second, more): Timed) -> Timed {
    legs.extend(more);
    (first + second, legs)
}

fn faster(one: Option<Timed>, other: Option<Timed>) -> Option<Timed> {
    one.into_iter().chain(other).min_by(|one, other| one.0.total_cmp(&other.0))
}

fn faster_at(best: Option<(Timed, f64)>, found: Option<Timed>, side_joint: f64) -> Option<(Timed, f64)> {
    let found = found.map(|path| (path, side_joint));
    best.into_iter().chain(found).min_by(|one, other| one.0.0.total_cmp(&other.0.0))
}
