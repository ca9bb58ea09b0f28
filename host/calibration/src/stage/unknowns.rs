//! The unknowns of a stage, one for each component of the solver's step.

use crate::extrinsics::Side;

/// One component of the stage's step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Unknown {
    /// A tilt of the direction of a link's screw.
    Direction { side: Side, link: usize, axis: usize },
    /// A shift of the line that a link turns about.
    Line { side: Side, link: usize, axis: usize },
    /// A component of the right camera's rotation with all axes at zero.
    Rotation,
    /// A component of the right camera's position with all axes at zero.
    Position,
    /// Scale factor of an encoder's readings.
    Scale { axis: usize },
    /// Error of an encoder's reading at one stage pose.
    Reading { pose: usize, axis: usize },
    /// A component of how far the right camera is from where the mechanism puts it at one stage pose: first the turn, then the shift.
    Return { pose: usize },
}

impl Unknown {
    /// Whether it is one of the mechanism, not of one stage pose.
    pub fn is_mechanical(self) -> bool {
        !matches!(self, Self::Reading { .. } | Self::Return { .. })
    }

    /// Description of the unknown; `names` are those of the axes.
    pub fn words(self, names: &[String]) -> String {
        let name = |axis: usize| names.get(axis).map_or("?", String::as_str);
        match self {
            Self::Direction { side, axis, .. } => format!("direction of the {side} camera's '{}' screw", name(axis)),
            Self::Line { side, axis, .. } => format!("position of the {side} camera's '{}' axis", name(axis)),
            Self::Rotation => "rotation of the right camera at zero".to_owned(),
            Self::Position => "position of the right camera at zero".to_owned(),
            Self::Scale { axis } => format!("encoder scale of '{}'", name(axis)),
            Self::Reading { axis, .. } => format!("reading of '{}'", name(axis)),
            Self::Return { .. } => "return to a stage pose".to_owned(),
        }
    }
}

/// Counts the components of one and the same unknown, which follow each other.
#[derive(Default)]
pub(crate) struct Ordinal {
    last: Option<Unknown>,
    count: usize,
}

impl Ordinal {
    /// Counts the components of the same unknown that came directly before.
    pub fn next(&mut self, unknown: Unknown) -> usize {
        self.count = if self.last == Some(unknown) { self.count + 1 } else { 0 };
        self.last = Some(unknown);
        self.count
    }
}
