//! Parts of an image that are left out, as shapes in a text: the robot's body, a hood, all outside the image circle.

use std::path::{Path, PathBuf};

use serde::de::value::SeqAccessDeserializer;
use serde::de::{SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use vergence_vision::{BodyMask, ImageSize};

/// Why a text describes no mask.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MaskError {
    /// The text is not TOML, or a key is missing or unknown. The message names the line.
    #[error("{0}")]
    Syntax(String),
    /// A shape is none. Shapes count from 1.
    #[error("shape {number}: {why}")]
    Shape {
        /// Its number.
        number: usize,
        /// What is wrong, and what to do.
        why: String,
    },
    /// There is nothing left to see.
    #[error("its shapes hide the whole image: check which hide their inside and which their outside")]
    HidesAll,
}

/// What is left out of the images of a camera, as a rig file or an option says it.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum CameraMask {
    /// The name of a file: a picture of the camera's size that is black there, or TOML with shapes (see [`mask_of_shapes`]).
    File(PathBuf),
    /// Shapes.
    Shapes(Vec<MaskShape>),
}

impl CameraMask {
    /// The file, where it is one.
    #[must_use]
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::File(file) => Some(file),
            Self::Shapes(_) => None,
        }
    }
}

/// Reads a text as the name of a file, and a list as shapes, so that a fault in a shape is told by its key and line.
impl<'de> Deserialize<'de> for CameraMask {
    fn deserialize<D: Deserializer<'de>>(file: D) -> Result<Self, D::Error> {
        struct FileOrShapes;
        impl<'de> Visitor<'de> for FileOrShapes {
            type Value = CameraMask;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("the name of a mask's file, or shapes")
            }

            fn visit_str<E>(self, name: &str) -> Result<CameraMask, E> {
                Ok(CameraMask::File(name.into()))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, shapes: A) -> Result<CameraMask, A::Error> {
                Vec::deserialize(SeqAccessDeserializer::new(shapes)).map(CameraMask::Shapes)
            }
        }
        file.deserialize_any(FileOrShapes)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MaskFile {
    shape: Vec<MaskShape>,
}

/// A polygon or a circle that hides a part of an image.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MaskShape {
    hides: Part,
    /// Corners (u, v) in pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    polygon: Option<Vec<[f64; 2]>>,
    /// Centre (u, v) and radius in pixels.
    #[serde(skip_serializing_if = "Option::is_none")]
    circle: Option<[f64; 3]>,
}

#[derive(Clone, Copy, Debug, Serialize, Deserialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
enum Part {
    Inside,
    Outside,
}

/// The mask of an image of `size` that the shapes in `text` describe. A pixel is hidden where any shape hides it.
///
/// ```
/// # use vergence_rig::mask_of_shapes;
/// # use vergence_vision::{ImageSize, Pixel};
/// let text = "
///     [[shape]] # the image circle
///     hides = \"outside\"
///     circle = [319.5, 319.5, 300.0]
///     [[shape]] # the robot's neck
///     hides = \"inside\"
///     polygon = [[250, 640], [300, 500], [340, 500], [390, 640]]
/// ";
/// let mask = mask_of_shapes(text, ImageSize { width: 640, height: 640 })?;
/// assert!(mask.hides(Pixel { u: 2.0, v: 2.0 }) && mask.hides(Pixel { u: 320.0, v: 550.0 }));
/// assert!(!mask.hides(Pixel { u: 320.0, v: 320.0 }));
/// # Ok::<(), vergence_rig::MaskError>(())
/// ```
///
/// # Errors
/// [`MaskError`] for a text that is no TOML, a shape that is none or hides nothing of the image, and shapes that hide all of it.
pub fn mask_of_shapes(text: &str, size: ImageSize) -> Result<BodyMask, MaskError> {
    let file: MaskFile = toml::from_str(text).map_err(|error| MaskError::Syntax(error.to_string()))?;
    mask_of(&file.shape, size)
}

/// The mask of an image of `size` in which these shapes hide parts.
///
/// # Errors
/// [`MaskError`] for a shape that is none or hides nothing of the image, and shapes that hide all of it.
pub fn mask_of(shapes: &[MaskShape], size: ImageSize) -> Result<BodyMask, MaskError> {
    let width = size.width as usize;
    let mut hidden = vec![false; width * size.height as usize];
    for (number, shape) in (1..).zip(shapes) {
        let fail = |why: String| MaskError::Shape { number, why };
        let area = shape.area().map_err(fail)?;
        let mut hides_any = false;
        for (row, pixels) in hidden.chunks_mut(width.max(1)).enumerate() {
            let borders = area.borders(row as f64);
            for (column, pixel) in pixels.iter_mut().enumerate() {
                let is_inside = borders.partition_point(|border| *border <= column as f64) % 2 == 1;
                let hides = is_inside == (shape.hides == Part::Inside);
                hides_any |= hides;
                *pixel |= hides;
            }
        }
        if !hides_any {
            let ImageSize { width, height } = size;
            return Err(fail(format!(
                "it hides no pixel of an image of {width} x {height}: give its numbers in pixels of this camera, (0, 0) at the top left"
            )));
        }
    }
    if hidden.iter().all(|&hidden| hidden) {
        return Err(MaskError::HidesAll);
    }
    BodyMask::new(size, hidden).ok_or(MaskError::HidesAll)
}

