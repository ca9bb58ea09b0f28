//! Sizes that a target cannot have: they come from a wrong unit.

use vergence_vision::Length;

use crate::{TargetKind, TargetView};

/// Sides of squares and tags that can be printed and seen.
const SIDES: [Length; 2] = [Length::from_mm(0.5), Length::from_mm(1000.0)];
/// The longest target.
const LONGEST: Length = Length::from_mm(20_000.0);

/// Why a target cannot be meant.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ImplausibleTarget {
    /// Its squares or tags cannot be printed or seen.
    #[error(
        "a {part} of {side} is not between {} mm and {:.0} m: is --{part} in the wrong unit, such as m for mm?",
        SIDES[0].mm(), SIDES[1].mm() * 1e-3
    )]
    Side {
        /// "square" or "tag", also the option that names its side.
        part: &'static str,
        /// Its side.
        side: Length,
    },
    /// Corners of a file are farther apart than any target is long.
    #[error(
        "the target of {view} is {:.0} m long, and one that can be shown at most {:.0} m: are bx_mm and by_mm in millimetres?",
        length.mm() * 1e-3, LONGEST.mm() * 1e-3
    )]
    Corners {
        /// The view's name.
        view: String,
        /// The extent of its corners.
        length: Length,
    },
}

impl TargetKind {
    /// Checks that a square or tag of the target is half a millimetre to one metre long.
    ///
    /// # Errors
    /// Where it is not.
    pub fn can_be_held(&self) -> Result<(), ImplausibleTarget> {
        let [least, most] = SIDES.map(Length::mm);
        if (least..=most).contains(&self.side().mm()) {
            return Ok(());
        }
        let part = match self {
            Self::Chessboard(_) | Self::Charuco(_) => "square",
            Self::AprilGrid(_) => "tag",
        };
        Err(ImplausibleTarget::Side { part, side: self.side() })
    }
}

/// Checks that the corners of each view, read from a file, lie within 20 m.
///
/// # Errors
/// The first view in which they do not.
pub fn corners_can_be_held<'a>(views: impl IntoIterator<Item = &'a TargetView>) -> Result<(), ImplausibleTarget> {
    for view in views {
        let extent = |axis: usize| {
            let places = view.corners.iter().map(|corner| corner.target_mm[axis]);
            places.clone().fold(f64::MIN, f64::max) - places.fold(f64::MAX, f64::min)
        };
        let long = extent(0).max(extent(1));
        if long > LONGEST.mm() {
            return Err(ImplausibleTarget::Corners { view: view.name.clone(), length: Length::from_mm(long) });
        }
    }
    Ok(())
}
