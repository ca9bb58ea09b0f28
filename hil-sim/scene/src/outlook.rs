//! What stands in each direction from a place, so that a ray from there is tested against few of the shapes.
//!
//! The directions are the cells of a cube about the place, each with the shapes that it may show, nearest first: the light
//! buffer of E. Haines and D. Greenberg ("The light buffer", IEEE CG&A 6(9), 1986), here for lamps and for cameras.

use nalgebra::{Matrix3, Vector3};

use crate::packet::{Singles, next_value};

/// Cells along the edge of a face of the cube.
const CELLS: usize = 64;
const FACES: usize = 6;

/// A shape nearer than this (mm) is listed in every direction; nearer than this before a face of the cube nothing is projected.
const NEAR_MM: f64 = 1.0;

/// Added around each box (mm), and to each cell's edges as a share of a cell, against rounding.
const PADDING_MM: f64 = 0.02;
const PADDING_CELLS: f64 = 0.01;

/// A box of half size `half` about `centre`, turned by `world_from_box`.
#[derive(Clone, Copy, Debug)]
pub struct TurnedBox {
    /// Middle in the world, mm.
    pub centre: Vector3<f64>,
    /// Axes of the box as columns.
    pub world_from_box: Matrix3<f64>,
    /// Half of its size along its axes, mm.
    pub half: Vector3<f64>,
}

/// A shape that may be met, and the least distance from the place at which that can be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Index of the shape.
    pub shape: u32,
    /// In mm, rounded down.
    pub from_mm: f32,
}

/// The shapes in each direction from a place.
#[derive(Clone, Debug, PartialEq)]
pub struct Outlook {
    place: Vector3<f64>,
    slack: f64,
    /// How many cells further to the right and down the shapes of a cell's list stand.
    overlap: usize,
    /// Where the candidates of a cell begin; those of the next one are their end.
    begins: Vec<u32>,
    candidates: Vec<Candidate>,
}

impl Outlook {
    /// From `place`, for all rays that start within `slack` mm of it.
    pub fn new(shapes: impl Iterator<Item = (usize, TurnedBox)>, place: Vector3<f64>, slack: f64) -> Self {
        Self::overlapping(shapes, place, slack, 0)
    }

    /// The same for rays that keep together: the list of a cell is also of those right of it and below it within `overlap` cells, so that one
    /// list serves all.
    pub fn overlapping(
        shapes: impl Iterator<Item = (usize, TurnedBox)>,
        place: Vector3<f64>,
        slack: f64,
        overlap: usize,
    ) -> Self {
        let mut shapes: Vec<(Candidate, TurnedBox)> = shapes
            .map(|(shape, mut of_shape)| {
                of_shape.half.add_scalar_mut(slack + PADDING_MM);
                let from_mm = (of_shape.distance(place) * (1.0 - f64::from(f32::EPSILON))) as f32;
                (Candidate { shape: shape as u32, from_mm }, of_shape)
            })
            .collect();
        shapes.sort_by(|a, b| a.0.order(&b.0));
        let listed: Vec<(Candidate, [Option<Part>; FACES])> =
            shapes.into_iter().map(|(candidate, of_shape)| (candidate, of_shape.parts(place, overlap))).collect();
        let mut begins = vec![0; FACES * CELLS * CELLS + 1];
        for_each_cell(&listed, |cell, _| begins[cell + 1] += 1);
        for cell in 1..begins.len() {
            begins[cell] += begins[cell - 1];
        }
        let total = begins.last().copied().unwrap_or_default();
        let mut candidates = vec![Candidate { shape: 0, from_mm: 0.0 }; total as usize];
        let mut next = begins.clone();
        for_each_cell(&listed, |cell, candidate| {
            candidates[next[cell] as usize] = candidate;
            next[cell] += 1;
        });
        Self { place, slack, overlap, begins, candidates }
    }

    /// Where it is from, in the world, mm.
    pub const fn place(&self) -> Vector3<f64> {
        self.place
    }

