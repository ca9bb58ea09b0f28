//! Why there is no path.

use crate::linkage::{Gap, SixBarError};

/// Why there is no path.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum NoPath {
    /// The loop does not close with these corners.
    #[error("the {end} is no shape of the trunk: {why}")]
    NotClosed {
        /// The end of the path that is refused.
        end: PathEnd,
        /// The reason why the loop does not close there.
        why: SixBarError,
    },
    /// Bodies touch.
    #[error("at the {end} {} and {} overlap by {:.1} mm", .gap.between[0], .gap.between[1], -.gap.mm)]
    Collides {
        /// The end of the path that is refused.
        end: PathEnd,
        /// The bodies that overlap, and by how much.
        gap: Gap,
    },
    /// A joint is beyond its range.
    #[error("at the {end} a joint is {:.1} degrees beyond its range", .by.to_degrees())]
    BeyondRange {
        /// The end of the path that is refused.
        end: PathEnd,
        /// Angle in radians.
        by: f64,
    },
    /// A folded end whose folds differ, or whose sides do.
    #[error(
        "folded, the loop closes only with both sides alike and both folds alike: at the {end} a joint is {:.1} degrees off that",
        .by.to_degrees()
    )]
    NotAlike {
        /// The end of the path that is refused.
        end: PathEnd,
        /// Angle in radians.
        by: f64,
    },
    /// Corner E is outside at one end and inside at the other.
    #[error(
        "corner E would have to pass from one side of the line DF to the other, through a dead centre where it may go either way"
    )]
    OtherBranch,
    /// The search found none.
    #[error("no way was found along which the loop closes and nothing touches")]
    NoWay,
}

/// An end of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PathEnd {
    /// The shape in which the path begins.
    Start,
    /// The shape to which the path leads.
    Goal,
}

impl core::fmt::Display for PathEnd {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(match self {
            Self::Start => "start",
            Self::Goal => "goal",
        })
    }
}
