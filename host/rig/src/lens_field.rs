//! The choice which part of a lens's field is used.

use std::fmt;
use std::str::FromStr;

/// Which part of the field of a lens is used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LensField {
    /// The part in which the lens was measured.
    #[default]
    Measured,
    /// All for which its model is valid: see [`vergence_vision::KannalaBrandt::extrapolated`].
    Extrapolated,
}

/// A word that names no part of a field.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is no field: measured or extrapolated")]
pub struct UnknownField(String);

impl FromStr for LensField {
    type Err = UnknownField;

    fn from_str(text: &str) -> Result<Self, UnknownField> {
        [Self::Measured, Self::Extrapolated]
            .into_iter()
            .find(|field| field.to_string() == text)
            .ok_or_else(|| UnknownField(text.to_owned()))
    }
}

impl fmt::Display for LensField {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Measured => "measured",
            Self::Extrapolated => "extrapolated",
        })
    }
}
