//! Procedural materials: reflectance as a function of the place on a surface.
//!
//! Each is random at several scales and does not repeat, so that a patch of it can be found again in another image and
//! nowhere else. Features finer than the footprint of a pixel fade to their mean.

use crate::Sheet;
use crate::packet::Singles;
use crate::real::Real;
use crate::shape::SurfacePoints;
use crate::texture_noise::{cell_hash, fraction, octaves, smoothstep, survival};

/// Linear red, green and blue.
pub type Rgb = [f32; 3];

/// A kind of surface. Sizes are in mm, colours are reflectances.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pattern {
    /// Plaster, stone, glaze: cloudy noise from `dark` to `light`, the largest clouds of size `cell`.
    Mottled { light: Rgb, dark: Rgb, cell: f64 },
    /// Wood with its grain along the shape's `axis`.
    Wood { light: Rgb, dark: Rgb, axis: usize },
    /// Floor boards of wood, `width` wide and `length` long along the surface's v.
    Planks { light: Rgb, dark: Rgb, width: f64, length: f64 },
    /// Bricks in running bond, with mortar.
    Bricks { light: Rgb, dark: Rgb },
    /// Cloth of two colours of `thread` thickness, with a random motif.
    Woven { warp: Rgb, weft: Rgb, thread: f64 },
    /// A print of overlapping random blots, bars and rings, the largest of size `cell`, on `ground`.
    Blots { ground: Rgb, cell: f64 },
    /// A book's cover: bands and rows of lettering on coloured cloth.
    Book { cloth: Rgb, ink: Rgb },
    /// A leaf with its rib along v.
    Leaf { light: Rgb, dark: Rgb },
    /// The garden seen through a window, `height` high.
    Garden { height: f64 },
    /// A calibration target.
    Print(Sheet),
}

/// The colours that an expression gives for each of so many points. Not a function: a closure would not get the instructions of its caller.
macro_rules! each {
    ($count:ident, |$i:ident| $colour:expr) => {{
        let mut colours = [[0.0; $count]; 3];
        for $i in 0..$count {
            put(&mut colours, $i, $colour);
        }
        colours
    }};
}

impl Pattern {
    /// The reflectances of the variant `seed` at the places `at`; those that are not `wanted` may have any.
    #[inline(always)]
    pub fn reflectances<T: Real, const N: usize>(
        &self,
        at: &SurfacePoints<T, N>,
        seed: u32,
        wanted: &[bool; N],
    ) -> Singles<N> {
        let mut seeds = at.face;
        seeds.iter_mut().for_each(|face| *face = seed.wrapping_add(face.wrapping_mul(0x51ed_270b)));
        let seeds = &seeds;
        match *self {
            Self::Mottled { light, dark, cell } => {
                let clouds = noise(at, seeds, cell, 6);
                each!(N, |i| blend(dark, light, 0.5 + 0.42 * clouds[i]))
            }
            Self::Wood { light, dark, axis } => {
                let tones = grain(&at.position, axis, seeds, &at.footprint);
                each!(N, |i| blend(dark, light, tones[i]))
            }
            Self::Planks { light, dark, width, length } => planks(at, light, dark, [width, length], seeds),
            Self::Bricks { light, dark } => {
                let (ragged, clouds) = (noise(at, &salted(seeds, 0x3c), 40.0, 2), noise(at, seeds, 64.0, 5));
                each!(N, |i| brick(&at.spot(i, seeds), light, dark, [ragged[i], clouds[i]]))
            }
            Self::Woven { warp, weft, thread } => {
                let (motif, wear) = (noise(at, &salted(seeds, 0x19), 170.0, 3), noise(at, seeds, 45.0, 4));
                each!(N, |i| cloth(&at.spot(i, seeds), warp, weft, thread, [motif[i], wear[i]]))
            }
            Self::Blots { ground, cell } => blots(at, ground, cell, seeds, wanted),
            Self::Book { cloth, ink } => {
                let linen = noise(at, seeds, 30.0, 3);
                each!(N, |i| cover(&at.spot(i, seeds), cloth, ink, linen[i]))
            }
            Self::Leaf { light, dark } => leaf(at, light, dark, seeds),
            Self::Garden { height } => {
                let (foliage, clouds) = (noise(at, seeds, 220.0, 6), noise(at, &salted(seeds, 0x5a), 300.0, 4));
                each!(N, |i| garden(&at.spot(i, seeds), height, [foliage[i], clouds[i]]))
            }
            Self::Print(sheet) => {
                let mut inks = [[0.0; N]; 3];
                for i in (0..N).filter(|&i| wanted[i]) {
                    let place = at.uv.map(|along| along[i].double());
                    put(&mut inks, i, sheet.ink(place, at.face[i] == 1));
                }
                inks
            }
        }
    }
}

