//! Pictures of one printed sheet before an even grey, by a monochrome camera: quick, since nothing else is met.
//!
//! The same optics and sensor as of [`render`](crate::render). Rays are solved once for a small square of pixels and
//! developed to the second order about its middle; the rest of a ray's way is one division.

use std::ops::Range;

use image::{GrayImage, Luma};
use nalgebra::{Matrix3, SVector, Vector3};
use vergence_vision::{Angle, Camera, Length, Transform};

use crate::blur::spread;
use crate::lens::{Lens, LensRays};
use crate::optics::{normals, unit_pair};
use crate::packet::LANES;
use crate::render::lattice;
use crate::sheet_edges::{Board, lights};
use crate::target::{BACK, BACKDROP, BLACK, WHITE};
use crate::texture::Rgb;
use crate::texture_noise::mix64;
use crate::{Optics, Sheet, Target};

/// Pixels along a side of the squares whose rays are developed together. Beyond the second order a ray changes there by
/// less than (2 / pixels per radian)³.
const CELL: u32 = 4;

/// A sheet before a camera.
#[derive(Clone, Copy, Debug)]
pub struct SheetView<'a> {
    /// What is printed.
    pub sheet: Sheet,
    /// Pose of the sheet.
    pub camera_from_sheet: Transform<Camera, Target>,
    /// The lens, and the size of the image.
    pub camera: &'a dyn Lens,
    /// Imperfections of its lens and sensor. Of the rays of a pixel, `samples` counts as 1: only edges take more.
    pub optics: &'a Optics,
}

/// A picture of the sheet: 8-bit grey levels of the sRGB curve, black outside the field. `seed` drives the noise and the
/// choice of rays.
#[must_use]
pub fn photograph_sheet(view: &SheetView<'_>, seed: u64) -> GrayImage {
    let size = view.camera.size();
    let plane = Plane::of(view);
    let cells = Cells::of(view, &plane);
    let width = size.width as usize;
    let tones: Vec<Tone> =
        (0..size.height).flat_map(|y| (0..size.width).map(move |x| [x, y])).map(|at| cells.tone(&plane, at)).collect();
    let places: Vec<[f64; 2]> = Lattice::places(view.optics.edge_samples);
    let mut light: Vec<[f32; 1]> = tones.iter().map(|tone| [tone.light * tone.exposure]).collect();
    for index in edges(&tones, width) {
        let tone = tones[index];
        if tone.exposure > 0.0 {
            let lattice = Lattice { places: &places, hash: mix64(mix64(seed) ^ index as u64) };
            let sum = cells.sum(&plane, [index % width, index / width].map(|at| at as u32), &lattice);
            light[index] = [(sum + tone.light) / (places.len() + 1) as f32 * tone.exposure];
        }
    }
    let spots: Vec<f32> = tones.iter().map(|tone| tone.spot).collect();
    let light = spread(&light, width, view.optics.blur_px, &spots);
    let mut picture = GrayImage::new(size.width, size.height);
    let pairs = picture.pixels_mut().zip(light.iter().zip(&tones));
    let mut noise = [0.0; 2];
    for (index, (Luma([level]), ([light], tone))) in pairs.enumerate() {
        // One hash makes the noise of two pixels.
        if index % 2 == 0 {
            noise = normals(mix64(mix64(!seed) ^ index as u64));
        }
        if tone.exposure > 0.0 {
            *level = view.optics.level(f64::from(*light), noise[index % 2]);
        }
    }
    picture
}

/// The luminance of linear light by the primaries of sRGB (IEC 61966-2-1).
fn luminance([red, green, blue]: Rgb) -> f32 {
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}

/// What the ray through the centre of a pixel meets; no exposure outside the field.
#[derive(Clone, Copy)]
struct Tone {
    light: f32,
    exposure: f32,
    spot: f32,
}

/// The pixels that meet something else than one of their eight neighbours, in rising order.
fn edges(tones: &[Tone], width: usize) -> impl Iterator<Item = usize> {
    let met: Vec<u32> = tones.iter().map(|tone| tone.light.to_bits()).collect();
    let mut is_edge = vec![false; met.len()];
    let mut compare = |pixels: Range<usize>, neighbours: Range<usize>| {
        for (i, j) in pixels.zip(neighbours) {
            let differs = met[i] != met[j];
            is_edge[i] |= differs;
            is_edge[j] |= differs;
        }
    };
    for row in (0..met.len()).step_by(width.max(1)) {
        let below = row + width;
        compare(row..below - 1, row + 1..below);
        if below < met.len() {
            compare(row..below, below..below + width);
            compare(row..below - 1, below + 1..below + width);
            compare(row + 1..below, below..below + width - 1);
        }
    }
    is_edge.into_iter().enumerate().filter_map(|(index, is_edge)| is_edge.then_some(index))
}