    /// Whether rays from `origin` are of this outlook.
    #[inline]
    pub fn holds(&self, origin: &Vector3<f64>) -> bool {
        (origin - self.place).norm_squared() <= self.slack * self.slack
    }

    /// The numbers of the cells of `directions` of any length.
    #[inline(always)]
    pub fn cells<const N: usize>(&self, directions: &Singles<N>) -> [u32; N] {
        let [x, y, z] = directions;
        let mut cells = [0; N];
        for i in 0..N {
            let size = [x[i].abs(), y[i].abs(), z[i].abs()];
            let (is_x, is_z) = ((size[0] >= size[1]) & (size[0] >= size[2]), size[2] > size[1]);
            // Along the largest component, and across it the other two in their cyclic order.
            let (along, first, second, axis) = if is_x {
                (x[i], y[i], z[i], 0.0)
            } else if is_z {
                (z[i], x[i], y[i], 2.0)
            } else {
                (y[i], z[i], x[i], 1.0)
            };
            // Rounded by far less than the padding.
            let scale = (0.5 * CELLS as f32) / along.abs();
            let [column, row] = [first, second]
                .map(|across| (across * scale + 0.5 * CELLS as f32).clamp(0.0, CELLS as f32 - 1.0).trunc());
            let face = 2.0 * axis + if along < 0.0 { 1.0 } else { 0.0 };
            cells[i] = ((face * CELLS as f32 + row) * CELLS as f32 + column) as u32;
        }
        cells
    }

    /// The shapes that the rays which count may meet, nearest first; `cells` are those of their directions.
    #[inline(always)]
    pub fn candidates<const N: usize>(&self, counts: &[bool; N], cells: &[u32; N]) -> Candidates<'_, N> {
        let (mut left, mut lists, mut count) = (*counts, [[].as_slice(); N], 0);
        if let Some(cell) = self.cell_of_all(counts, cells) {
            (lists[0], count, left) = (self.list(cell), 1, [false; N]);
        }
        while let Some((cell, _)) = next_value(&mut left, cells) {
            lists[count] = self.list(cell);
            count += 1;
        }
        Candidates { lists, count }
    }

    #[inline(always)]
    fn list(&self, cell: u32) -> &[Candidate] {
        let cell = cell as usize;
        &self.candidates[self.begins[cell] as usize..self.begins[cell + 1] as usize]
    }

    /// The cell whose list holds the shapes of all these cells, if they are near enough to each other on one face.
    #[inline(always)]
    fn cell_of_all<const N: usize>(&self, counts: &[bool; N], cells: &[u32; N]) -> Option<u32> {
        let (mut first, mut last) = ([u32::MAX; 2], [0; 2]);
        for i in 0..N {
            // Rows are counted over all faces.
            let place = [cells[i] % CELLS as u32, cells[i] / CELLS as u32];
            for axis in 0..2 {
                let (low, high) = if counts[i] { (place[axis], place[axis]) } else { (u32::MAX, 0) };
                first[axis] = first[axis].min(low);
                last[axis] = last[axis].max(high);
            }
        }
        let is_near = |axis: usize| first[axis] <= last[axis] && last[axis] - first[axis] <= self.overlap as u32;
        let is_one_face = first[1] / CELLS as u32 == last[1] / CELLS as u32;
        (is_near(0) && is_near(1) && is_one_face).then_some(first[1] * CELLS as u32 + first[0])
    }
}

/// What stands in some cells, each shape once.
pub struct Candidates<'a, const N: usize> {
    /// What is left of each cell's shapes.
    lists: [&'a [Candidate]; N],
    count: usize,
}

impl<const N: usize> Candidates<'_, N> {
    /// The nearest of those that are left.
    #[inline(always)]
    pub fn next(&mut self) -> Option<Candidate> {
        let lists = &mut self.lists[..self.count];
        if let [list] = lists {
            let (nearest, rest) = list.split_first()?;
            *list = rest;
            return Some(*nearest);
        }
        let nearest = lists.iter().filter_map(|list| list.first()).copied().min_by(Candidate::order)?;
        for list in lists {
            if let Some((_, rest)) = list.split_first().filter(|(first, _)| first.shape == nearest.shape) {
                *list = rest;
            }
        }
        Some(nearest)
    }
}

