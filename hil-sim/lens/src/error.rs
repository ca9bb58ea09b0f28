//! What is wrong with a design, and where a ray ends.

use vergence_vision::Angle;

/// Why a ray does not pass a lens. Surfaces count from 1, as in the design's file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LostRay {
    /// The ray does not meet the surface.
    #[error("the ray misses surface {0}")]
    Missed(usize),
    /// The ray is reflected totally.
    #[error("the ray is reflected totally at surface {0}")]
    TotalReflection(usize),
    /// The ray meets the surface outside of its rim.
    #[error("the rim of surface {0} stops the ray")]
    Rim(usize),
}

/// Why a design cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum DesignError {
    /// The file is not one of a design.
    #[error("the design cannot be read: {0}")]
    Unreadable(#[from] toml::de::Error),
    /// A value of a surface, counted from 1.
    #[error("surface {surface}: {what}")]
    Surface {
        /// The surface's number.
        surface: usize,
        /// What is wrong, and what would be right.
        what: &'static str,
    },
    /// The surfaces together make no lens.
    #[error("{0}")]
    NoLens(&'static str),
    /// No chief ray was found at an angle inside the field that the design states.
    #[error("no chief ray passes at {:.2} degrees from the axis ({lost})", angle.deg())]
    NoChiefRay {
        /// Angle to the axis.
        angle: Angle,
        /// Where the last ray tried ended.
        lost: LostRay,
    },
}
