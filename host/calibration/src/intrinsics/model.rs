//! Which lens is asked for.

use std::fmt;
use std::str::FromStr;

/// Which parameters a lens has besides those of a central and symmetric one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LensModel {
    /// None: all rays go through one point.
    Central,
    /// The pupil's e0, whatever the views say.
    MovingPupil,
    /// The pupil's e0 and e1, decentring and thin prism, whatever the views say.
    Full,
    /// As the views say.
    #[default]
    ByEvidence,
}

/// A word that names no model of a lens.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is no model of a lens: central, moving-pupil, full or by-evidence")]
pub struct UnknownLensModel(String);

impl fmt::Display for LensModel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Central => "central",
            Self::MovingPupil => "moving-pupil",
            Self::Full => "full",
            Self::ByEvidence => "by-evidence",
        })
    }
}

impl FromStr for LensModel {
    type Err = UnknownLensModel;

    fn from_str(text: &str) -> Result<Self, UnknownLensModel> {
        [Self::Central, Self::MovingPupil, Self::Full, Self::ByEvidence]
            .into_iter()
            .find(|model| model.to_string() == text)
            .ok_or_else(|| UnknownLensModel(text.to_owned()))
    }
}
