//! Where the pixels of a view lie in the image of its camera, kept while pose and lens stand.

use multiversion::multiversion;
use nalgebra::Matrix3;
use rayon::prelude::*;
use vergence_vision::{BatchLens, BodyMask, KannalaBrandt, Pixel};

use crate::Grid;
use crate::grid::direction_of;
use crate::knots::{KNOT, interpolate};
use crate::shared_field::Inside;

/// The first pixel of a place that the camera does not see.
pub(crate) const UNSEEN: u32 = u32::MAX;

/// What decides where the pixels of a view lie in an image.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mapped {
    pub camera: KannalaBrandt,
    /// From the shared axes to the camera.
    pub turn: Matrix3<f64>,
    pub grid: Grid,
    /// Width and height of the image, which is cut off where it has not the size of the camera's.
    pub image: (u32, u32),
    pub mask: Option<BodyMask>,
}

/// The places in an image of the pixels of one row of a view.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Places {
    /// Index of the first of the 4 x 4 pixels around each place, by rows; [`UNSEEN`] where there is none.
    pub firsts: Vec<u32>,
    /// How far each place is past the second column and the second row of these.
    pub past: [Vec<f32>; 2],
}

/// What is kept of one camera from view to view: its prepared lens, and the map of views that are alike.
#[derive(Debug, Default)]
pub(crate) struct Kept {
    lens: Option<(KannalaBrandt, BatchLens)>,
    /// Of the last view.
    before: Option<Mapped>,
    map: Vec<Places>,
    /// Whether `map` is that of the last view. It is made when that came for the second time: a map for one view costs more than it saves.
    is_made: bool,
    /// The number of views for which it was.
    served: u64,
}

impl Kept {
    /// The number of views that were decided by the same as the ones before.
    pub(crate) const fn served(&self) -> u64 {
        self.served
    }

    /// What finds the places of the rows of the view that `mapped` decides, and all of them where the view before was the same.
    pub(crate) fn of(&mut self, mapped: Mapped) -> (Rays<'_>, Option<&[Places]>) {
        let Self { lens, before, map, is_made, served } = self;
        let known = lens.take().filter(|(of, _)| *of == mapped.camera);
        let (_, lens) = lens.insert(known.unwrap_or_else(|| (mapped.camera, BatchLens::new(&mapped.camera))));
        let is_same = before.as_ref() == Some(&mapped);
        let rays = Rays::of(lens, before.insert(mapped));
        if is_same && !*is_made {
            map.resize_with(rays.mapped.grid.size().1, Places::default);
            map.par_iter_mut().enumerate().for_each_init(Line::default, |line, (y, places)| rays.fill(y, line, places));
        }
        *is_made = is_same;
        *served += u64::from(is_same);
        (rays, is_same.then_some(map.as_slice()))
    }
}

/// Finds where the rays of a view meet the image.
pub(crate) struct Rays<'a> {
    lens: &'a BatchLens,
    mapped: &'a Mapped,
    inside: Inside,
    columns: Columns,
}

impl<'a> Rays<'a> {
    fn of(lens: &'a BatchLens, mapped: &'a Mapped) -> Self {
        Self { lens, mapped, inside: Inside::of(&mapped.camera), columns: Columns::of(&mapped.grid) }
    }

    /// Finds the places of row `y`.
    pub(crate) fn fill(&self, y: usize, line: &mut Line, places: &mut Places) {
        let Mapped { turn, grid, image, mask, .. } = self.mapped;
        let row = Row::new(turn, grid.b(y as f64).sin_cos());
        line.fill(self.lens, &self.columns, &row);
        let Line { pixels, seen, .. } = line;
        see(&self.inside, pixels, &self.columns.turns, [row.by_sine[2], row.by_cosine[2]], seen);
        if let Some(mask) = mask {
            let seen = seen.iter_mut().zip(&*pixels).filter(|(seen, _)| **seen);
            seen.for_each(|(seen, &[u, v])| *seen = !mask.hides(Pixel { u, v }));
        }
        place(*image, pixels, seen, places);
    }
}

/// The angles of a grid's columns.
struct Columns {
    /// Sine and cosine of each column.
    turns: Vec<(f64, f64)>,
    /// The same of each knot, from the one before the first column to the second one behind the last.
    knots: Vec<(f64, f64)>,
}

impl Columns {
    fn of(grid: &Grid) -> Self {
        let width = grid.size().0;
        let turn = |x: f64| grid.a(x).sin_cos();
        let knot = |k: usize| turn((k * KNOT) as f64 - KNOT as f64);
        Self {
            turns: (0..width).map(|x| turn(x as f64)).collect(),
            knots: (0..width.div_ceil(KNOT) + 3).map(knot).collect(),
        }
    }
}

