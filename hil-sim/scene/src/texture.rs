//! Procedural materials: reflectance as a function of the place on a surface.
//!
//! Each is random at several scales and does not repeat, so that a patch of it can be found again in another image and
//! nowhere else. Features finer than the footprint of a pixel fade to their mean.

use crate::Sheet;
use crate::packet::{EXACT, Triples, singles};
use crate::quick_noise;
use crate::shape::SurfacePoints;
use crate::texture_noise::{self, cell_hash, fraction, smoothstep, split, survival};

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

impl Pattern {
    /// The reflectance of the variant `seed` at the places `at` that are `wanted`.
    #[inline(always)]
    pub fn reflectances<const PRECISION: u8, const N: usize>(
        &self,
        at: &SurfacePoints<N>,
        seed: u32,
        wanted: &[bool; N],
    ) -> [Rgb; N] {
        let seeds = at.face.map(|face| seed.wrapping_add(face.wrapping_mul(0x51ed_270b)));
        match *self {
            Self::Mottled { light, dark, cell } => {
                noise::<PRECISION, N>(at, &seeds, cell, 6).map(|clouds| blend(dark, light, 0.5 + 0.42 * clouds))
            }
            Self::Wood { light, dark, axis } => {
                grain::<PRECISION, N>(&at.position, axis, &seeds, &at.footprint).map(|tone| blend(dark, light, tone))
            }
            Self::Planks { light, dark, width, length } => {
                planks::<PRECISION, N>(at, light, dark, [width, length], &seeds)
            }
            Self::Bricks { light, dark } => {
                let (ragged, clouds) = (
                    noise::<PRECISION, N>(at, &salted(&seeds, 0x3c), 40.0, 2),
                    noise::<PRECISION, N>(at, &seeds, 64.0, 5),
                );
                each(at, &seeds, wanted, |i, spot| bricks(spot, light, dark, [ragged[i], clouds[i]]))
            }
            Self::Woven { warp, weft, thread } => {
                let (motif, wear) = (
                    noise::<PRECISION, N>(at, &salted(&seeds, 0x19), 170.0, 3),
                    noise::<PRECISION, N>(at, &seeds, 45.0, 4),
                );
                each(at, &seeds, wanted, |i, spot| woven(spot, warp, weft, thread, [motif[i], wear[i]]))
            }
            Self::Blots { ground, cell } => {
                let wash = noise::<PRECISION, N>(at, &seeds, 2.0 * cell, 6);
                each(at, &seeds, wanted, |i, spot| blots(spot, ground, cell, wash[i]))
            }
            Self::Book { cloth, ink } => {
                let linen = noise::<PRECISION, N>(at, &seeds, 30.0, 3);
                each(at, &seeds, wanted, |i, spot| book(spot, cloth, ink, linen[i]))
            }
            Self::Leaf { light, dark } => leaf::<PRECISION, N>(at, light, dark, &seeds),
            Self::Garden { height } => {
                let (foliage, clouds) = (
                    noise::<PRECISION, N>(at, &seeds, 220.0, 6),
                    noise::<PRECISION, N>(at, &salted(&seeds, 0x5a), 300.0, 4),
                );
                each(at, &seeds, wanted, |i, spot| garden(spot, height, [foliage[i], clouds[i]]))
            }
            Self::Print(sheet) => each(at, &seeds, wanted, |_, spot| sheet.ink(spot.uv, spot.face == 1)),
        }
    }
}

/// Noise at points on a surface.
#[inline(always)]
fn noise<const PRECISION: u8, const N: usize>(
    at: &SurfacePoints<N>,
    seeds: &[u32; N],
    cell: f64,
    count: u32,
) -> [f32; N] {
    octaves::<PRECISION, N>(&at.position, cell, count, seeds, &at.footprint)
}

#[inline(always)]
fn octaves<const PRECISION: u8, const N: usize>(
    position: &Triples<N>,
    cell: f64,
    count: u32,
    seeds: &[u32; N],
    footprint: &[f64; N],
) -> [f32; N] {
    match PRECISION {
        EXACT => texture_noise::octaves(position, cell, count, seeds, footprint),
        _ => quick_noise::octaves(&singles(position), cell, count, seeds, footprint),
    }
}

