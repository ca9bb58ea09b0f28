//! Checks of the views that a calibration is made from, and of the lens that it gives.

use vergence_calibration::StereoView;
use vergence_targets::TargetView;
use vergence_vision::{ImageSize, KannalaBrandt, Pixel, Side};

use crate::Implausible;

/// Two photographs of a target differ by more than this at some corner, in pixels: by their noise alone.
const SAME_PX: f64 = 1e-3;
/// How far the principal point may lie from the middle of the image, as a part of the image's side.
const OFF_MIDDLE: f64 = 0.25;

/// Every corner lies in the image.
///
/// # Errors
/// [`Implausible::Input`].
pub fn corners_lie_in_image<'a>(
    views: impl IntoIterator<Item = &'a TargetView>,
    size: ImageSize,
    camera: &str,
) -> Result<(), Implausible> {
    // Positions are those of pixel centres: the border is half a pixel further out.
    let inside = |x: f64, pixels: u32| (-0.5..=f64::from(pixels) - 0.5).contains(&x);
    let (mut all, mut outside) = (0_usize, Vec::new());
    for view in views {
        for corner in &view.corners {
            let Pixel { u, v } = corner.pixel;
            all += 1;
            // What is no number has its own sentence.
            if (u.is_finite() && v.is_finite()) && !(inside(u, size.width) && inside(v, size.height)) {
                outside.push(format!("({u:.1}, {v:.1}) of {}", view.name));
            }
        }
    }
    let Some(first) = outside.first() else { return Ok(()) };
    Err(Implausible::Input(format!(
        "{} of {all} corners lie outside the images of {camera}, which are {} x {}, such as {first}: are width and height swapped, or \
         the corners another camera's?",
        outside.len(),
        size.width,
        size.height
    )))
}

/// No view of one camera is another one again.
///
/// # Errors
/// [`Implausible::Input`].
pub fn views_differ(views: &[TargetView], camera: &str) -> Result<(), Implausible> {
    for (index, view) in views.iter().enumerate() {
        if let Some(other) = views.iter().take(index).find(|other| is_same(view, other)) {
            return Err(Implausible::Input(format!(
                "{} and {} of {camera} are the same photograph: name each image once",
                other.name, view.name
            )));
        }
    }
    Ok(())
}

/// The left and the right camera of a pair took different photographs.
///
/// # Errors
/// [`Implausible::Input`].
pub fn sides_differ(views: &[StereoView]) -> Result<(), Implausible> {
    match views.iter().find(|view| is_same(&view.left, &view.right)) {
        None => Ok(()),
        Some(view) => Err(Implausible::Input(format!(
            "{} of the left camera and {} of the right one are the same photograph: name the images of both cameras",
            view.left.name, view.right.name
        ))),
    }
}

/// Checks the views of a pair of cameras: corners in their images, no photograph twice, and none for both cameras.
///
/// # Errors
/// Those of the checks in this module.
pub fn views_of_pair(views: &[StereoView], lenses: [&KannalaBrandt; 2]) -> Result<(), Implausible> {
    let [left, right] = lenses;
    sides_differ(views)?;
    for (side, lens) in [(Side::Left, left), (Side::Right, right)] {
        let of_side = |view: &StereoView| match side {
            Side::Left => view.left.clone(),
            Side::Right => view.right.clone(),
        };
        let views: Vec<TargetView> = views.iter().map(of_side).collect();
        let camera = format!("the {side} camera");
        corners_lie_in_image(&views, lens.size(), &camera)?;
        views_differ(&views, &camera)?;
    }
    Ok(())
}

/// The principal point of a lens lies near the middle of its images.
///
/// # Errors
/// [`Implausible::Result`].
pub fn axis_is_near_the_middle(lens: &KannalaBrandt) -> Result<(), Implausible> {
    let (size, centre) = (lens.size(), lens.centre());
    let off = |at: f64, pixels: u32| (at - 0.5 * f64::from(pixels - 1)).abs() / f64::from(pixels);
    if off(centre.u, size.width) <= OFF_MIDDLE && off(centre.v, size.height) <= OFF_MIDDLE {
        return Ok(());
    }
    Err(Implausible::Result(format!(
        "the lens's axis meets the image at ({:.0}, {:.0}), far from the middle of {} x {}: are width and height swapped, or are \
         the images cut out of larger ones?",
        centre.u, centre.v, size.width, size.height
    )))
}

/// Whether two views have the same corners at the same places.
fn is_same(one: &TargetView, other: &TargetView) -> bool {
    one.corners.len() == other.corners.len()
        && one.corners.iter().zip(&other.corners).all(|(a, b)| {
            distance(a.pixel, b.pixel) < SAME_PX && a.target_mm.map(f64::to_bits) == b.target_mm.map(f64::to_bits)
        })
}

/// The distance of two pixels.
fn distance(one: Pixel, other: Pixel) -> f64 {
    (one.u - other.u).hypot(one.v - other.v)
}
