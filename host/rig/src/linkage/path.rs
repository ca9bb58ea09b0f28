//! Paths of the trunk from one shape to another.
//!
//! A path is a list of legs. In a leg every driven joint runs in a straight line, all at the same share of their way, as the
//! firmware moves its axes. The planner looks for the fastest list that keeps the wanted clearance. A shape may have less than
//! that itself: gecko is a dead centre of the linkage. The planner then leaves or enters it by one short leg along which the
//! loop's reserve only grows, and does not go along the edge of what the loop can reach. What leads from flat to folded shapes is in
//! `folded`.

mod folded;
mod lattice;
mod leg;
mod no_path;
mod refine;
mod shapes;

pub use leg::{Leg, LegSample};
pub use no_path::{NoPath, PathEnd};

use super::{Clearance, Corners, FlatTrunk, TrunkShape, WantedClearance};
use leg::Driven;
use shapes::Shapes;

/// Longest way of a driven joint with less clearance than wanted, at either end of a path: 10 degrees.
const LONGEST_PASSAGE: f64 = 0.1745;
/// How far readings may be from the nearest shape: 3 degrees.
const CLOSED_WITHIN: f64 = 0.0524;
/// How far within reach of each other corners D and F are put, in square millimetres: a twentieth of a millimetre at the paper's links.
const CLOSED_BY: f64 = 28.0;
const CLOSING_STEPS: usize = 8;
/// Step for the slope of the reach, in radians.
const SLOPE_STEP: f64 = 1e-6;
/// Shapes are the same where no driven corner differs by more than this, in radians.
const SAME: f64 = 1e-9;
/// By how much each attempt without a way lowers the wanted clearance.
const RELAXED: [f64; 4] = [1.0, 0.5, 0.25, 0.1];

/// On which side of the line DF corner E lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branch {
    /// Outside, as in all modes.
    Outward,
    /// Inside.
    Inward,
}

impl Branch {
    /// The branch of a shape; `None` at a dead centre, where both meet.
    #[must_use]
    pub fn of(shape: &Corners) -> Option<Self> {
        let bend = std::f64::consts::PI - shape.0[4];
        match () {
            () if bend > 1e-4 => Some(Self::Outward),
            () if bend < -1e-4 => Some(Self::Inward),
            () => None,
        }
    }
}

/// A way from one shape to another.
#[derive(Clone, Debug, PartialEq)]
pub struct TrunkPath {
    /// The legs in their order; none where both shapes are the same.
    pub legs: Vec<Leg>,
    /// The clearance that all shapes have but those of the passages at either end.
    pub kept: WantedClearance,
}

impl TrunkPath {
    /// The shape at `seconds` after the start, and its clearance; those of the ends beyond them. `None` for a path without legs.
    ///
    /// Each leg takes constant acceleration, constant speed, and constant braking.
    #[must_use]
    pub fn at(&self, seconds: f64) -> Option<(TrunkShape, Clearance)> {
        let mut left = seconds.max(0.0);
        for leg in &self.legs {
            if left <= leg.seconds {
                return leg.at(left).map(|sample| (sample.shape, sample.room));
            }
            left -= leg.seconds;
        }
        self.legs.last().and_then(|leg| leg.samples.last()).map(|sample| (sample.shape, sample.room))
    }

    /// Time of the whole path in seconds, with a rest after each leg of no length.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.legs.iter().map(|leg| leg.seconds).sum()
    }
}

impl FlatTrunk {
    /// The fastest path found from one closed shape to another. Where none keeps the clearance `wanted`, one that keeps a half, a
    /// quarter or a tenth of it: [`TrunkPath::kept`] says which.
    ///
    /// # Errors
    /// [`NoPath`] if an end is forbidden, or no way was found.
    pub fn path(&self, start: &Corners, goal: &Corners, wanted: &WantedClearance) -> Result<TrunkPath, NoPath> {
        let start = self.closed(start);
        let [start, goal] = [self.end(&start, PathEnd::Start)?, self.end(goal, PathEnd::Goal)?];
        let branch = match (Branch::of(&start), Branch::of(&goal)) {
            (Some(one), Some(other)) if one != other => return Err(NoPath::OtherBranch),
            (one, other) => one.or(other).unwrap_or(Branch::Outward),
        };
        let ends = [start, goal].map(|shape| driven_of(&shape));
        for share in RELAXED {
            let kept = WantedClearance { loop_reserve: wanted.loop_reserve * share, gap_mm: wanted.gap_mm * share };
            let space = Space { shapes: Shapes::Flat(self, branch), wanted: kept };
            if let Some(places) = space.search(ends) {
                return Ok(TrunkPath { legs: space.legs(&places), kept });
            }
        }
        Err(NoPath::NoWay)
    }