/// A shape after its checks.
enum Area<'a> {
    Polygon(&'a [[f64; 2]]),
    Circle([f64; 3]),
}

impl MaskShape {
    fn area(&self) -> Result<Area<'_>, String> {
        match (&self.polygon, self.circle) {
            (Some(corners), None) => check_polygon(corners).map(|()| Area::Polygon(corners)),
            (None, Some(circle)) => check_circle(circle).map(|()| Area::Circle(circle)),
            _ => Err("it needs a polygon or a circle, and not both".into()),
        }
    }
}

impl Area<'_> {
    /// The columns at which a row enters and leaves the area, in order.
    fn borders(&self, row: f64) -> Vec<f64> {
        match self {
            Self::Circle([u, v, radius]) => {
                let half = (radius * radius - (row - v).powi(2)).sqrt();
                // Not a number where the row misses the circle.
                if half >= 0.0 { vec![u - half, u + half] } else { Vec::new() }
            }
            Self::Polygon(corners) => {
                let crossing = |[[au, av], [bu, bv]]: [[f64; 2]; 2]| {
                    ((av > row) != (bv > row)).then(|| au + (row - av) / (bv - av) * (bu - au))
                };
                let mut borders: Vec<f64> = edges(corners).filter_map(crossing).collect();
                borders.sort_by(f64::total_cmp);
                borders
            }
        }
    }
}

/// The sides of a polygon, each from a corner to the next.
fn edges(corners: &[[f64; 2]]) -> impl Iterator<Item = [[f64; 2]; 2]> {
    let next = corners.iter().cycle().skip(1);
    corners.iter().zip(next).map(|(from, to)| [*from, *to])
}

fn check_circle([u, v, radius]: [f64; 3]) -> Result<(), String> {
    if ![u, v, radius].iter().all(|number| number.is_finite()) {
        return Err("a number of its circle is not finite".into());
    }
    if radius <= 0.0 {
        return Err(format!("a circle [u, v, radius] needs a positive radius, not {radius}"));
    }
    Ok(())
}

/// A polygon has an inside where its sides do not meet but at their ends.
fn check_polygon(corners: &[[f64; 2]]) -> Result<(), String> {
    if corners.len() < 3 {
        return Err(format!("a polygon needs 3 corners or more, not {}", corners.len()));
    }
    if !corners.iter().flatten().all(|number| number.is_finite()) {
        return Err("a number of its polygon is not finite".into());
    }
    let sides: Vec<_> = edges(corners).collect();
    let told = |[u, v]: [f64; 2]| format!("[{u}, {v}]");
    if let Some([corner, _]) = sides.iter().find(|[from, to]| from.map(f64::to_bits) == to.map(f64::to_bits)) {
        return Err(format!("its corner {} is given twice in a row", told(*corner)));
    }
    for (index, &[from, to]) in sides.iter().enumerate() {
        let [_, after] = sides[(index + 1) % sides.len()];
        if turn(from, to, after) == 0.0 && along(to, from, after) > 0.0 {
            return Err(format!("its sides turn back on themselves at the corner {}", told(to)));
        }
        let is_first = index == 0;
        // Neighbours share a corner; the last side is a neighbour of the first.
        let others = sides.iter().skip(index + 2).take((sides.len() - usize::from(is_first)).saturating_sub(index + 2));
        if let Some(other) = others.copied().find(|other| meet([from, to], *other)) {
            return Err(format!(
                "its sides from {} and from {} meet: give the corners in order around it",
                told(from),
                told(other[0])
            ));
        }
    }
    Ok(())
}

/// Twice the area of a triangle, positive where it turns from u to v.
fn turn([au, av]: [f64; 2], [bu, bv]: [f64; 2], [cu, cv]: [f64; 2]) -> f64 {
    (bu - au) * (cv - av) - (bv - av) * (cu - au)
}

/// The product of the ways from a corner to two others along each other.
fn along([au, av]: [f64; 2], [bu, bv]: [f64; 2], [cu, cv]: [f64; 2]) -> f64 {
    (bu - au) * (cu - au) + (bv - av) * (cv - av)
}