/// Seeds of another noise at the same points.
#[inline(always)]
fn salted<const N: usize>(seeds: &[u32; N], salt: u32) -> [u32; N] {
    let mut salted = *seeds;
    salted.iter_mut().for_each(|seed| *seed ^= salt);
    salted
}

/// One of some points on a surface.
struct Spot {
    /// Coordinates in mm along the surface.
    uv: [f64; 2],
    face: u32,
    /// Extent of a pixel, mm.
    footprint: f64,
    seed: u32,
}

/// The colours of those points that are wanted, one by one.
#[inline(always)]
fn each<const N: usize>(
    at: &SurfacePoints<N>,
    seeds: &[u32; N],
    wanted: &[bool; N],
    colour: impl Fn(usize, &Spot) -> Rgb,
) -> [Rgb; N] {
    std::array::from_fn(|i| {
        let uv = [at.uv[0][i], at.uv[1][i]];
        let spot = Spot { uv, face: at.face[i], footprint: at.footprint[i], seed: seeds[i] };
        if wanted[i] { colour(i, &spot) } else { [0.0; 3] }
    })
}

/// From `a` at 0 to `b` at 1, a little beyond either end allowed, never negative.
pub fn blend(a: Rgb, b: Rgb, t: f32) -> Rgb {
    let t = t.clamp(-0.15, 1.15);
    std::array::from_fn(|i| (a[i] + (b[i] - a[i]) * t).max(0.0))
}

fn scaled(colour: Rgb, factor: f32) -> Rgb {
    colour.map(|c| c * factor)
}

/// A saturated colour of print, from `hash`.
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
    let ink = INKS[(fraction(hash, 40) * INKS.len() as f32) as usize % INKS.len()];
    scaled(ink, 0.7 + 0.5 * fraction(hash, 41))
}

/// Streaks stretched eightfold along `axis`, and pores that are not; 0 dark to 1 light.
#[inline(always)]
fn grain<const PRECISION: u8, const N: usize>(
    position: &Triples<N>,
    axis: usize,
    seeds: &[u32; N],
    footprint: &[f64; N],
) -> [f32; N] {
    let mut stretched = *position;
    stretched[axis].iter_mut().for_each(|component| *component *= 0.125);
    let streaks = octaves::<PRECISION, N>(&stretched, 48.0, 4, seeds, footprint);
    let clouds = octaves::<PRECISION, N>(position, 60.0, 4, &salted(seeds, 0x77), footprint);
    let mut tones = [0.0; N];
    for i in 0..N {
        tones[i] = 0.5 + 0.34 * streaks[i] + 0.24 * clouds[i];
    }
    tones
}

/// How far `offset` in a cell of `size` (mm) is from the cell's border, as 0 on the joint of `joint` mm and 1 inside.
fn joint(offset: f32, size: f64, joint: f64, footprint: f64) -> f32 {
    let from_border = f64::from(offset.min(1.0 - offset)) * size;
    let half = 0.5 * joint;
    let soft = half.max(footprint);
    smoothstep((half - 0.5 * soft) as f32, (half + 0.5 * soft) as f32, from_border as f32)
}

#[inline(always)]
fn planks<const PRECISION: u8, const N: usize>(
    at: &SurfacePoints<N>,
    light: Rgb,
    dark: Rgb,
    [width, length]: [f64; 2],
    seeds: &[u32; N],
) -> [Rgb; N] {
    const GAP: f64 = 5.0;
    let places: [_; N] = std::array::from_fn(|i| {
        let (plank, across) = split(at.uv[0][i] / width);
        let shift = f64::from(fraction(cell_hash(plank, 0, seeds[i]), 1));
        let (piece, along) = split(at.uv[1][i] / length + shift);
        (cell_hash(plank, piece, seeds[i]), across, along)
    });
    let grains = grain::<PRECISION, N>(&at.position, 1, &places.map(|(hash, ..)| hash), &at.footprint);
    std::array::from_fn(|i| {
        let (hash, across, along) = places[i];
        let tone = 0.35 * (fraction(hash, 2) - 0.5) + grains[i];
        let gap = joint(across, width, GAP, at.footprint[i]) * joint(along, length, GAP, at.footprint[i]);
        scaled(blend(dark, light, tone), 0.35 + 0.65 * gap)
    })
}