/// Noise at points on a surface.
#[inline(always)]
fn noise<T: Real, const N: usize>(at: &SurfacePoints<T, N>, seeds: &[u32; N], cell: f64, count: u32) -> [f32; N] {
    octaves(&at.position, cell, count, seeds, &at.footprint)
}

/// Seeds of another noise at the same points.
#[inline(always)]
fn salted<const N: usize>(seeds: &[u32; N], salt: u32) -> [u32; N] {
    let mut salted = *seeds;
    salted.iter_mut().for_each(|seed| *seed ^= salt);
    salted
}

/// One of some points on a surface.
struct Spot<T> {
    /// Coordinates in mm along the surface.
    uv: [T; 2],
    /// Extent of a pixel, mm.
    footprint: T,
    seed: u32,
}

impl<T: Real, const N: usize> SurfacePoints<T, N> {
    #[inline(always)]
    fn spot(&self, i: usize, seeds: &[u32; N]) -> Spot<T> {
        Spot { uv: [self.uv[0][i], self.uv[1][i]], footprint: self.footprint[i], seed: seeds[i] }
    }
}

#[inline(always)]
fn put<const N: usize>(colours: &mut Singles<N>, i: usize, [red, green, blue]: Rgb) {
    (colours[0][i], colours[1][i], colours[2][i]) = (red, green, blue);
}

/// From `a` at 0 to `b` at 1, a little beyond either end allowed, never negative.
#[inline(always)]
fn blend([a0, a1, a2]: Rgb, [b0, b1, b2]: Rgb, t: f32) -> Rgb {
    let t = t.clamp(-0.15, 1.15);
    [(a0 + (b0 - a0) * t).max(0.0), (a1 + (b1 - a1) * t).max(0.0), (a2 + (b2 - a2) * t).max(0.0)]
}

#[inline(always)]
fn scaled([red, green, blue]: Rgb, factor: f32) -> Rgb {
    [red * factor, green * factor, blue * factor]
}

/// A saturated colour of print, from `hash`.
#[inline(always)]
pub fn pigment(hash: u32) -> Rgb {
    const INKS: [Rgb; 10] = [
        [0.55, 0.05, 0.04],
        [0.75, 0.33, 0.03],
        [0.80, 0.62, 0.08],
        [0.09, 0.30, 0.10],
        [0.03, 0.22, 0.25],
        [0.04, 0.09, 0.33],
        [0.30, 0.06, 0.25],
        [0.78, 0.74, 0.62],
        [0.03, 0.03, 0.04],
        [0.35, 0.20, 0.10],
    ];
    let ink = INKS[((fraction(hash, 40) * INKS.len() as f32) as u32 as usize).min(INKS.len() - 1)];
    scaled(ink, 0.7 + 0.5 * fraction(hash, 41))
}