    /// The nearest shape to readings that are beyond a dead centre, as by play and noise: a trunk stands where its loop is closed,
    /// whatever its encoders say. Readings that are further off stay as they are.
    fn closed(&self, read: &Corners) -> Corners {
        let mut driven = driven_of(read);
        if self.links.shapes(driven).is_ok() {
            return *read;
        }
        for _ in 0..CLOSING_STEPS {
            let beyond = self.links.beyond_reach(driven) + CLOSED_BY;
            if beyond <= 0.0 {
                break;
            }
            let slope: [f64; 3] = std::array::from_fn(|corner| {
                let mut moved = driven;
                moved[corner] += SLOPE_STEP;
                (self.links.beyond_reach(moved) - self.links.beyond_reach(driven)) / SLOPE_STEP
            });
            let steepness: f64 = slope.iter().map(|slope| slope * slope).sum();
            driven = std::array::from_fn(|corner| driven[corner] - slope[corner] * beyond / steepness);
        }
        let is_near =
            leg::longest(driven_of(read), driven) < CLOSED_WITHIN && driven.iter().all(|angle| angle.is_finite());
        if is_near { self.links.outward_or_straight(driven) } else { *read }
    }

    /// Checks an end of a path, and closes the loop with its driven corners.
    fn end(&self, shape: &Corners, end: PathEnd) -> Result<Corners, NoPath> {
        let shapes = self.links.shapes(driven_of(shape)).map_err(|why| NoPath::NotClosed { end, why })?;
        let shape = shape.nearest(&shapes).unwrap_or(*shape);
        match self.clearance(&shape) {
            Clearance { gap, .. } if gap.mm <= 0.0 => Err(NoPath::Collides { end, gap }),
            room if room.is_forbidden() => Err(NoPath::BeyondRange { end, by: -room.joint_range }),
            _ => Ok(shape),
        }
    }
}

fn driven_of(shape: &Corners) -> Driven {
    let Corners([a, b, c, ..]) = *shape;
    [a, b, c]
}

/// Shapes, and what paths among them must keep.
#[derive(Clone, Copy, Debug)]
struct Space<'a> {
    shapes: Shapes<'a>,
    wanted: WantedClearance,
}

impl Space<'_> {
    /// The shape at this place; `None` where the loop does not close, or something is forbidden.
    fn shape(&self, place: Driven) -> Option<(TrunkShape, Clearance)> {
        self.shapes.at(place).filter(|(_, room)| !room.is_forbidden())
    }

    fn is_free(&self, driven: Driven) -> bool {
        self.shape(driven).is_some_and(|(_, room)| room.has(&self.wanted))
    }

    /// Places of the fastest path found, with both ends.
    fn search(&self, ends: [Driven; 2]) -> Option<Vec<Driven>> {
        if leg::longest(ends[0], ends[1]) < SAME {
            return Some(Vec::new());
        }
        let direct = vec![ends[0], ends[1]];
        if self.seconds(&direct).is_some() {
            return Some(direct);
        }
        let [leave, enter] = ends.map(|end| self.exits(end));
        let by_exits = self.between_exits(ends, &leave, &enter).or_else(|| self.by_lattice(ends, &leave, &enter))?;
        Some(self.refine(by_exits))
    }

    /// The legs of the path through `places`.
    fn legs(&self, places: &[Driven]) -> Vec<Leg> {
        places.windows(2).filter_map(|pair| self.leg(pair[0], pair[1])).collect()
    }

    /// Time in seconds of the path through `places`; `None` where a leg is not allowed.
    fn seconds(&self, places: &[Driven]) -> Option<f64> {
        places.windows(2).map(|pair| self.leg(pair[0], pair[1]).map(|leg| leg.seconds)).sum()
    }

    /// Places with the wanted clearance to which one leg leads from `end`; `end` itself where it has it.
    fn exits(&self, end: Driven) -> Vec<Driven> {
        if self.is_free(end) {
            return vec![end];
        }
        let mut exits: Vec<Driven> = lattice::directions().filter_map(|way| self.exit(end, way)).collect();
        let length = |exit: &Driven| leg::longest(end, *exit);
        exits.sort_by(|one, other| length(one).total_cmp(&length(other)));
        exits
    }

    /// The first place along `way` that can be reached from `end` and has half as much room again as wanted.
    fn exit(&self, end: Driven, way: Driven) -> Option<Driven> {
        let roomy = WantedClearance { loop_reserve: 1.5 * self.wanted.loop_reserve, gap_mm: self.wanted.gap_mm };
        let space = Self { wanted: roomy, ..*self };
        let steps = (1..=20).map(|step| f64::from(step) * LONGEST_PASSAGE / 10.0);
        let place = |length: f64| -> Driven { std::array::from_fn(|corner| end[corner] + length * way[corner]) };
        let found = steps.map(place).find(|&place| space.is_free(place))?;
        self.leg(end, found).map(|_| found)
    }

    /// The fastest path of one leg between two exits.
    fn between_exits(&self, ends: [Driven; 2], leave: &[Driven], enter: &[Driven]) -> Option<Vec<Driven>> {
        let pairs = leave.iter().flat_map(|&out| enter.iter().map(move |&into| [out, into]));
        let paths = pairs.filter_map(|[out, into]| {
            let mut places = vec![ends[0], out, into, ends[1]];
            places.dedup();
            self.seconds(&places).map(|seconds| (seconds, places))
        });
        paths.min_by(|one, other| one.0.total_cmp(&other.0)).map(|(_, places)| places)
    }
}
