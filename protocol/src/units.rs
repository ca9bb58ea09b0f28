//! The integers that travel, each with its unit in its type.

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
    /// A position on an axis: micrometres on a linear axis, microradians on a rotary one.
    Micro(i32),
    /// Encoder counts from the axis zero.
    Counts(i32),
    /// An instant or a span on the sender's clock, in microseconds.
    Microseconds(u64),
    /// Which host is speaking: random, never zero, new for each connection.
    SessionId(u32),
    /// Names one move, so that its progress can be told from another's.
    MoveId(u16),
    /// A vision mode by number; zero is "none". The host knows the names.
    Mode(u8),
    /// Thousandths.
    Permille(u16),
}

impl Permille {
    /// The whole.
    pub const FULL: Self = Self(1000);
}