/// Streaks stretched eightfold along `axis`, and pores that are not; 0 dark to 1 light.
#[inline(always)]
fn grain<T: Real, const N: usize>(
    position: &[[T; N]; 3],
    axis: usize,
    seeds: &[u32; N],
    footprint: &[T; N],
) -> [f32; N] {
    let mut stretched = *position;
    stretched[axis].iter_mut().for_each(|component| *component = *component * T::of(0.125));
    let streaks = octaves(&stretched, 48.0, 4, seeds, footprint);
    let clouds = octaves(position, 60.0, 4, &salted(seeds, 0x77), footprint);
    let mut tones = [0.0; N];
    for i in 0..N {
        tones[i] = 0.5 + 0.34 * streaks[i] + 0.24 * clouds[i];
    }
    tones
}

/// How far `offset` in a cell of `size` (mm) is from the cell's border, as 0 on the joint of `joint` mm and 1 inside.
#[inline(always)]
fn joint<T: Real>(offset: f32, size: f64, joint: f64, footprint: T) -> f32 {
    let from_border = T::of(f64::from(offset.min(1.0 - offset))) * T::of(size);
    let half = T::of(0.5 * joint);
    let soft = half.max(footprint);
    let [low, high] = [half - T::of(0.5) * soft, half + T::of(0.5) * soft];
    smoothstep(low.single(), high.single(), from_border.single())
}

#[inline(always)]
fn planks<T: Real, const N: usize>(
    at: &SurfacePoints<T, N>,
    light: Rgb,
    dark: Rgb,
    [width, length]: [f64; 2],
    seeds: &[u32; N],
) -> Singles<N> {
    const GAP: f64 = 5.0;
    let (mut hashes, mut across, mut along) = ([0; N], [0.0; N], [0.0; N]);
    for i in 0..N {
        let (plank, within) = (at.uv[0][i] / T::of(width)).split();
        let shift = fraction(cell_hash(plank, 0, seeds[i]), 1);
        let (piece, part) = (at.uv[1][i] / T::of(length) + T::of(f64::from(shift))).split();
        (hashes[i], across[i], along[i]) = (cell_hash(plank, piece, seeds[i]), within, part);
    }
    let grains = grain(&at.position, 1, &hashes, &at.footprint);
    each!(N, |i| {
        let tone = 0.35 * (fraction(hashes[i], 2) - 0.5) + grains[i];
        let gap = joint(across[i], width, GAP, at.footprint[i]) * joint(along[i], length, GAP, at.footprint[i]);
        scaled(blend(dark, light, tone), 0.35 + 0.65 * gap)
    })
}

#[inline(always)]
fn brick<T: Real>(at: &Spot<T>, light: Rgb, dark: Rgb, [ragged, clouds]: [f32; 2]) -> Rgb {
    const LENGTH: f64 = 230.0;
    const HEIGHT: f64 = 77.0;
    const MORTAR: f64 = 13.0;
    const GREY: Rgb = [0.36, 0.34, 0.31];
    let ragged = T::of(3.0) * T::of(f64::from(ragged));
    let (course, v) = ((at.uv[1] + ragged) / T::of(HEIGHT)).split();
    let half = T::of(if course & 1 == 0 { 0.0 } else { 0.5 });
    let (brick, u) = ((at.uv[0] + ragged) / T::of(LENGTH) + half).split();
    let hash = cell_hash(brick, course, at.seed);
    let tone = 0.5 + 0.9 * (fraction(hash, 1) - 0.5) + 0.38 * clouds;
    let fired = blend(dark, light, tone);
    let fired = [fired[0], fired[1] * (0.85 + 0.4 * fraction(hash, 2)), fired[2] * (0.8 + 0.5 * fraction(hash, 3))];
    let inside = joint(u, LENGTH, MORTAR, at.footprint) * joint(v, HEIGHT, MORTAR, at.footprint);
    blend(scaled(GREY, 1.0 + 0.35 * clouds), fired, inside)
}