fn bricks(at: &Spot, light: Rgb, dark: Rgb, [ragged, clouds]: [f32; 2]) -> Rgb {
    const LENGTH: f64 = 230.0;
    const HEIGHT: f64 = 77.0;
    const MORTAR: f64 = 13.0;
    const GREY: Rgb = [0.36, 0.34, 0.31];
    let ragged = 3.0 * f64::from(ragged);
    let (course, v) = split((at.uv[1] + ragged) / HEIGHT);
    let (brick, u) = split((at.uv[0] + ragged) / LENGTH + 0.5 * f64::from(course & 1));
    let hash = cell_hash(brick, course, at.seed);
    let tone = 0.5 + 0.9 * (fraction(hash, 1) - 0.5) + 0.38 * clouds;
    let fired = blend(dark, light, tone);
    let fired = [fired[0], fired[1] * (0.85 + 0.4 * fraction(hash, 2)), fired[2] * (0.8 + 0.5 * fraction(hash, 3))];
    let inside = joint(u, LENGTH, MORTAR, at.footprint) * joint(v, HEIGHT, MORTAR, at.footprint);
    blend(scaled(GREY, 1.0 + 0.35 * clouds), fired, inside)
}

fn woven(at: &Spot, warp: Rgb, weft: Rgb, thread: f64, [motif, wear]: [f32; 2]) -> Rgb {
    let ((i, u), (j, v)) = (split(at.uv[0] / thread), split(at.uv[1] / thread));
    let on_top = (i ^ j) & 1 == 0;
    let (colour, across, number) =
        if on_top { (warp, u, cell_hash(i, 1, at.seed)) } else { (weft, v, cell_hash(2, j, at.seed)) };
    let fine = survival(thread, at.footprint);
    let dyed = 1.0 + fine * 0.5 * (fraction(number, 1) - 0.5);
    let round = 1.0 - fine * 0.45 * (2.0 * across - 1.0).powi(2);
    let cloth = blend(blend(warp, weft, 0.5), colour, fine);
    let wear = 1.0 + 0.3 * wear;
    let pattern = smoothstep(-0.12, 0.12, motif);
    scaled(blend(cloth, blend(weft, warp, pattern), 0.6), dyed * round * wear)
}

fn blots(at: &Spot, ground: Rgb, cell: f64, wash: f32) -> Rgb {
    const LAYERS: u32 = 5;
    let mut colour = scaled(ground, 1.0 + 0.35 * wash);
    let (mut size, [mut x, mut y]) = (cell, at.uv);
    for layer in 0..LAYERS {
        let fine = survival(0.6 * size, at.footprint);
        if fine <= 0.0 {
            break;
        }
        let seed = at.seed.wrapping_add(layer.wrapping_mul(0x2545_f491));
        let shift = f64::from(fraction(seed, 7));
        let ((i, u), (j, v)) = (split(x / size + shift), split(y / size - shift));
        let hash = cell_hash(i, j, seed);
        let cover = blot(hash, [u - 0.5, v - 0.5], (at.footprint / size) as f32) * fine;
        if cover > 0.0 {
            colour = blend(colour, scaled(pigment(hash), 1.0 + 0.2 * wash), 0.9 * cover);
        }
        // The layers are turned against each other (by the angle of the 3-4-5 triangle), lest their cells show.
        (x, y) = (0.8 * x - 0.6 * y, 0.6 * x + 0.8 * y);
        size *= 0.56;
    }
    colour
}

