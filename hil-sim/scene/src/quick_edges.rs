//! Further rays of images in real time, where pixels show more than one thing.

use std::ops::Range;

use multiversion::multiversion;

use crate::optics::unit_pair;
use crate::packet::Singles;
use crate::quick::{BAND, RayTable, TILE};
use crate::quick_bundle::{MOST_OF_PIXEL, QuickBundle};
use crate::quick_canvas::Canvas;
use crate::quick_eye::Eye;
use crate::render::View;
use crate::sight::Sight;
use crate::texture::Rgb;
use crate::texture_noise::mix64;
use crate::trace::NOTHING;

/// Further rays of a pixel at an edge between surfaces, and at one within a surface: those of prints are measured.
const EDGE_RAYS: [usize; 2] = [6, MOST_OF_PIXEL];

/// Difference of the square roots of the light of neighbours above which more rays are cast.
const EDGE: f32 = 0.4;

/// Marks of a pixel that shows another surface than a neighbour, and of one whose light differs much from a neighbour's of the same surface,
/// which its rays then must see for themselves.
const BETWEEN: u8 = 1;
const WITHIN: u8 = 2;

/// A pixel with more rays.
struct Edge {
    /// The numbers of this pixel and of those left, right, above and below.
    pixels: [usize; 5],
    /// The surfaces that these show, if its rays may take their light from there.
    surfaces: [u32; 5],
    /// Its rays in the bundle.
    rays: Range<usize>,
    /// Number of rays that were wanted, with the one through its centre.
    count: f32,
}

impl Edge {
    fn new(canvas: &Canvas, [x, y]: [usize; 2], is_within: bool, rays: Range<usize>) -> Self {
        let (width, at) = (canvas.width(), y * canvas.width() + x);
        let left_right = [if x > 0 { at - 1 } else { at }, if x + 1 < width { at + 1 } else { at }];
        let above_below = [if y > 0 { at - width } else { at }, if y + 1 < canvas.height() { at + width } else { at }];
        let pixels = [at, left_right[0], left_right[1], above_below[0], above_below[1]];
        let surfaces = if is_within { [NOTHING; 5] } else { pixels.map(|pixel| canvas.surface_at(pixel)) };
        Self { pixels, surfaces, rays, count: EDGE_RAYS[usize::from(is_within)] as f32 + 1.0 }
    }

    /// The light of a surface, where it is known; not of [`NOTHING`].
    #[inline(always)]
    fn light_of(&self, surface: u32, canvas: &Canvas) -> Option<Rgb> {
        let mut shown = self.pixels.len();
        for (number, other) in self.surfaces.iter().enumerate().rev() {
            shown = if *other == surface { number } else { shown };
        }
        self.pixels.get(shown).map(|pixel| canvas.light_at(*pixel))
    }

    /// The pixel, and the mean light of its rays.
    fn light(&self, canvas: &Canvas, bundle: &QuickBundle) -> (usize, Rgb) {
        let add = |[red, green, blue]: Rgb, more: Rgb| [red + more[0], green + more[1], blue + more[2]];
        let sum = self.rays.clone().map(|ray| bundle.light(ray)).fold(canvas.light_at(self.pixels[0]), add);
        (self.pixels[0], sum.map(|channel| channel / self.count))
    }
}

/// Some rows whose edges are sought: what is here is used again for other rows.
#[derive(Default)]
pub struct EdgeRows {
    /// Of the pixels, row by row.
    marks: Vec<u8>,
    /// The square roots of the means of the colours of the pixels, from one row above to one row below.
    levels: Vec<f32>,
    edges: Vec<Edge>,
    bundle: QuickBundle,
}

