//! Calibration targets: what they are, how they are printed, and where an image shows their corners.
//!
//! - [`TargetKind`] is a chessboard ([`TargetSpec`]), a ChArUco board ([`CharucoSpec`]) or a grid of AprilTags ([`AprilGridSpec`]); [`TargetKind::print`] draws it
//! - [`see`] finds a target of any kind in a fisheye image, whole or in part, past 90° from the axis
//! - [`SeenTarget`] holds its corners with all labellings that the image allows
//!
//! Everything is a pure function of its arguments.

mod april_grid;
mod charuco;
mod detect;
mod labelling;
mod plausible;
mod target;

pub use april_grid::{AprilGridSpec, TAG_BORDER};
pub use charuco::{CharucoSpec, MARKER_BORDER};
pub use detect::{
    CornerQuality, DetectError, DetectedCorner, Detection, Placement, ReadCode, SearchedImage, TagFamily, detect,
    detect_april_grid, detect_charuco, detect_from, see, see_from,
};
pub use labelling::{Relabelling, SeenTarget};
pub use plausible::{ImplausibleTarget, corners_can_be_held};
pub use target::{Corner, Target, TargetKind, TargetPrint, TargetSpec, TargetView};