/// The rays of one row: a sine and a cosine of the column times two vectors.
struct Row {
    by_sine: [f64; 3],
    by_cosine: [f64; 3],
}

impl Row {
    fn new(camera_from_shared: &Matrix3<f64>, turn: (f64, f64)) -> Self {
        let axis = |a| (camera_from_shared * direction_of(a, turn)).into();
        Self { by_sine: axis((1.0, 0.0)), by_cosine: axis((0.0, 1.0)) }
    }

    fn ray(&self, (sine, cosine): (f64, f64)) -> [f64; 3] {
        std::array::from_fn(|i| sine * self.by_sine[i] + cosine * self.by_cosine[i])
    }
}

/// The pixels of one row of a view, and what finds them.
#[derive(Default)]
pub(crate) struct Line {
    rays: Vec<[f64; 3]>,
    knots: Vec<[f64; 2]>,
    exact: Vec<[f64; 2]>,
    /// NaN beyond the field.
    pixels: Vec<[f64; 2]>,
    seen: Vec<bool>,
}

impl Line {
    fn fill(&mut self, lens: &BatchLens, columns: &Columns, row: &Row) {
        self.rays.clear();
        self.knots.clear();
        self.rays.extend(columns.knots.iter().map(|turn| row.ray(*turn)));
        lens.project_into(&self.rays, &mut self.knots);
        self.pixels.resize(columns.turns.len(), [f64::NAN; 2]);
        self.seen.resize(columns.turns.len(), false);
        between(&self.knots, &mut self.pixels);
        let chunks = self.knots.windows(4).zip(self.pixels.chunks_mut(KNOT)).zip(columns.turns.chunks(KNOT));
        let at_edge = |knots: &[[f64; 2]]| {
            let lost = knots.iter().filter(|knot| knot[0].is_nan()).count();
            (1..4).contains(&lost)
        };
        for ((_, pixels), turns) in chunks.filter(|((knots, _), _)| at_edge(knots)) {
            self.rays.clear();
            self.exact.clear();
            self.rays.extend(turns.iter().map(|turn| row.ray(*turn)));
            lens.project_into(&self.rays, &mut self.exact);
            pixels.copy_from_slice(&self.exact);
        }
    }
}

/// Interpolates the pixels of a row between those of its knots; NaN where one of four knots has none.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
fn between(knots: &[[f64; 2]], pixels: &mut [[f64; 2]]) {
    knots.windows(4).zip(pixels.chunks_mut(KNOT)).for_each(|(knots, pixels)| interpolate(knots, pixels));
}

/// Says which pixels of a row the camera sees, whose rays have the z `by_sine` sin a + `by_cosine` cos a.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
fn see(inside: &Inside, pixels: &[[f64; 2]], turns: &[(f64, f64)], [by_sine, by_cosine]: [f64; 2], seen: &mut [bool]) {
    for ((seen, &[u, v]), (sine, cosine)) in seen.iter_mut().zip(pixels).zip(turns) {
        *seen = inside.contains(sine * by_sine + cosine * by_cosine, &Pixel { u, v });
    }
}