impl EdgeRows {
    /// The numbers and the light of those pixels of some rows that show something else than one beside, above or below them. `eyes` are of these
    /// rows, the first of which is row `top`.
    pub fn lights(
        &mut self,
        (view, table, seed): (&View<'_>, &RayTable, u64),
        sight: &Sight,
        (canvas, top, eyes): (&Canvas, usize, &[Eye]),
    ) -> Vec<(usize, Rgb)> {
        self.mark(canvas, top, eyes.len());
        let (width, Self { marks, edges, bundle, .. }) = (canvas.width(), self);
        for ([x, y], mark) in marked(marks, width).filter(|([x, y], _)| table.is_seen(*x, top + y)) {
            let (is_within, at) = (mark & WITHIN != 0, (top + y) * width + x);
            let (count, origin) = (EDGE_RAYS[usize::from(is_within)], eyes[y].pupil(table.pupils[at]));
            // A ray outside the field brings no light.
            let (rays, count) =
                table.rays_at(&eyes[y], [x, top + y], (&lattice(count, mix64(seed ^ at as u64)), count));
            let first = bundle.push(edges.len(), origin, (&rays, count), table.pitches[at]);
            edges.push(Edge::new(canvas, [x, top + y], is_within, first..first + count));
        }
        bundle.follow(view.scene, sight, |edge, surface| edges[edge].light_of(surface, canvas));
        let lights = edges.iter().map(|edge| edge.light(canvas, bundle)).collect();
        edges.clear();
        bundle.clear();
        lights
    }

    /// Marks the pixels of so many rows from row `top` on.
    fn mark(&mut self, canvas: &Canvas, top: usize, rows: usize) {
        let (width, last) = (canvas.width(), canvas.height() - 1);
        let Self { marks, levels, .. } = self;
        marks.clear();
        marks.resize(width * rows, 0);
        levels.resize(width * (rows + 2), 0.0);
        // Beside the first and the last row of the image are these themselves.
        let of_row = |number: usize| (top + number).saturating_sub(1).min(last);
        for (number, levels) in levels.chunks_exact_mut(width).enumerate() {
            set_levels(levels, [0, 1, 2].map(|channel| canvas.light(channel, of_row(number))));
        }
        let shown = |number: usize| (canvas.surfaces(of_row(number)), &levels[number * width..][..width]);
        for (marks, number) in marks.chunks_exact_mut(width).zip(1..) {
            let (surfaces, levels) = shown(number);
            for (other_surfaces, other_levels) in [shown(number - 1), shown(number + 1)] {
                mark_many(marks, [surfaces, other_surfaces], [levels, other_levels]);
            }
            mark_many(&mut marks[1..], [&surfaces[1..], surfaces], [&levels[1..], levels]);
            mark_many(marks, [surfaces, &surfaces[1..]], [levels, &levels[1..]]);
        }
    }
}

/// The first `count` of these are places on a pixel's square, as [`lattice`](crate::render::lattice) gives them, in single precision.
fn lattice(count: usize, hash: u64) -> [[f32; MOST_OF_PIXEL]; 2] {
    const GOLDEN: f32 = 0.618_034;
    let (step, (a, b)) = (1.0 / count as f32, unit_pair(hash));
    let wrapped = |part: f32| if part >= 1.0 { part - 1.0 } else { part };
    let (mut places, mut at) = ([[0.0; MOST_OF_PIXEL]; 2], [a as f32, b as f32]);
    let [us, vs] = &mut places;
    for (u, v) in us.iter_mut().zip(vs).take(count) {
        (*u, *v) = (at[0] - 0.5, at[1] - 0.5);
        at = [wrapped(at[0] + step), wrapped(at[1] + GOLDEN)];
    }
    places
}

/// The marks of rows of so many pixels and their places (x, y), tile by tile.
fn marked(marks: &[u8], width: usize) -> impl Iterator<Item = ([usize; 2], u8)> {
    let rows = marks.len() / width;
    let tops = (0..rows).step_by(TILE).flat_map(move |top| (0..width).step_by(TILE).map(move |left| [left, top]));
    tops.flat_map(move |[left, top]| {
        let of_row = move |y: usize| {
            let part = &marks[y * width + left..y * width + (left + TILE).min(width)];
            // Most rows of tiles have none.
            let part = if *part == [0; TILE] { &[] } else { part };
            let places = part.iter().enumerate().filter(|(_, mark)| **mark != 0);
            places.map(move |(i, mark)| ([left + i, y], *mark))
        };
        (top..(top + TILE).min(rows)).flat_map(of_row)
    })
}

impl RayTable {
    /// The rays through the first of these places on a pixel, in pixels from its centre, in the world, and the number of those within the field.
    /// Between neighbours they are taken to change evenly, which is wrong by less than a thousandth of a pixel.
    fn rays_at(
        &self,
        eye: &Eye,
        [x, y]: [usize; 2],
        (places, count): (&[[f32; MOST_OF_PIXEL]; 2], usize),
    ) -> (Singles<MOST_OF_PIXEL>, usize) {
        let stride = self.size.width as usize + 2;
        let middle = (y + 1) * stride + x + 1;
        let ray = |at: usize| [self.rays[0][at], self.rays[1][at], self.rays[2][at]];
        let (at, du, dv) =
            (ray(middle), [ray(middle - 1), ray(middle + 1)], [ray(middle - stride), ray(middle + stride)]);
        if [du, dv].as_flattened().iter().any(|ray| ray[2].is_nan()) {
            return self.rays_at_rim(eye, at, [du, dv], (places, count));
        }
        let slopes = [du, dv].map(|neighbours| eye.in_world(slope(neighbours)));
        (between(eye.in_world(at), slopes, places), count)
    }