/// The sheet as rays in its own frame meet it.
struct Plane {
    sheet: Sheet,
    half: [f64; 2],
    middle: [f64; 2],
    sheet_from_camera: Matrix3<f64>,
    camera_at: Vector3<f64>,
    /// Where it is a chessboard.
    board: Option<Board>,
}

impl Plane {
    fn of(view: &SheetView<'_>) -> Self {
        let sheet_from_camera = view.camera_from_sheet.inverse();
        let (centre, camera_at) = (view.sheet.centre().mm(), sheet_from_camera.origin().mm());
        let (middle, half) = ([centre.x, centre.y], view.sheet.size().map(|side| 0.5 * side.mm()));
        let sheet_from_camera = sheet_from_camera.rotation().to_rotation_matrix().into_inner();
        let board = match view.sheet {
            Sheet::Checkerboard(target) => Some(Board {
                target,
                half,
                middle,
                from: [camera_at, sheet_from_camera.column(2).into()],
                lights: [BACKDROP, BACK, BLACK, WHITE].map(luminance),
            }),
            Sheet::Tags(_) | Sheet::Markers(_) => None,
        };
        Self { sheet: view.sheet, half, middle, sheet_from_camera, camera_at, board }
    }

    /// The light that comes along a ray, `ray` in the frame of the sheet, from the pupil at `shift_mm` on the axis.
    fn light(&self, ray: [f64; 3], shift_mm: f64) -> f32 {
        let from = self.camera_at + self.sheet_from_camera.column(2) * shift_mm;
        let range = -from.z / ray[2];
        let [x, y] = [from.x + range * ray[0] - self.middle[0], from.y + range * ray[1] - self.middle[1]];
        // A ray within the plane divides by zero; it fails this test, infinite or not a number.
        let met = range > 0.0 && x.abs() <= self.half[0] && y.abs() <= self.half[1];
        luminance(if met { self.sheet.ink([x, y], ray[2] < 0.0) } else { BACKDROP })
    }
}

/// Ray in the frame of the sheet, shift of the pupil, exposure, variance of the spot.
type Node = SVector<f64, 6>;

/// The middles of the squares of pixels, with those around the image.
struct Cells<'a> {
    view: SheetView<'a>,
    lens: LensRays<'a>,
    across: usize,
    squares: Vec<Square>,
}

/// What is known of a square of pixels.
#[allow(clippy::large_enum_variant, reason = "most squares lie inside")]
enum Square {
    /// Value and derivatives per pixel (u, v, uu, uv, vv) at its middle.
    Inside([Node; 6]),
    /// Each pixel is asked for.
    Rim,
    /// Of the field.
    Outside,
}

impl<'a> Cells<'a> {
    fn of(view: &SheetView<'a>, plane: &Plane) -> Self {
        let size = view.camera.size();
        let [across, down] = [size.width, size.height].map(|pixels| pixels.div_ceil(CELL) as usize);
        let middle = |index: usize| f64::from(CELL) * (index as f64 - 1.0) + 0.5 * f64::from(CELL - 1);
        let pixels: Vec<[f64; 2]> =
            (0..down + 2).flat_map(|row| (0..across + 2).map(move |column| [middle(column), middle(row)])).collect();
        let lens = view.camera.rays();
        let nodes: Vec<Node> = lens.kept_directions(&pixels).iter().map(|ray| node(view, plane, ray)).collect();
        let squares = (0..down)
            .flat_map(|row| (0..across).map(move |column| [row + 1, column + 1]))
            .map(|[row, column]| square(&nodes, across + 2, row, column))
            .collect();
        Self { view: *view, lens, across, squares }
    }

    /// The ray through a place `offset` pixels from the centre of a pixel; `None` outside the field.
    fn at(&self, plane: &Plane, [x, y]: [u32; 2], offset: [f64; 2]) -> Option<Node> {
        let index = (y / CELL) as usize * self.across + (x / CELL) as usize;
        let [value, du, dv, duu, duv, dvv] = match &self.squares[index] {
            Square::Inside(series) => series,
            Square::Outside => return None,
            Square::Rim => {
                let exact = self.lens.directions(&[[f64::from(x) + offset[0], f64::from(y) + offset[1]]]);
                return exact.first().map(|ray| node(&self.view, plane, ray)).filter(|node| !node.z.is_nan());
            }
        };
        let from_middle = |pixel: u32, offset: f64| f64::from(pixel % CELL) - 0.5 * f64::from(CELL - 1) + offset;
        let (u, v) = (from_middle(x, offset[0]), from_middle(y, offset[1]));
        Some(value + du * u + dv * v + duu * (0.5 * u * u) + duv * (u * v) + dvv * (0.5 * v * v))
    }

    fn tone(&self, plane: &Plane, at: [u32; 2]) -> Tone {
        self.at(plane, at, [0.0; 2]).map_or(Tone { light: 0.0, exposure: 0.0, spot: 0.0 }, |node| Tone {
            light: plane.light([node[0], node[1], node[2]], node[3]),
            exposure: node[4] as f32,
            spot: node[5] as f32,
        })
    }

