//! The shapes among which a path is looked for, each by its place: angles of driven joints in radians.

use std::f64::consts::PI;

use super::Branch;
use super::leg::Driven;
use crate::linkage::{Clearance, CornerLimits, FlatTrunk, FoldingTrunk, TrunkShape};

/// Shapes that lead to each other without a change of the branch.
#[derive(Clone, Copy, Debug)]
pub(super) enum Shapes<'a> {
    /// With flat folds: interior angles of the corners A, B and C.
    Flat(&'a FlatTrunk, Branch),
    /// With both sides alike: interior angle of the side joints, that of the folds, and zero. The corners A and C move half as far as the
    /// side joint, so that no joint moves further than these two.
    Alike(&'a FoldingTrunk, Branch),
}

impl Shapes<'_> {
    /// The shape at a place, and its clearance; `None` where there is none.
    pub(super) fn at(&self, place: Driven) -> Option<(TrunkShape, Clearance)> {
        match self {
            Self::Flat(trunk, branch) => {
                let shapes = trunk.links.shapes(place).ok()?;
                let corners = match branch {
                    Branch::Outward => shapes.first(),
                    Branch::Inward => shapes.last(),
                };
                let corners = *corners?;
                Some((TrunkShape::flat(corners), trunk.clearance(&corners)))
            }
            Self::Alike(trunk, branch) => {
                let [side_joint, fold, nothing] = place;
                let is_of_branch = match branch {
                    Branch::Outward => side_joint <= PI,
                    Branch::Inward => side_joint >= PI,
                };
                let shape = TrunkShape::alike(side_joint, fold);
                (is_of_branch && nothing == 0.0).then(|| (shape, trunk.folded_clearance(&shape)))
            }
        }
    }

    pub(super) const fn limits(&self) -> &CornerLimits {
        match self {
            Self::Flat(trunk, _) => &trunk.limits,
            Self::Alike(trunk, _) => &trunk.flat.limits,
        }
    }
}