impl Candidate {
    /// Nearest first.
    fn order(&self, other: &Self) -> std::cmp::Ordering {
        self.from_mm.total_cmp(&other.from_mm).then(self.shape.cmp(&other.shape))
    }
}

/// A rectangle of cells of a face: first and last column, first and last row.
type Part = [[usize; 2]; 2];

fn for_each_cell(listed: &[(Candidate, [Option<Part>; FACES])], mut visit: impl FnMut(usize, Candidate)) {
    for (candidate, parts) in listed {
        for (face, part) in parts.iter().enumerate() {
            let Some([columns, rows]) = part else { continue };
            for row in rows[0]..=rows[1] {
                (columns[0]..=columns[1]).for_each(|column| visit((face * CELLS + row) * CELLS + column, *candidate));
            }
        }
    }
}

impl TurnedBox {
    /// How far `place` is from the box.
    fn distance(&self, place: Vector3<f64>) -> f64 {
        let own = self.world_from_box.tr_mul(&(place - self.centre));
        own.zip_map(&self.half, |at, half| (at.abs() - half).max(0.0)).norm()
    }

    /// The cells of each face of the cube about `place` that the box covers: those of the rectangle about its corners' projections.
    fn parts(&self, place: Vector3<f64>, overlap: usize) -> [Option<Part>; FACES] {
        if self.distance(place) < 2.0 * NEAR_MM {
            return [Some([[0, CELLS - 1]; 2]); FACES];
        }
        let corners: [Vector3<f64>; 8] = std::array::from_fn(|corner| {
            let sign = Vector3::from_fn(|axis, _| if corner >> axis & 1 == 0 { -1.0 } else { 1.0 });
            self.centre - place + self.world_from_box * self.half.component_mul(&sign)
        });
        let mut parts = std::array::from_fn(|face| part(&corners, face / 2, if face % 2 == 0 { 1.0 } else { -1.0 }));
        for [first, _] in parts.iter_mut().flatten().flatten() {
            *first = first.saturating_sub(overlap);
        }
        parts
    }
}

/// The cells that a box with these corners covers on the face of the cube at `sign` along `axis`. What is before the face is convex: its
/// projection lies between those of its corners, which are the box's own and those where its edges come before the face.
fn part(corners: &[Vector3<f64>; 8], axis: usize, sign: f64) -> Option<Part> {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    let mut cover = |point: Vector3<f64>| {
        for (other, (low, high)) in low.iter_mut().zip(&mut high).enumerate() {
            let across = point[(axis + 1 + other) % 3] / (sign * point[axis]);
            (*low, *high) = (low.min(across), high.max(across));
        }
    };
    let before = |corner: usize| sign * corners[corner][axis] - NEAR_MM;
    for corner in (0..8).filter(|&corner| before(corner) >= 0.0) {
        cover(corners[corner]);
        for other in [1, 2, 4].map(|edge| corner ^ edge).into_iter().filter(|&other| before(other) < 0.0) {
            let share = before(corner) / (before(corner) - before(other));
            cover(corners[corner] + (corners[other] - corners[corner]) * share);
        }
    }
    let cells = |axis: usize| {
        let at = |across: f64, padding: f64| (across + 1.0) * (0.5 * CELLS as f64) + padding;
        let (first, last) = (at(low[axis], -PADDING_CELLS), at(high[axis], PADDING_CELLS));
        // Also where nothing is before the face: from infinity to minus infinity.
        let covered = first < CELLS as f64 && last >= 0.0;
        covered.then(|| [first.max(0.0) as usize, (last as usize).min(CELLS - 1)])
    };
    Some([cells(0)?, cells(1)?])
}