    /// [`Self::rays_at`] beside pixels outside the field, whose rays are not numbers.
    fn rays_at_rim(
        &self,
        eye: &Eye,
        at: [f32; 3],
        neighbours: [[[f32; 3]; 2]; 2],
        (places, count): (&[[f32; MOST_OF_PIXEL]; 2], usize),
    ) -> (Singles<MOST_OF_PIXEL>, usize) {
        let slopes = neighbours.map(|[before, after]| match [before[2].is_nan(), after[2].is_nan()] {
            [false, false] => slope([before, after]),
            [true, false] => [0, 1, 2].map(|axis| after[axis] - at[axis]),
            [false, true] => [0, 1, 2].map(|axis| at[axis] - before[axis]),
            [true, true] => [0.0; 3],
        });
        let (rays, mut seen, mut count_seen) = (between(at, slopes, places), [[0.0; MOST_OF_PIXEL]; 3], 0);
        for [x, y, z] in (0..count).map(|i| [rays[0][i], rays[1][i], rays[2][i]]) {
            if z >= self.least_z * (x * x + y * y + z * z).sqrt() {
                let ray = eye.in_world([x, y, z]);
                (0..3).for_each(|axis| seen[axis][count_seen] = ray[axis]);
                count_seen += 1;
            }
        }
        (seen, count_seen)
    }
}

/// By how much rays change from one pixel to the next, by those of both neighbours.
fn slope([before, after]: [[f32; 3]; 2]) -> [f32; 3] {
    [0, 1, 2].map(|axis| 0.5 * (after[axis] - before[axis]))
}

/// Rays that change evenly, by so much from one pixel to the next, through places on a pixel.
fn between(at: [f32; 3], [du, dv]: [[f32; 3]; 2], [u, v]: &[[f32; MOST_OF_PIXEL]; 2]) -> Singles<MOST_OF_PIXEL> {
    let mut rays = [[0.0; MOST_OF_PIXEL]; 3];
    for axis in 0..3 {
        for i in 0..MOST_OF_PIXEL {
            rays[axis][i] = at[axis] + du[axis] * u[i] + dv[axis] * v[i];
        }
    }
    rays
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

/// The square roots of the means of colours, by the instructions of this machine: the same numbers on all.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
fn set_levels(levels: &mut [f32], [red, green, blue]: [&[f32]; 3]) {
    let count = levels.len().min(red.len()).min(green.len()).min(blue.len());
    let (levels, red, green, blue) = (&mut levels[..count], &red[..count], &green[..count], &blue[..count]);
    for i in 0..count {
        levels[i] = ((red[i] + green[i] + blue[i]) / 3.0).sqrt();
    }
}

const _: () = assert!(BAND.is_multiple_of(TILE), "the tiles of a band are whole");