/// Finds the pixels around each place of a row that is `seen`. Positions are split by a sum that rounds them, in loops without branches: only then
/// do compilers turn them into vector instructions.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512bw+avx512vl+avx2", "x86_64+avx2"))]
fn place((width, height): (u32, u32), pixels: &[[f64; 2]], seen: &[bool], places: &mut Places) {
    const TOGETHER: usize = 32;
    /// A number to which others are added that are less than it, and not negative, has no bits for their fractions: the sum is rounded.
    const ROUNDING: f64 = (1_u64 << (f64::MANTISSA_DIGITS - 1)) as f64;
    let (most_u, most_v, stride) = (f64::from(width) - 2.0, f64::from(height) - 2.0, f64::from(width));
    let Places { firsts, past: [past_u, past_v] } = places;
    firsts.resize(pixels.len(), UNSEEN);
    past_u.resize(pixels.len(), 0.0);
    past_v.resize(pixels.len(), 0.0);
    let out = firsts.chunks_mut(TOGETHER).zip(past_u.chunks_mut(TOGETHER)).zip(past_v.chunks_mut(TOGETHER));
    for ((pixels, seen), ((firsts, past_u), past_v)) in pixels.chunks(TOGETHER).zip(seen.chunks(TOGETHER)).zip(out) {
        let (mut around, mut inside) = ([[0.0_f64; 2]; TOGETHER], [false; TOGETHER]);
        around[..pixels.len()].copy_from_slice(pixels);
        inside[..seen.len()].copy_from_slice(seen);
        let (mut columns, mut rows) = ([1.0_f64; TOGETHER], [1.0_f64; TOGETHER]);
        for i in 0..TOGETHER {
            let [u, v] = around[i];
            // Pixels that are seen are at least one pixel inside the camera's images; this image may be smaller.
            let is_inside = inside[i] & (u < most_u) & (v < most_v);
            (columns[i], rows[i]) = if is_inside { (u, v) } else { (1.0, 1.0) };
            inside[i] = is_inside;
        }
        let (mut found, mut past) = ([0_u32; TOGETHER], [[0.0_f32; TOGETHER]; 2]);
        for i in 0..TOGETHER {
            let whole = |place: f64| ((place - 0.5 + ROUNDING) - ROUNDING).max(1.0);
            let (column, row) = (whole(columns[i]), whole(rows[i]));
            (past[0][i], past[1][i]) = ((columns[i] - column) as f32, (rows[i] - row) as f32);
            found[i] = ((row - 1.0) * stride + (column - 1.0) + ROUNDING).to_bits() as u32;
        }
        for i in 0..TOGETHER {
            found[i] = if inside[i] { found[i] } else { UNSEEN };
        }
        past_u.copy_from_slice(&past[0][..pixels.len()]);
        past_v.copy_from_slice(&past[1][..pixels.len()]);
        firsts.copy_from_slice(&found[..pixels.len()]);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;
    use vergence_vision::{Angle, ImageSize};

    use super::*;
    use crate::grid::Extent;

    const SIDE: u32 = 160;

    fn turned(by: f64) -> Mapped {
        let (size, middle) = (ImageSize { width: SIDE, height: SIDE }, f64::from(SIDE) / 2.0);
        let centre = Pixel { u: middle - 0.3, v: middle + 1.2 };
        let camera = KannalaBrandt::new([46.0, 0.7, -0.4, 0.0, 0.0], 1.0, centre, Angle::from_deg(98.0), size).unwrap();
        // As far as the edge of the field and beyond.
        let grid = Grid::over(&Extent { a_min: -1.4, a_max: 1.2, b_min: -1.8, b_max: 1.6 }, 45.0).unwrap();
        let turn = Rotation3::from_euler_angles(0.02, by, -0.05).into_inner();
        Mapped { camera, turn, grid, image: (SIDE, SIDE - 20), mask: None }
    }

    /// The places of all rows of a view, computed anew.
    fn anew(rays: &Rays<'_>) -> Vec<Places> {
        let row = |y| {
            let (mut line, mut places) = (Line::default(), Places::default());
            rays.fill(y, &mut line, &mut places);
            places
        };
        (0..rays.mapped.grid.size().1).map(row).collect()
    }

    #[test]
    fn a_map_is_kept_while_views_are_alike_and_is_that_of_the_view() {
        let mut kept = Kept::default();
        for (by, has_map) in [(0.3, false), (0.3, true), (0.3, true), (0.4, false), (0.3, false), (0.3, true)] {
            let (rays, map) = kept.of(turned(by));
            let (map, new) = (map.map(<[Places]>::to_vec), anew(&rays));
            let seen = new.iter().flat_map(|places| &places.firsts).filter(|&&first| first != UNSEEN).count();
            assert!((10_000..18_000).contains(&seen), "{seen} of 18 172 places are seen");
            assert_eq!(map.is_some(), has_map, "turned by {by}");
            assert!(map.is_none_or(|map| map == new), "turned by {by}: the kept map is another");
        }
    }

    #[test]
    fn another_lens_image_or_mask_has_another_map() {
        let size = ImageSize { width: SIDE, height: SIDE };
        let other_camera = {
            let lens = turned(0.3).camera;
            KannalaBrandt::new(lens.k(), lens.aspect(), Pixel { u: 70.0, v: 80.0 }, Angle::from_deg(98.0), size)
                .unwrap()
        };
        for other in [
            Mapped { camera: other_camera, ..turned(0.3) },
            Mapped { image: (SIDE, SIDE), ..turned(0.3) },
            turned(0.3 + 1e-12),
        ] {
            let mut kept = Kept::default();
            (0..3).for_each(|_| drop(kept.of(turned(0.3))));
            assert!(kept.of(other.clone()).1.is_none());
            let (rays, map) = kept.of(other);
            let map = map.map(<[Places]>::to_vec);
            assert!(map == Some(anew(&rays)));
        }
    }
}
