//! Checks of the size of a target.

use vergence_targets::{TargetKind, TargetView};
use vergence_vision::Length;

use crate::failure::Failure;

/// Sides of squares and tags that can be printed and seen.
const SIDES: [Length; 2] = [Length::from_mm(0.5), Length::from_mm(1000.0)];
/// The longest target.
const LONGEST: Length = Length::from_mm(20_000.0);

/// A square or tag of a target is half a millimetre to one metre long.
///
/// # Errors
/// Exit code 2.
pub fn side_can_be_held(target: &TargetKind) -> Result<(), Failure> {
    let [least, most] = SIDES.map(Length::mm);
    if (least..=most).contains(&target.side().mm()) {
        return Ok(());
    }
    let (part, option) = match target {
        TargetKind::Chessboard(_) | TargetKind::Charuco(_) => ("square", "--square"),
        TargetKind::AprilGrid(_) => ("tag", "--tag"),
    };
    Err(Failure::usage(format!(
        "a {part} of {} is not between {least} mm and {:.0} m: is {option} in the wrong unit, such as m for mm?",
        target.side(),
        most * 1e-3
    )))
}

/// The corners of a target that come from a file lie within 20 m.
///
/// # Errors
/// Exit code 2, with the name of the view.
pub fn corners_can_be_held<'a>(views: impl IntoIterator<Item = &'a TargetView>) -> Result<(), Failure> {
    for view in views {
        let extent = |axis: usize| {
            let places = view.corners.iter().map(|corner| corner.target_mm[axis]);
            places.clone().fold(f64::MIN, f64::max) - places.fold(f64::MAX, f64::min)
        };
        let long = extent(0).max(extent(1));
        if long > LONGEST.mm() {
            return Err(Failure::usage(format!(
                "the target of {} is {:.0} m long, and one that can be shown at most {:.0} m: are bx_mm and by_mm in millimetres?",
                view.name,
                long * 1e-3,
                LONGEST.mm() * 1e-3
            )));
        }
    }
    Ok(())
}
