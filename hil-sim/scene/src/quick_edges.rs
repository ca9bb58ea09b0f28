//! Further rays of images in real time, where pixels show more than one thing.

use multiversion::multiversion;

use crate::lens::LensRays;
use crate::optics::unit_pair;
use crate::quick::{BAND, RayTable, TILE};
use crate::quick_bundle::QuickBundle;
use crate::quick_canvas::Canvas;
use crate::quick_eye::Eye;
use crate::render::View;
use crate::sight::Sight;
use crate::texture::Rgb;
use crate::texture_noise::mix64;
use crate::trace::NOTHING;

/// Further rays of a pixel at an edge between surfaces, and at one within a surface: those of prints are measured.
const EDGE_RAYS: [u32; 2] = [6, 16];

/// Difference of the square roots of the light of neighbours above which more rays are cast.
const EDGE: f32 = 0.4;

/// Marks of a pixel that shows another surface than a neighbour, and of one whose light differs much from a neighbour's of the same surface,
/// which its rays then must see for themselves.
const BETWEEN: u8 = 1;
const WITHIN: u8 = 2;

/// A pixel with more rays.
struct Edge {
    place: [usize; 2],
    /// The surfaces that it and its neighbours left, right, above and below show, if its rays may take their light from there.
    surfaces: [u32; 5],
    /// The light of these.
    lights: [Rgb; 5],
    /// The light of its rays so far, and their number.
    sum: Rgb,
    count: f32,
}

impl Edge {
    fn new(canvas: &Canvas, [x, y]: [usize; 2], is_within: bool, rays: u32) -> Self {
        let [last_row, last] = [canvas.height() - 1, canvas.width() - 1];
        let [above, below, left, right] =
            [y.saturating_sub(1), (y + 1).min(last_row), x.saturating_sub(1), (x + 1).min(last)];
        let (mut surfaces, mut lights) = ([NOTHING; 5], [[0.0; 3]; 5]);
        for (number, [x, y]) in [[x, y], [left, y], [right, y], [x, above], [x, below]].into_iter().enumerate() {
            lights[number] = canvas.light_at([x, y]);
            surfaces[number] = if is_within { NOTHING } else { canvas.surfaces(y)[x] };
        }
        Self { place: [x, y], surfaces, lights, sum: lights[0], count: rays as f32 + 1.0 }
    }

    /// The light of a surface, where it is known.
    fn light_of(&self, surface: u32) -> Option<Rgb> {
        let shown = self.surfaces.iter().position(|shown| *shown == surface && surface != NOTHING)?;
        Some(self.lights[shown])
    }

    fn add(&mut self, [red, green, blue]: Rgb) {
        self.sum = [self.sum[0] + red, self.sum[1] + green, self.sum[2] + blue];
    }

    fn mean(&self) -> Rgb {
        [self.sum[0] / self.count, self.sum[1] / self.count, self.sum[2] / self.count]
    }
}

/// The places and the light of those pixels of some rows that show something else than one beside, above or below them. `eyes` are of these
/// rows, the first of which is row `top`.
pub fn edge_lights(
    (view, table, lens, seed): (&View<'_>, &RayTable, &LensRays<'_>, u64),
    sight: &Sight,
    bundle: &mut QuickBundle,
    (canvas, top, eyes): (&Canvas, usize, &[Eye]),
) -> Vec<([usize; 2], Rgb)> {
    let width = table.size.width as usize;
    let mut edges = Vec::new();
    let marks: Vec<Vec<u8>> = (top..top + eyes.len()).map(|y| marks(canvas, y)).collect();
    for [x, y] in marked(&marks).filter(|&[x, y]| table.is_seen(x, top + y)) {
        let (is_within, at) = (marks[y][x] & WITHIN != 0, (top + y) * width + x);
        let (rays, origin) = (EDGE_RAYS[usize::from(is_within)], eyes[y].pupil(table.pupils[at]));
        // A ray outside the field brings no light.
        table.rays_at(lens, &eyes[y], [x, top + y], lattice(rays, mix64(seed ^ at as u64)), |ray| {
            bundle.push(edges.len(), origin, ray, table.pitches[at]);
        });
        edges.push(Edge::new(canvas, [x, top + y], is_within, rays));
    }
    bundle.follow(view.scene, sight, |edge, surface| edges[edge].light_of(surface).is_none());
    for block in bundle.blocks() {
        let ([red, green, blue], count) = (&block.lights, block.owners.len());
        for i in (0..count).filter(|&i| block.rays.counts[i]) {
            let edge = &mut edges[block.owners[i] as usize];
            edge.add(edge.light_of(block.surfaces[i]).unwrap_or([red[i], green[i], blue[i]]));
        }
    }
    bundle.clear();
    edges.iter().map(|edge| (edge.place, edge.mean())).collect()
}

