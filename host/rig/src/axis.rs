//! One axis of the rig on the host's side: its name, range and encoder scale.

use std::time::Duration;

use vergence_protocol::{AxisInfo, AxisKind, Counts, Micro};
use vergence_vision::{Angle, Length};

use crate::pitch::PitchTable;
use crate::track::UNIFORM;

/// Standard deviation of what may push an axis that nobody watches, as a part of its range per second.
pub const CREEP: f64 = 1e-3;

/// A position of an axis: a length or an angle, by the kind of the axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum AxisPosition {
    /// Position of a linear axis.
    Linear(Length),
    /// Position of a rotary axis.
    Rotary(Angle),
}

impl AxisPosition {
    /// The position in millimetres or radians, the units of the screw chain.
    #[must_use]
    pub fn value(self) -> f64 {
        match self {
            Self::Linear(length) => length.mm(),
            Self::Rotary(angle) => angle.rad(),
        }
    }

    /// The position in millimetres or degrees, the units of CSV files and JSON.
    #[must_use]
    pub fn mm_or_deg(self) -> f64 {
        match self {
            Self::Linear(length) => length.mm(),
            Self::Rotary(angle) => angle.deg(),
        }
    }

    /// The position in whole micrometres or microradians, the units of the wire.
    #[must_use]
    pub fn micro(self) -> Micro {
        let micro = match self {
            Self::Linear(length) => length.mm() * 1e3,
            Self::Rotary(angle) => angle.rad() * 1e6,
        };
        // The cast saturates; such a position is far outside any axis's range and refused there.
        Micro(micro.round() as i32)
    }

    /// Makes a position on an axis of `kind` from `value` in millimetres or radians.
    #[must_use]
    pub fn from_value(kind: AxisKind, value: f64) -> Self {
        match kind {
            AxisKind::Linear => Self::Linear(Length::from_mm(value)),
            AxisKind::Rotary => Self::Rotary(Angle::from_rad(value)),
        }
    }

    /// Makes a position on an axis of `kind` from the wire's micrometres or microradians.
    #[must_use]
    pub fn from_micro(kind: AxisKind, micro: Micro) -> Self {
        match kind {
            AxisKind::Linear => Self::Linear(Length::from_mm(f64::from(micro.0) * 1e-3)),
            AxisKind::Rotary => Self::Rotary(Angle::from_rad(f64::from(micro.0) * 1e-6)),
        }
    }

    /// Whether this is a position on an axis of `kind`.
    #[must_use]
    pub fn is_of(self, kind: AxisKind) -> bool {
        matches!((self, kind), (Self::Linear(_), AxisKind::Linear) | (Self::Rotary(_), AxisKind::Rotary))
    }

    /// The sum with `other` of the same kind.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        match self {
            Self::Linear(length) => Self::Linear(Length::from_mm(length.mm() + other.value())),
            Self::Rotary(angle) => Self::Rotary(Angle::from_rad(angle.rad() + other.value())),
        }
    }

    /// The difference to `other` of the same kind: this position less `other`.
    #[must_use]
    pub fn minus(self, other: Self) -> Self {
        match self {
            Self::Linear(length) => Self::Linear(Length::from_mm(length.mm() - other.value())),
            Self::Rotary(angle) => Self::Rotary(Angle::from_rad(angle.rad() - other.value())),
        }
    }
}

/// Positions of several axes in words, such as "120.000 mm, 45.000°".
#[must_use]
pub fn positions_in_words(positions: &[AxisPosition]) -> String {
    positions.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

impl std::fmt::Display for AxisPosition {
    /// Prints three decimals, or the precision of the format (`{:.1}`).
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let digits = f.precision().unwrap_or(3);
        match self {
            Self::Linear(length) => write!(f, "{length:.digits$}"),
            Self::Rotary(angle) => write!(f, "{angle:.digits$}"),
        }
    }
}

/// One axis of the rig.
#[derive(Clone, Debug, PartialEq)]
pub struct RigAxis {
    /// Name of the axis in modes and on the command line.
    pub name: String,
    /// Linear or rotary.
    pub kind: AxisKind,
    /// Lowest and highest position.
    pub range: [AxisPosition; 2],
    /// Lowest and highest position at which the cameras' pose was calibrated; `None` where the rig file does not state
    /// it.
    pub calibrated: Option<[AxisPosition; 2]>,
    /// Encoder counts per metre or revolution.
    pub counts_per_unit: u32,
    /// Play between encoder and stage in millimetres or radians: the stage is up to half of it to either side of where the
    /// encoder says.
    pub play: f64,
    /// Error of the encoder's scale over the travel.
    pub pitch: PitchTable,
    /// The position where the encoder reads zero, in millimetres or radians.
    pub zero: f64,
    /// Whether the encoder counts down while the position rises, as a servo that is mounted upside down.
    pub reversed: bool,
}

impl RigAxis {
    /// Name of the column or field with positions of the axis in CSV files and JSON, such as `baseline_mm` or
    /// `separation_deg`. Its values are those of [`AxisPosition::mm_or_deg`].
    #[must_use]
    pub fn column(&self) -> String {
        match self.kind {
            AxisKind::Linear => format!("{}_mm", self.name),
            AxisKind::Rotary => format!("{}_deg", self.name),
        }
    }

