//! The integers of the messages, each with its unit in its type.
//!
//! ```
//! use vergence_protocol::{Micro, Permille};
//!
//! let (baseline, half_speed) = (Micro(65_000), Permille(500)); // 65 mm on a linear axis, at half its speed
//! assert!(half_speed < Permille::FULL && baseline.0 == 65_000);
//! ```

use postcard_schema::Schema;
use serde::{Deserialize, Serialize};

macro_rules! wire_integer {
    ($($(#[$doc:meta])* $name:ident($int:ty)),+ $(,)?) => {$(
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, Schema)]
        pub struct $name(pub $int);
    )+};
}
wire_integer! {
    /// A position or distance on an axis: micrometres on a linear axis, microradians on a rotary one.
    Micro(i32),
    /// Encoder counts: from the axis zero if the axis is referenced.
    Counts(i32),
    /// A time or a duration on the sender's clock, in microseconds.
    Microseconds(u64),
    /// Names the host's session: random, never zero, new for each connection.
    SessionId(u32),
    /// Number of a move, chosen by the host, so that its progress is not mistaken for another move's.
    MoveId(u16),
    /// Number of a vision mode; zero is "none". The host knows the names.
    Mode(u8),
    /// A share in thousandths.
    Permille(u16),
}

impl Permille {
    /// The whole: 1000 thousandths.
    pub const FULL: Self = Self(1000);
}