/// `count` places on a pixel's square, as [`lattice`](crate::render::lattice) gives them, in single precision.
fn lattice(count: u32, hash: u64) -> impl Iterator<Item = [f32; 2]> {
    const GOLDEN: f32 = 0.618_034;
    let (step, (a, b)) = (1.0 / count as f32, unit_pair(hash));
    let wrapped = |part: f32| if part >= 1.0 { part - 1.0 } else { part };
    let next = move |at: &[f32; 2]| Some([wrapped(at[0] + step), wrapped(at[1] + GOLDEN)]);
    std::iter::successors(Some([a as f32, b as f32]), next).take(count as usize).map(|[u, v]| [u - 0.5, v - 0.5])
}

/// The places (x, y) of the marks of a band's rows, tile by tile.
fn marked(marks: &[Vec<u8>]) -> impl Iterator<Item = [usize; 2]> {
    let (columns, rows) = (marks.first().map_or(0, Vec::len), marks.len());
    let tops = (0..rows).step_by(TILE).flat_map(move |top| (0..columns).step_by(TILE).map(move |left| [left, top]));
    tops.flat_map(move |[left, top]| {
        let of_row = move |y: usize| {
            let part = &marks[y][left..(left + TILE).min(columns)];
            // Most rows of tiles have none.
            let part = if *part == [0; TILE] { &[] } else { part };
            part.iter().enumerate().filter(|(_, mark)| **mark != 0).map(move |(i, _)| [left + i, y])
        };
        (top..(top + TILE).min(rows)).flat_map(of_row)
    })
}

impl RayTable {
    /// Calls `visit` for the rays through these places on a pixel, in pixels from its centre, in the world. Between neighbours they are taken
    /// to change evenly, which is wrong by less than a thousandth of a pixel.
    fn rays_at(
        &self,
        lens: &LensRays<'_>,
        eye: &Eye,
        [x, y]: [usize; 2],
        places: impl Iterator<Item = [f32; 2]>,
        mut visit: impl FnMut([f32; 3]),
    ) {
        let stride = self.size.width as usize + 2;
        let middle = (y + 1) * stride + x + 1;
        let ray = |at: usize| eye.in_world([self.rays[0][at], self.rays[1][at], self.rays[2][at]]);
        let slope = |before: usize, after: usize| {
            let (a, b) = (ray(before), ray(after));
            [0.5 * (b[0] - a[0]), 0.5 * (b[1] - a[1]), 0.5 * (b[2] - a[2])]
        };
        let (at, du, dv) = (ray(middle), slope(middle - 1, middle + 1), slope(middle - stride, middle + stride));
        let at_rim = du[0].is_nan() || dv[0].is_nan();
        if at_rim {
            let pixels: Vec<_> = places.map(|[u, v]| [x as f64 + f64::from(u), y as f64 + f64::from(v)]).collect();
            let exact = lens.directions(&pixels).into_iter().filter(|ray| !ray[2].is_nan());
            exact.for_each(|ray| visit(eye.in_world(ray.map(|component| component as f32))));
            return;
        }
        for [u, v] in places {
            let along = |axis: usize| at[axis] + du[axis] * u + dv[axis] * v;
            visit([along(0), along(1), along(2)]);
        }
    }
}

/// The marks of the pixels of a row.
fn marks(canvas: &Canvas, y: usize) -> Vec<u8> {
    let mut marks = vec![0; canvas.width()];
    for other in [y.saturating_sub(1), (y + 1).min(canvas.height() - 1)] {
        mark(&mut marks, canvas, [y, other], [0, 0]);
    }
    mark(&mut marks[1..], canvas, [y, y], [1, 0]);
    mark(&mut marks, canvas, [y, y], [0, 1]);
    marks
}

/// Marks the pixels of one row from column `from[0]` on, by those of another from column `from[1]` on.
fn mark(marks: &mut [u8], canvas: &Canvas, [here, other]: [usize; 2], from: [usize; 2]) {
    let surfaces = [&canvas.surfaces(here)[from[0]..], &canvas.surfaces(other)[from[1]..]];
    mark_many(marks, surfaces, [&canvas.levels(here)[from[0]..], &canvas.levels(other)[from[1]..]]);
}

/// Marks pixels by others, as far as there are any, by the instructions of this machine: the same on all.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
fn mark_many(marks: &mut [u8], surfaces: [&[u32]; 2], levels: [&[f32]; 2]) {
    let count = marks.len().min(surfaces[0].len()).min(surfaces[1].len());
    let (marks, [a, b]) = (&mut marks[..count], surfaces.map(|surfaces| &surfaces[..count]));
    let [low, high] = levels.map(|levels| &levels[..count]);
    for i in 0..count {
        let contrast = if (low[i] - high[i]).abs() > EDGE { WITHIN } else { 0 };
        marks[i] |= if a[i] == b[i] { contrast } else { BETWEEN };
    }
}

const _: () = assert!(BAND.is_multiple_of(TILE), "the tiles of a band are whole");