#[inline(always)]
fn cloth<T: Real>(at: &Spot<T>, warp: Rgb, weft: Rgb, thread: f64, [motif, wear]: [f32; 2]) -> Rgb {
    let ((i, u), (j, v)) = ((at.uv[0] / T::of(thread)).split(), (at.uv[1] / T::of(thread)).split());
    let on_top = (i ^ j) & 1 == 0;
    let (across, column, row) = if on_top { (u, i, 1) } else { (v, 2, j) };
    let number = cell_hash(column, row, at.seed);
    let colour = if on_top { warp } else { weft };
    let fine = survival(thread, at.footprint);
    let dyed = 1.0 + fine * 0.5 * (fraction(number, 1) - 0.5);
    let side = 2.0 * across - 1.0;
    let round = 1.0 - fine * 0.45 * (side * side);
    let cloth = blend(blend(warp, weft, 0.5), colour, fine);
    let wear = 1.0 + 0.3 * wear;
    let pattern = smoothstep(-0.12, 0.12, motif);
    scaled(blend(cloth, blend(weft, warp, pattern), 0.6), dyed * round * wear)
}

/// Five layers of random shapes, each finer than the one below.
#[inline(always)]
fn blots<T: Real, const N: usize>(
    at: &SurfacePoints<T, N>,
    ground: Rgb,
    cell: f64,
    seeds: &[u32; N],
    wanted: &[bool; N],
) -> Singles<N> {
    const LAYERS: u32 = 5;
    let wash = noise(at, seeds, 2.0 * cell, 6);
    let mut colours: Singles<N> = each!(N, |i| scaled(ground, 1.0 + 0.35 * wash[i]));
    let (mut size, [mut x, mut y]) = (cell, at.uv);
    for layer in 0..LAYERS {
        let (mut fine, mut shown) = ([0.0; N], false);
        for i in 0..N {
            fine[i] = survival(0.6 * size, at.footprint[i]);
            shown |= (fine[i] > 0.0) & wanted[i];
        }
        if !shown {
            break;
        }
        for i in 0..N {
            if T::ONE_BY_ONE && !wanted[i] {
                continue;
            }
            let seed = seeds[i].wrapping_add(layer.wrapping_mul(0x2545_f491));
            let (shift, size) = (T::of(f64::from(fraction(seed, 7))), T::of(size));
            let ((column, u), (row, v)) = ((x[i] / size + shift).split(), (y[i] / size - shift).split());
            let hash = cell_hash(column, row, seed);
            let cover = blot::<T>(hash, [u - 0.5, v - 0.5], (at.footprint[i] / size).single()) * fine[i];
            if T::ONE_BY_ONE && cover <= 0.0 {
                continue;
            }
            let below = [colours[0][i], colours[1][i], colours[2][i]];
            put(&mut colours, i, blend(below, scaled(pigment(hash), 1.0 + 0.2 * wash[i]), 0.9 * cover));
        }
        // The layers are turned against each other (by the angle of the 3-4-5 triangle), lest their cells show.
        for i in 0..N {
            let [a, b] = [x[i], y[i]];
            (x[i], y[i]) = (T::of(0.8) * a - T::of(0.6) * b, T::of(0.6) * a + T::of(0.8) * b);
        }
        size *= 0.56;
    }
    colours
}

