//! Reads the code of a tag inside a dark quad.

use nalgebra::{Matrix3, SMatrix, SVector, Vector2, Vector3};

use super::quads::Quad;
use super::{ReadCode, TagFamily};
use crate::detect::intensity::Intensity;

/// Where in a quad its tag is.
#[derive(Clone, Copy, Debug)]
pub struct TagPlace {
    /// Width of the black border in cells.
    pub border: u32,
    /// White around the tag as a part of the quad's side.
    pub margin: f64,
}

/// Where the inside of a quad lies in the image: the homography of its corners, moved by the bows of its edges.
struct Inside<'a> {
    quad: &'a Quad,
    homography: Matrix3<f64>,
}

impl<'a> Inside<'a> {
    fn of(quad: &'a Quad) -> Option<Self> {
        const PLACES: [[f64; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let (mut rows, mut right) = (SMatrix::<f64, 8, 8>::zeros(), SVector::<f64, 8>::zeros());
        for (index, ([x, y], at)) in PLACES.into_iter().zip(quad.corners).enumerate() {
            let above = [x, y, 1.0, 0.0, 0.0, 0.0, -at.x * x, -at.x * y];
            let below = [0.0, 0.0, 0.0, x, y, 1.0, -at.y * x, -at.y * y];
            rows.set_row(2 * index, &SVector::from(above).transpose());
            rows.set_row(2 * index + 1, &SVector::from(below).transpose());
            (right[2 * index], right[2 * index + 1]) = (at.x, at.y);
        }
        let h = rows.lu().solve(&right)?;
        let homography = Matrix3::new(h[0], h[1], h[2], h[3], h[4], h[5], h[6], h[7], 1.0);
        Some(Self { quad, homography })
    }

    /// The place in the image of (x, y), which are 0 to 1 from the first corner to the second and to the fourth.
    fn at(&self, x: f64, y: f64) -> Vector2<f64> {
        let place = self.homography * Vector3::new(x, y, 1.0);
        let arch = |part: f64| 4.0 * part * (1.0 - part);
        let [top, right, bottom, left] = self.quad.bows;
        place.xy() / place.z + (top * (1.0 - y) + bottom * y) * arch(x) + (left * (1.0 - x) + right * x) * arch(y)
    }
}

/// The tag in `quad` with a number below `most`. Its own upper left corner is that corner of the quad whose index is the number
/// of quarters.
pub fn read_tag(
    image: &Intensity<'_>,
    quad: &Quad,
    family: &TagFamily,
    place: TagPlace,
    most: u32,
) -> Option<ReadCode> {
    let inside = Inside::of(quad)?;
    let code = Cells { inside: &inside, across: family.side + 2 * place.border, place }.code(image)?;
    family.read(code, most)
}

/// The cells of a tag in a quad, its border included.
struct Cells<'a> {
    inside: &'a Inside<'a>,
    across: u32,
    place: TagPlace,
}

impl Cells<'_> {
    /// Side of the tag as a part of the quad's.
    fn part(&self) -> f64 {
        1.0 - 2.0 * self.place.margin
    }

    /// The code, without the border; `None` where the border is not black.
    fn code(&self, image: &Intensity<'_>) -> Option<u64> {
        const LEAST_SIDE_PX: f64 = 1.5;
        let side = self.inside.quad.corners.iter().zip(self.inside.quad.corners.iter().cycle().skip(1));
        let shortest = side.map(|(a, b)| (a - b).norm()).fold(f64::INFINITY, f64::min);
        if shortest * self.part() < LEAST_SIDE_PX * f64::from(self.across) {
            return None;
        }
        let cells = (0..self.across).flat_map(|row| (0..self.across).map(move |column| (column, row)));
        let inner = self.place.border..self.across - self.place.border;
        let (mut border, mut code) = (Vec::new(), Vec::new());
        for (column, row) in cells {
            let level = self.level(image, column, row)?;
            if inner.contains(&column) && inner.contains(&row) { code.push(level) } else { border.push(level) }
        }
        let black = border.iter().sum::<f64>() / border.len() as f64;
        let white = code.iter().fold(0.0, |most: f64, level| most.max(*level));
        // A square that is black inside, too, is no tag.
        if white - black < 0.5 * self.inside.quad.contrast {
            return None;
        }
        let parting = 0.5 * (black + white);
        let wrong = border.iter().filter(|level| **level > parting).count();
        // A stain or a glint may brighten some of the border.
        if 10 * wrong > border.len() {
            return None;
        }
        Some(code.iter().fold(0, |bits, level| bits << 1 | u64::from(*level > parting)))
    }

    /// Mean grey level in the middle of a cell.
    fn level(&self, image: &Intensity<'_>, column: u32, row: u32) -> Option<f64> {
        const ASIDE: [f64; 3] = [0.3, 0.5, 0.7];
        let place =
            |cell: u32, part: f64| self.place.margin + self.part() * (f64::from(cell) + part) / f64::from(self.across);
        let mut sum = 0.0;
        for x in ASIDE {
            for y in ASIDE {
                sum += image.between(self.inside.at(place(column, x), place(row, y)))?;
            }
        }
        Some(sum / 9.0)
    }
}
