//! Procedural materials: reflectance as a function of the place on a surface.
//!
//! Each is random at several scales and does not repeat, so that a patch of it can be found again in another image and
//! nowhere else. Features finer than the footprint of a pixel fade to their mean.

use nalgebra::Vector3;

use crate::Sheet;
use crate::shape::SurfacePoint;
use crate::texture_noise::{cell_hash, fraction, octaves, smoothstep, split, survival};

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
    /// The reflectance of the variant `seed` at the place `at`.
    pub fn reflectance(&self, at: &SurfacePoint, seed: u32) -> Rgb {
        let seed = seed.wrapping_add(at.face.wrapping_mul(0x51ed_270b));
        match *self {
            Self::Mottled { light, dark, cell } => {
                let clouds = octaves(at.position, cell, 6, seed, at.footprint);
                blend(dark, light, 0.5 + 0.42 * clouds)
            }
            Self::Wood { light, dark, axis } => blend(dark, light, grain(at.position, axis, seed, at.footprint)),
            Self::Planks { light, dark, width, length } => planks(at, light, dark, [width, length], seed),
            Self::Bricks { light, dark } => bricks(at, light, dark, seed),
            Self::Woven { warp, weft, thread } => woven(at, warp, weft, thread, seed),
            Self::Blots { ground, cell } => blots(at, ground, cell, seed),
            Self::Book { cloth, ink } => book(at, cloth, ink, seed),
            Self::Leaf { light, dark } => leaf(at, light, dark, seed),
            Self::Garden { height } => garden(at, height, seed),
            Self::Print(sheet) => sheet.ink(at.uv, at.face == 1),
        }
    }
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
fn grain(position: Vector3<f64>, axis: usize, seed: u32, footprint: f64) -> f32 {
    let mut stretched = position;
    stretched[axis] *= 0.125;
    let streaks = octaves(stretched, 48.0, 4, seed, footprint);
    let clouds = octaves(position, 60.0, 4, seed ^ 0x77, footprint);
    0.5 + 0.34 * streaks + 0.24 * clouds
}

/// How far `offset` in a cell of `size` (mm) is from the cell's border, as 0 on the joint of `joint` mm and 1 inside.
fn joint(offset: f32, size: f64, joint: f64, footprint: f64) -> f32 {
    let from_border = f64::from(offset.min(1.0 - offset)) * size;
    let half = 0.5 * joint;
    let soft = half.max(footprint);
    smoothstep((half - 0.5 * soft) as f32, (half + 0.5 * soft) as f32, from_border as f32)
}

fn planks(at: &SurfacePoint, light: Rgb, dark: Rgb, [width, length]: [f64; 2], seed: u32) -> Rgb {
    const GAP: f64 = 5.0;
    let (plank, across) = split(at.uv[0] / width);
    let shift = f64::from(fraction(cell_hash(plank, 0, seed), 1));
    let (piece, along) = split(at.uv[1] / length + shift);
    let hash = cell_hash(plank, piece, seed);
    let tone = 0.35 * (fraction(hash, 2) - 0.5) + grain(at.position, 1, hash, at.footprint);
    let gap = joint(across, width, GAP, at.footprint) * joint(along, length, GAP, at.footprint);
    scaled(blend(dark, light, tone), 0.35 + 0.65 * gap)
}

fn bricks(at: &SurfacePoint, light: Rgb, dark: Rgb, seed: u32) -> Rgb {
    const LENGTH: f64 = 230.0;
    const HEIGHT: f64 = 77.0;
    const MORTAR: f64 = 13.0;
    const GREY: Rgb = [0.36, 0.34, 0.31];
    let ragged = 3.0 * f64::from(octaves(at.position, 40.0, 2, seed ^ 0x3c, at.footprint));
    let (course, v) = split((at.uv[1] + ragged) / HEIGHT);
    let (brick, u) = split((at.uv[0] + ragged) / LENGTH + 0.5 * f64::from(course & 1));
    let hash = cell_hash(brick, course, seed);
    let clouds = octaves(at.position, 64.0, 5, seed, at.footprint);
    let tone = 0.5 + 0.9 * (fraction(hash, 1) - 0.5) + 0.38 * clouds;
    let fired = blend(dark, light, tone);
    let fired = [fired[0], fired[1] * (0.85 + 0.4 * fraction(hash, 2)), fired[2] * (0.8 + 0.5 * fraction(hash, 3))];
    let inside = joint(u, LENGTH, MORTAR, at.footprint) * joint(v, HEIGHT, MORTAR, at.footprint);
    blend(scaled(GREY, 1.0 + 0.35 * clouds), fired, inside)
}