/// Coverage, 0 to 1, of the point `p` (from the middle of the cell) by one random shape in a cell of side 1.
#[inline(always)]
fn blot<T: Real>(hash: u32, p: [f32; 2], footprint: f32) -> f32 {
    const EMPTY: f32 = 0.25;
    let is_empty = fraction(hash, 0) < EMPTY;
    if T::ONE_BY_ONE && is_empty {
        return 0.0;
    }
    let radius = 0.14 + 0.24 * fraction(hash, 1);
    let room = 0.48 - radius;
    let [right, down] = [(2.0 * fraction(hash, 2) - 1.0) * room, (2.0 * fraction(hash, 3) - 1.0) * room];
    let (x, y) = (p[0] - right, p[1] - down);
    let soft = footprint.max(0.03);
    // No shape reaches so far: the corners of bars and squares are within 1.05 radii.
    let reach = 1.1 * radius + soft;
    if T::ONE_BY_ONE && x * x + y * y > reach * reach {
        return 0.0;
    }
    let (sin, cos) = T::sin_cos_of_turn(fraction(hash, 4));
    let (x, y) = (cos * x - sin * y, sin * x + cos * y);
    let (kind, from_middle) = (fraction(hash, 5) * 4.0, T::hypot(x, y));
    let disc = radius - from_middle;
    let ring = 0.3 * radius - (from_middle - 0.7 * radius).abs();
    let bar = (radius - x.abs()).min(0.3 * radius - y.abs());
    let square = 0.7 * radius - x.abs().max(y.abs());
    let [round, straight] = [if kind < 1.0 { disc } else { ring }, if kind < 3.0 { bar } else { square }];
    let from_edge = if kind < 2.0 { round } else { straight };
    let cover = smoothstep(-0.5 * soft, 0.5 * soft, from_edge);
    if is_empty { 0.0 } else { cover }
}

#[inline(always)]
fn cover<T: Real>(at: &Spot<T>, cloth: Rgb, ink: Rgb, linen: f32) -> Rgb {
    const BAND: f64 = 23.0;
    const LETTER: f64 = 8.0;
    let linen = 1.0 + 0.35 * linen;
    let (band, within) = (at.uv[1] / T::of(BAND)).split();
    let kind = fraction(cell_hash(band, 3, at.seed), 1);
    let (i, u) = (at.uv[0] / T::of(LETTER)).split();
    let (j, v) = (at.uv[1] / T::of(LETTER)).split();
    let is_inside = (0.1..0.9).contains(&u) & (0.15..0.85).contains(&v);
    let is_letter = (fraction(cell_hash(i, j, at.seed), 2) > 0.45) & is_inside;
    let letter = if is_letter { survival(LETTER, at.footprint) } else { 0.0 };
    let lettering = if kind < 0.55 { letter } else { 0.0 };
    let cover = if kind < 0.22 { joint(within, BAND, 6.0, at.footprint) } else { lettering };
    scaled(blend(cloth, ink, cover), linen)
}

#[inline(always)]
fn leaf<T: Real, const N: usize>(at: &SurfacePoints<T, N>, light: Rgb, dark: Rgb, seeds: &[u32; N]) -> Singles<N> {
    let [from_rib, mut slanted] = at.uv;
    for i in 0..N {
        slanted[i] = slanted[i] - from_rib[i].abs();
    }
    let veins = octaves(&[from_rib, slanted, [T::of(0.0); N]], 26.0, 4, seeds, &at.footprint);
    each!(N, |i| {
        let rib = smoothstep(5.0, 2.0, from_rib[i].abs().single()) * survival(6.0, at.footprint[i]);
        blend(dark, light, 0.5 + 0.5 * veins[i] + 0.6 * rib)
    })
}

/// Sky, a tree line and a lawn.
#[inline(always)]
fn garden<T: Real>(at: &Spot<T>, height: f64, [foliage, clouds]: [f32; 2]) -> Rgb {
    const SKY: Rgb = [0.75, 0.86, 1.0];
    const CLOUD: Rgb = [1.0, 1.0, 0.98];
    const DARK_LEAVES: Rgb = [0.04, 0.09, 0.03];
    const LIGHT_LEAVES: Rgb = [0.30, 0.42, 0.14];
    const LAWN: Rgb = [0.26, 0.44, 0.12];
    let level = (at.uv[1] / T::of(height)).single() + 0.12 * foliage;
    let sky = blend(SKY, CLOUD, 0.5 + clouds);
    let trees = blend(DARK_LEAVES, LIGHT_LEAVES, 0.5 + 0.7 * foliage);
    let beyond = blend(sky, trees, smoothstep(-0.08, -0.05, level));
    blend(beyond, scaled(LAWN, 1.0 + 0.5 * foliage), smoothstep(0.22, 0.26, level))
}