    /// The size of a count in millimetres or radians.
    #[must_use]
    pub fn value_per_count(&self) -> f64 {
        let unit = match self.kind {
            AxisKind::Linear => 1000.0,
            AxisKind::Rotary => std::f64::consts::TAU,
        };
        unit / f64::from(self.counts_per_unit)
    }

    /// One where the encoder counts up while the position rises, otherwise minus one.
    #[must_use]
    pub const fn direction(&self) -> f64 {
        if self.reversed { -1.0 } else { 1.0 }
    }

    /// The position in millimetres or radians at `counts`, which may be interpolated, corrected by the table of its pitch, the
    /// direction and the zero of its encoder.
    ///
    /// The encoder changes to n when n is reached from below, so the middle of a count is half a count further.
    #[must_use]
    pub fn value_at(&self, counts: f64) -> f64 {
        self.zero + self.direction() * self.pitch.truth((counts + 0.5) * self.value_per_count())
    }

    /// What the encoder says, in millimetres or radians, at the position `value`.
    fn encoder(&self, value: f64) -> f64 {
        self.pitch.encoder(self.direction() * (value - self.zero))
    }

    /// Standard deviation in counts of the stage beside its encoder's reading, whose own is `reading` counts. A stage with play
    /// that was moved lies at one end of the play or at the other.
    #[must_use]
    pub fn sigma_with_play(&self, reading: f64) -> f64 {
        reading.hypot(0.5 * self.play / self.value_per_count())
    }

    /// Standard deviation in counts of an axis that stood when it was read, `unseen` ago: nobody tells what has pushed it since. It grows by
    /// a thousandth of the range per second, which is an assumption.
    #[must_use]
    pub fn sigma_unseen(&self, unseen: Duration) -> f64 {
        let [low, high] = self.range.map(AxisPosition::value);
        UNIFORM.hypot(CREEP * unseen.as_secs_f64() * (high - low) / self.value_per_count())
    }

    /// Standard deviation in counts of an axis that may stand anywhere in its range.
    #[must_use]
    pub fn sigma_of_range(&self) -> f64 {
        let [low, high] = self.range.map(AxisPosition::value);
        (high - low) / 12f64.sqrt() / self.value_per_count()
    }

    /// The counts, with a fraction, at `value` in millimetres or radians: the inverse of [`Self::value_at`].
    #[must_use]
    pub fn counts_at(&self, value: f64) -> f64 {
        self.encoder(value) / self.value_per_count() - 0.5
    }

    /// The position in millimetres or radians at `micro` in micrometres or microradians, which may be a fraction.
    #[must_use]
    pub fn value_from_micro(&self, micro: f64) -> f64 {
        match self.kind {
            AxisKind::Linear => micro * 1e-3,
            AxisKind::Rotary => micro * 1e-6,
        }
    }

    /// The position that the board must be sent to, by its encoder, so that the stage is at `position`.
    #[must_use]
    pub fn wire_position(&self, position: AxisPosition) -> Micro {
        AxisPosition::from_value(self.kind, self.encoder(position.value())).micro()
    }

    /// The position at whole `counts`.
    #[must_use]
    pub fn position_at(&self, counts: Counts) -> AxisPosition {
        AxisPosition::from_value(self.kind, self.value_at(f64::from(counts.0)))
    }

    /// Whether `position` is of this axis's kind and within its range.
    #[must_use]
    pub fn contains(&self, position: AxisPosition) -> bool {
        let [low, high] = self.range;
        position.is_of(self.kind) && position.value() >= low.value() && position.value() <= high.value()
    }

    /// A warning in a sentence where `position` lies outside the calibrated range, by more than encoder and play
    /// explain.
    #[must_use]
    pub fn extrapolation(&self, position: AxisPosition) -> Option<String> {
        // Tolerance as a fraction of the calibrated range.
        const SLACK: f64 = 0.005;
        let [low, high] = self.calibrated?;
        let slack = SLACK * (high.value() - low.value());
        let beyond = position.value() < low.value() - slack || position.value() > high.value() + slack;
        beyond.then(|| {
            format!(
                "{} {position:.1} lies outside {low:.1} to {high:.1}, where the rig was calibrated: the pose there is \
                 extrapolated, and less certain than stated",
                self.name
            )
        })
    }

    /// A sentence on what the board states otherwise of this axis, its kind or its encoder scale; `None` where both
    /// agree.
    #[must_use]
    pub fn contradiction(&self, board: &AxisInfo) -> Option<String> {
        if board.kind != self.kind {
            return Some(format!(
                "axis '{}' is {:?} in the rig file and {:?} on the board",
                self.name, self.kind, board.kind
            ));
        }
        (board.counts_per_unit != self.counts_per_unit).then(|| {
            format!(
                "axis '{}' has {} encoder counts per unit in the rig file and {} on the board",
                self.name, self.counts_per_unit, board.counts_per_unit
            )
        })
    }
}