    /// The sum of the light of some rays through a pixel.
    fn sum(&self, plane: &Plane, at: [u32; 2], lattice: &Lattice<'_>) -> f32 {
        let index = (at[1] / CELL) as usize * self.across + (at[0] / CELL) as usize;
        let (Some(board), Square::Inside(series)) = (&plane.board, &self.squares[index]) else {
            return lattice.offsets().map(|offset| self.light(plane, at, offset)).sum();
        };
        let series = series.map(|node| [node[0], node[1], node[2], node[3]]);
        let [left, top] = at.map(|pixel| f64::from(pixel % CELL) - 0.5 * f64::from(CELL - 1));
        let (mut sum, mut count, mut places) = (0.0, 0, [[0.0; LANES]; 2]);
        for [u, v] in lattice.offsets() {
            (places[0][count], places[1][count]) = (left + u, top + v);
            count += 1;
            if count == LANES {
                sum = lights(board, &series, &places).iter().fold(sum, |sum, light| sum + light);
                count = 0;
            }
        }
        lights(board, &series, &places).iter().take(count).fold(sum, |sum, light| sum + light)
    }

    /// The light of one ray through a pixel; none comes from outside the field.
    fn light(&self, plane: &Plane, at: [u32; 2], offset: [f64; 2]) -> f32 {
        self.at(plane, at, offset).map_or(0.0, |node| plane.light([node[0], node[1], node[2]], node[3]))
    }
}

fn node(view: &SheetView<'_>, plane: &Plane, ray: &[f64; 3]) -> Node {
    let theta = Angle::from_rad(ray[2].clamp(-1.0, 1.0).acos());
    let [x, y, z] = <[f64; 3]>::from(plane.sheet_from_camera * Vector3::from(*ray));
    let pupil_mm = view.camera.pupil(theta).map_or(0.0, Length::mm);
    Node::from([x, y, z, pupil_mm, view.optics.light_at(theta, view.camera), view.camera.spot_variance(theta)])
}

/// The field has no corners: it reaches into no square whose own middle and all those around lie outside.
fn square(nodes: &[Node], stride: usize, row: usize, column: usize) -> Square {
    let middles: [[Node; 3]; 3] =
        std::array::from_fn(|down| std::array::from_fn(|right| nodes[(row + down - 1) * stride + column + right - 1]));
    if middles.as_flattened().iter().all(|node| node.z.is_nan()) {
        return Square::Outside;
    }
    series(&middles).map_or(Square::Rim, Square::Inside)
}

/// `None` where a middle lies outside the field.
fn series(middles: &[[Node; 3]; 3]) -> Option<[Node; 6]> {
    let step = f64::from(CELL);
    let near = |down: usize, right: usize| Some(middles[down][right]).filter(|node| !node.z.is_nan());
    let here = near(1, 1)?;
    let (west, east, north, south) = (near(1, 0)?, near(1, 2)?, near(0, 1)?, near(2, 1)?);
    let twist = near(2, 2)? - near(2, 0)? - near(0, 2)? + near(0, 0)?;
    let slope = |from: Node, to: Node| (to - from) / (2.0 * step);
    let bend = |from: Node, to: Node| (from + to - here * 2.0) / (step * step);
    Some([
        here,
        slope(west, east),
        slope(north, south),
        bend(west, east),
        twist / (4.0 * step * step),
        bend(north, south),
    ])
}

/// Places on a pixel's square as in [`render`](crate::render), turned about it by the hash.
struct Lattice<'a> {
    places: &'a [[f64; 2]],
    hash: u64,
}

impl Lattice<'_> {
    fn places(count: u32) -> Vec<[f64; 2]> {
        lattice(count, 0).map(|[u, v]| [u + 0.5, v + 0.5]).collect()
    }

    fn offsets(&self) -> impl Iterator<Item = [f64; 2]> {
        let (a, b) = unit_pair(self.hash);
        let within = |place: f64| if place < 1.0 { place - 0.5 } else { place - 1.5 };
        self.places.iter().map(move |[u, v]| [within(u + a), within(v + b)])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_are_pixels_that_differ_from_a_neighbour() {
        for (width, height) in [(0, 0), (1, 1), (1, 5), (7, 1), (9, 6)] {
            let light = |index: usize| if mix64(index as u64).is_multiple_of(5) { 1.0_f32 } else { 0.0 };
            let tones: Vec<Tone> =
                (0..width * height).map(|index| Tone { light: light(index), exposure: 1.0, spot: 0.0 }).collect();
            let near = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
            let differs = |index: &usize| {
                let (x, y) = (index % width, index / width);
                let around = near(y, height).flat_map(|y| near(x, width).map(move |x| y * width + x));
                around.clone().any(|other| light(other).to_bits() != light(*index).to_bits())
            };
            let expected: Vec<usize> = (0..tones.len()).filter(differs).collect();
            assert_eq!(edges(&tones, width).collect::<Vec<_>>(), expected, "{width} x {height}");
        }
    }
}