/// Coverage, 0 to 1, of the point `p` (from the middle of the cell) by one random shape in a cell of side 1.
fn blot(hash: u32, p: [f32; 2], footprint: f32) -> f32 {
    const EMPTY: f32 = 0.25;
    if fraction(hash, 0) < EMPTY {
        return 0.0;
    }
    let radius = 0.14 + 0.24 * fraction(hash, 1);
    let room = 0.48 - radius;
    let place = |salt: u32| (2.0 * fraction(hash, salt) - 1.0) * room;
    let (x, y) = (p[0] - place(2), p[1] - place(3));
    let soft = footprint.max(0.03);
    // No shape reaches so far: the corners of bars and squares are within 1.05 radii.
    if x * x + y * y > (1.1 * radius + soft).powi(2) {
        return 0.0;
    }
    let (sin, cos) = (std::f32::consts::TAU * fraction(hash, 4)).sin_cos();
    let (x, y) = (cos * x - sin * y, sin * x + cos * y);
    let from_edge = match (fraction(hash, 5) * 4.0) as u32 {
        0 => radius - x.hypot(y),
        1 => 0.3 * radius - (x.hypot(y) - 0.7 * radius).abs(),
        2 => (radius - x.abs()).min(0.3 * radius - y.abs()),
        _ => 0.7 * radius - x.abs().max(y.abs()),
    };
    smoothstep(-0.5 * soft, 0.5 * soft, from_edge)
}

fn book(at: &Spot, cloth: Rgb, ink: Rgb, linen: f32) -> Rgb {
    const BAND: f64 = 23.0;
    const LETTER: f64 = 8.0;
    let linen = 1.0 + 0.35 * linen;
    let (band, within) = split(at.uv[1] / BAND);
    let kind = fraction(cell_hash(band, 3, at.seed), 1);
    let (i, u) = split(at.uv[0] / LETTER);
    let (j, v) = split(at.uv[1] / LETTER);
    let letter = fraction(cell_hash(i, j, at.seed), 2) > 0.45 && (0.1..0.9).contains(&u) && (0.15..0.85).contains(&v);
    let cover = match kind {
        k if k < 0.22 => joint(within, BAND, 6.0, at.footprint),
        k if k < 0.55 => f32::from(letter) * survival(LETTER, at.footprint),
        _ => 0.0,
    };
    scaled(blend(cloth, ink, cover), linen)
}

#[inline(always)]
fn leaf<const PRECISION: u8, const N: usize>(
    at: &SurfacePoints<N>,
    light: Rgb,
    dark: Rgb,
    seeds: &[u32; N],
) -> [Rgb; N] {
    let [from_rib, along] = at.uv;
    let mut slanted = along;
    slanted.iter_mut().zip(&from_rib).for_each(|(slanted, from_rib)| *slanted -= from_rib.abs());
    let across = [from_rib, slanted, [0.0; N]];
    let veins = octaves::<PRECISION, N>(&across, 26.0, 4, seeds, &at.footprint);
    std::array::from_fn(|i| {
        let rib = smoothstep(5.0, 2.0, at.uv[0][i].abs() as f32) * survival(6.0, at.footprint[i]);
        blend(dark, light, 0.5 + 0.5 * veins[i] + 0.6 * rib)
    })
}

/// Sky, a tree line and a lawn.
fn garden(at: &Spot, height: f64, [foliage, clouds]: [f32; 2]) -> Rgb {
    const SKY: Rgb = [0.75, 0.86, 1.0];
    const CLOUD: Rgb = [1.0, 1.0, 0.98];
    const DARK_LEAVES: Rgb = [0.04, 0.09, 0.03];
    const LIGHT_LEAVES: Rgb = [0.30, 0.42, 0.14];
    const LAWN: Rgb = [0.26, 0.44, 0.12];
    let level = (at.uv[1] / height) as f32 + 0.12 * foliage;
    let sky = blend(SKY, CLOUD, 0.5 + clouds);
    let trees = blend(DARK_LEAVES, LIGHT_LEAVES, 0.5 + 0.7 * foliage);
    let beyond = blend(sky, trees, smoothstep(-0.08, -0.05, level));
    blend(beyond, scaled(LAWN, 1.0 + 0.5 * foliage), smoothstep(0.22, 0.26, level))
}