fn woven(at: &SurfacePoint, warp: Rgb, weft: Rgb, thread: f64, seed: u32) -> Rgb {
    let ((i, u), (j, v)) = (split(at.uv[0] / thread), split(at.uv[1] / thread));
    let motif = octaves(at.position, 170.0, 3, seed ^ 0x19, at.footprint);
    let on_top = (i ^ j) & 1 == 0;
    let (colour, across, number) =
        if on_top { (warp, u, cell_hash(i, 1, seed)) } else { (weft, v, cell_hash(2, j, seed)) };
    let fine = survival(thread, at.footprint);
    let dyed = 1.0 + fine * 0.5 * (fraction(number, 1) - 0.5);
    let round = 1.0 - fine * 0.45 * (2.0 * across - 1.0).powi(2);
    let cloth = blend(blend(warp, weft, 0.5), colour, fine);
    let wear = 1.0 + 0.3 * octaves(at.position, 45.0, 4, seed, at.footprint);
    let pattern = smoothstep(-0.12, 0.12, motif);
    scaled(blend(cloth, blend(weft, warp, pattern), 0.6), dyed * round * wear)
}

fn blots(at: &SurfacePoint, ground: Rgb, cell: f64, seed: u32) -> Rgb {
    const LAYERS: u32 = 5;
    let wash = octaves(at.position, 2.0 * cell, 6, seed, at.footprint);
    let mut colour = scaled(ground, 1.0 + 0.35 * wash);
    let (mut size, [mut x, mut y]) = (cell, at.uv);
    for layer in 0..LAYERS {
        let seed = seed.wrapping_add(layer.wrapping_mul(0x2545_f491));
        let shift = f64::from(fraction(seed, 7));
        let ((i, u), (j, v)) = (split(x / size + shift), split(y / size - shift));
        let hash = cell_hash(i, j, seed);
        let cover = blot(hash, [u - 0.5, v - 0.5], (at.footprint / size) as f32) * survival(0.6 * size, at.footprint);
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
    let (sin, cos) = (std::f32::consts::TAU * fraction(hash, 4)).sin_cos();
    let (x, y) = (cos * x - sin * y, sin * x + cos * y);
    let from_edge = match (fraction(hash, 5) * 4.0) as u32 {
        0 => radius - x.hypot(y),
        1 => 0.3 * radius - (x.hypot(y) - 0.7 * radius).abs(),
        2 => (radius - x.abs()).min(0.3 * radius - y.abs()),
        _ => 0.7 * radius - x.abs().max(y.abs()),
    };
    let soft = footprint.max(0.03);
    smoothstep(-0.5 * soft, 0.5 * soft, from_edge)
}

fn book(at: &SurfacePoint, cloth: Rgb, ink: Rgb, seed: u32) -> Rgb {
    const BAND: f64 = 23.0;
    const LETTER: f64 = 8.0;
    let linen = 1.0 + 0.35 * octaves(at.position, 30.0, 3, seed, at.footprint);
    let (band, within) = split(at.uv[1] / BAND);
    let kind = fraction(cell_hash(band, 3, seed), 1);
    let (i, u) = split(at.uv[0] / LETTER);
    let (j, v) = split(at.uv[1] / LETTER);
    let letter = fraction(cell_hash(i, j, seed), 2) > 0.45 && (0.1..0.9).contains(&u) && (0.15..0.85).contains(&v);
    let cover = match kind {
        k if k < 0.22 => joint(within, BAND, 6.0, at.footprint),
        k if k < 0.55 => f32::from(letter) * survival(LETTER, at.footprint),
        _ => 0.0,
    };
    scaled(blend(cloth, ink, cover), linen)
}

fn leaf(at: &SurfacePoint, light: Rgb, dark: Rgb, seed: u32) -> Rgb {
    let veins = octaves(Vector3::new(at.uv[0], at.uv[1] - at.uv[0].abs(), 0.0), 26.0, 4, seed, at.footprint);
    let rib = smoothstep(5.0, 2.0, at.uv[0].abs() as f32) * survival(6.0, at.footprint);
    blend(dark, light, 0.5 + 0.5 * veins + 0.6 * rib)
}

/// Sky, a tree line and a lawn.
fn garden(at: &SurfacePoint, height: f64, seed: u32) -> Rgb {
    const SKY: Rgb = [0.75, 0.86, 1.0];
    const CLOUD: Rgb = [1.0, 1.0, 0.98];
    const DARK_LEAVES: Rgb = [0.04, 0.09, 0.03];
    const LIGHT_LEAVES: Rgb = [0.30, 0.42, 0.14];
    const LAWN: Rgb = [0.26, 0.44, 0.12];
    let foliage = octaves(at.position, 220.0, 6, seed, at.footprint);
    let level = (at.uv[1] / height) as f32 + 0.12 * foliage;
    let sky = blend(SKY, CLOUD, 0.5 + octaves(at.position, 300.0, 4, seed ^ 0x5a, at.footprint));
    let trees = blend(DARK_LEAVES, LIGHT_LEAVES, 0.5 + 0.7 * foliage);
    let beyond = blend(sky, trees, smoothstep(-0.08, -0.05, level));
    blend(beyond, scaled(LAWN, 1.0 + 0.5 * foliage), smoothstep(0.22, 0.26, level))
}