/// Whether two sides have a point in common.
fn meet([a, b]: [[f64; 2]; 2], [c, d]: [[f64; 2]; 2]) -> bool {
    let lies_between = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| turn(a, b, c) == 0.0 && along(c, a, b) <= 0.0;
    let crosses = turn(a, b, c) * turn(a, b, d) < 0.0 && turn(c, d, a) * turn(c, d, b) < 0.0;
    crosses || lies_between(a, b, c) || lies_between(a, b, d) || lies_between(c, d, a) || lies_between(c, d, b)
}

#[cfg(test)]
mod tests {
    use vergence_vision::Pixel;

    use super::*;

    const SIZE: ImageSize = ImageSize { width: 40, height: 30 };

    fn of(shapes: &str) -> Result<BodyMask, MaskError> {
        mask_of_shapes(shapes, SIZE)
    }

    fn polygon(corners: &str) -> String {
        format!("[[shape]]\nhides = \"inside\"\npolygon = {corners}\n")
    }

    /// The hidden pixels of a concave polygon, against the definition: an odd number of its sides lies left of each.
    #[test]
    fn a_pixel_is_hidden_where_its_centre_lies_inside() {
        let mask = of(&polygon("[[2, 2], [30.5, 2], [30.5, 25], [20, 10], [5, 26]]")).expect("a mask");
        let hidden = |u: f64, v: f64| mask.hides(Pixel { u, v });
        assert!(hidden(3.0, 3.0) && hidden(30.0, 20.0) && hidden(6.0, 22.0));
        assert!(!hidden(1.0, 3.0) && !hidden(31.0, 20.0) && !hidden(20.0, 15.0), "the notch is no part of it");
        let (outside, inside) = ("outside", "inside");
        let circle = |hides: &str| format!("[[shape]]\nhides = \"{hides}\"\ncircle = [20.0, 15, 10.0]\n");
        let (around, disc) = (of(&circle(outside)).expect("a mask"), of(&circle(inside)).expect("a mask"));
        for (u, v) in (0..40).flat_map(|u| (0..30).map(move |v| (f64::from(u), f64::from(v)))) {
            let at = Pixel { u, v };
            assert!(around.hides(at) != disc.hides(at), "{u} {v}");
            let far = (u - 20.0).hypot(v - 15.0);
            assert!((far - 10.0).abs() < 1e-9 || disc.hides(at) == (far < 10.0), "{u} {v}");
        }
        let both = of(&(circle(outside) + &polygon("[[15, 10], [25, 10], [25, 20], [15, 20]]"))).expect("a mask");
        assert!(both.hides(Pixel { u: 0.0, v: 0.0 }) && both.hides(Pixel { u: 20.0, v: 15.0 }));
        assert!(!both.hides(Pixel { u: 20.0, v: 7.0 }), "inside the circle, outside the polygon");
    }

    #[test]
    fn a_bad_shape_is_told_by_its_number() {
        let good = "[[shape]]\nhides = \"inside\"\ncircle = [3, 3, 2]\n";
        for (shape, words) in [
            (polygon("[[2, 2], [30, 2]]"), "3 corners"),
            (polygon("[[2, 2], [30, nan], [5, 5]]"), "not finite"),
            (polygon("[[2, 2], [30, 20], [30, 2], [2, 20]]"), "meet"),
            (polygon("[[2, 2], [30, 2], [30, 20], [10, 2], [2, 20]]"), "meet"),
            (polygon("[[2, 2], [30, 2], [30, 2], [2, 20]]"), "twice"),
            (polygon("[[2, 2], [30, 2], [10, 2]]"), "turn back"),
            (polygon("[[50, 2], [70, 2], [60, 20]]"), "hides no pixel of an image of 40 x 30"),
            ("[[shape]]\nhides = \"inside\"\ncircle = [3, 3, 0]\n".into(), "positive radius"),
            ("[[shape]]\nhides = \"inside\"\ncircle = [3, inf, 1]\n".into(), "not finite"),
            ("[[shape]]\nhides = \"outside\"\ncircle = [20, 15, 100]\n".into(), "hides no pixel"),
            ("[[shape]]\nhides = \"inside\"\n".into(), "polygon or a circle"),
        ] {
            let error = of(&(good.to_owned() + &shape)).expect_err("a bad shape").to_string();
            assert!(error.contains("shape 2: ") && error.contains(words), "{shape} was told: {error}");
        }
        assert_eq!(of("[[shape]]\nhides = \"inside\"\ncircle = [20, 15, 100]\n"), Err(MaskError::HidesAll));
        for text in
            ["shape = 3", "", "[[shape]]\nhides = \"left\"\ncircle = [3, 3, 2]", "[[shape]]\ncircle = [3, 3, 2]"]
        {
            assert!(matches!(of(text), Err(MaskError::Syntax(_))), "{text}");
        }
    }
}
