//! Named poses, their numbers on the wire, and the mode that a board reports.

use std::fmt;

use vergence_protocol::{AxisKind, Mode as ModeNumber, PoseReport};

use crate::axis::{AxisPosition, RigAxis};

/// A named pose of the rig.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// Such as `herbivore`.
    pub name: String,
    /// Number of the mode on the wire, from 1; unique in a rig file.
    pub number: ModeNumber,
    /// The position of each axis, in the order of [`crate::Rig::axes`].
    pub targets: Vec<AxisPosition>,
}

impl Mode {
    /// The number of a mode whose rig file states none: a hash of `name` into 32 to 255.
    ///
    /// It depends on nothing but the name, so adding a mode to a rig file never renumbers another one. Numbers below 32
    /// are never derived: they are free for `number = N` in rig files. The hash is FNV-1a with 32 bits (Fowler, Noll,
    /// Vo).
    ///
    /// ```
    /// # use vergence_rig::Mode;
    /// assert_eq!(Mode::number_from_name("gecko").0, 48);
    /// ```
    #[must_use]
    pub fn number_from_name(name: &str) -> ModeNumber {
        const LOWEST: u8 = 32;
        let span = u32::from(u8::MAX - LOWEST) + 1;
        let hash = name.bytes().fold(0x811C_9DC5_u32, |hash, byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193));
        // The remainder is below 224, so the cast keeps it whole.
        ModeNumber(LOWEST + (hash % span) as u8)
    }

    /// Whether every axis stands within 1 mm or 1° of this mode's target, by `pose`.
    pub(crate) fn is_at(&self, axes: &[RigAxis], pose: &PoseReport) -> bool {
        axes.iter().zip(&self.targets).zip(&pose.counts).all(|((axis, target), &counts)| {
            let width = match axis.kind {
                AxisKind::Linear => 1.0,
                AxisKind::Rotary => 1f64.to_radians(),
            };
            axis.position_at(counts).minus(*target).value().abs() <= width
        })
    }
}

/// The mode that a board reports, checked against the rig file.
///
/// A board keeps only the number of the mode it was sent to. Another rig file may have given it that number.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum ReportedMode<'a> {
    /// The rig file has the number, and the axes stand at that mode's targets.
    Known(&'a Mode),
    /// The rig file has the number, but the axes stand away from that mode's targets.
    Elsewhere(&'a Mode),
    /// No mode of the rig file has the number.
    Unknown(ModeNumber),
}

impl fmt::Display for ReportedMode<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Known(mode) => f.write_str(&mode.name),
            Self::Elsewhere(mode) => {
                write!(f, "mode {}, not where this rig file puts '{}'", mode.number.0, mode.name)
            }
            Self::Unknown(number) => write!(f, "mode {}, not in this rig file", number.0),
        }
    }
}
