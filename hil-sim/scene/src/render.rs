//! Images of a scene, with the true range of each pixel.

use image::RgbImage;
use nalgebra::Vector3;
use rayon::prelude::*;
use vergence_vision::{Angle, Camera, Length, Pixel, Transform, World};

use crate::blur::spread;
use crate::bundle::Bundle;
use crate::lens::{Lens, LensRays};
use crate::optics::unit_pair;
use crate::outlook::Outlook;
use crate::rays::{Around, PosedLens, RayGrid, directions_of_all};
use crate::texture::Rgb;
use crate::texture_noise::mix64;
use crate::trace::NOTHING;
use crate::{Optics, RangeMap, Scene};

/// Number of rows that one task renders.
const BAND: usize = 16;

/// Contrast between the first rays of a pixel above which more are cast.
const EDGE: f32 = 0.14;

/// The same between a pixel and its neighbours, for edges that cross the pixel where its first rays missed them.
const STRONG_EDGE: f32 = 0.3;

/// A camera in front of a scene.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The scene.
    pub scene: &'a Scene,
    /// The lens, and the size of the image.
    pub camera: &'a dyn Lens,
    /// The pose of the camera.
    pub world_from_camera: Transform<World, Camera>,
    /// Imperfections of its lens and sensor.
    pub optics: &'a Optics,
}

/// An image and its ground truth.
#[derive(Clone, Debug, PartialEq)]
pub struct Photograph {
    /// 8-bit sRGB. Black outside the lens's field.
    pub image: RgbImage,
    /// Exact range of each pixel.
    pub range: RangeMap,
}

/// Renders a view. `seed` drives the noise and the choice of rays: the same seed gives the same bytes, on any
/// number of threads; other seeds give other noise on the same image.
///
/// A few rays are cast for every pixel, many more for those at an edge. A pixel is the mean of the light on its square,
/// which the lens then spreads. Both are symmetric about the centre of the pixel and the same everywhere, so that
/// nothing is displaced from where it is projected.
#[must_use]
pub fn render(view: &View<'_>, seed: u64) -> Photograph {
    photograph(view, seed, Rows { at_once: BAND, world_from_camera: &|_| view.world_from_camera })
}

/// Renders a view through a rolling shutter: every row from the pose that `world_from_camera` gives for it. Nothing
/// moves while a row is exposed, so that motion does not blur.
#[must_use]
pub fn render_rolling(
    view: &View<'_>,
    seed: u64,
    world_from_camera: &(dyn Fn(u32) -> Transform<World, Camera> + Sync),
) -> Photograph {
    photograph(view, seed, Rows { at_once: 1, world_from_camera })
}

/// The number of neighbouring rows that are exposed at once, and the pose of the camera then.
#[derive(Clone, Copy)]
pub struct Rows<'a> {
    pub at_once: usize,
    pub world_from_camera: &'a (dyn Fn(u32) -> Transform<World, Camera> + Sync),
}

impl Rows<'_> {
    /// The view at the exposure of a row.
    fn view<'v>(&self, view: &View<'v>, row: u32) -> View<'v> {
        View { world_from_camera: (self.world_from_camera)(row), ..*view }
    }

    /// What the camera may see while it takes the image: from about the middle of its way.
    pub fn outlook(&self, view: &View<'_>) -> Outlook {
        let (place, slack) = self.reach(view);
        view.scene.outlook(place, slack)
    }

    /// A place, and how far from it (mm) rays start at most.
    pub fn reach(&self, view: &View<'_>) -> (Vector3<f64>, f64) {
        const PUPILS: u32 = 32;
        const MARGIN_MM: f64 = 0.1;
        let height = view.camera.size().height;
        let at = |row: u32| (self.world_from_camera)(row).origin().mm();
        let place = at(height / 2);
        let moved = [0, height.saturating_sub(1)].map(|row| (at(row) - place).norm());
        let pupils = (0..=PUPILS).filter_map(|step| {
            let theta = view.camera.theta_max().rad() * f64::from(step) / f64::from(PUPILS);
            view.camera.pupil(Angle::from_rad(theta))
        });
        let shift = pupils.map(|shift| shift.mm().abs()).fold(0.0, f64::max);
        (place, moved[0].max(moved[1]) + shift + MARGIN_MM)
    }
}

fn photograph(view: &View<'_>, seed: u64, rows: Rows<'_>) -> Photograph {
    let size = view.camera.size();
    let width = (size.width as usize).max(1);
    let seed_of = |x: usize, y: usize| mix64(mix64(seed) ^ (y * width + x) as u64);
    let pixels = size.width as usize * size.height as usize;

    let lens = view.camera.rays();
    let rays = Rays { lens: &lens, of_pixels: &directions_of_all(size, &lens) };
    let outlook = rows.outlook(view);
    let samples = view.optics.samples;
    let mut firsts = vec![First::default(); pixels];
    for_each_row(view, rows, rays, &mut firsts, |firsts, here, grid, y| {
        let (mut centres, mut around_them) = (Bundle::default(), Bundle::default());
        for (x, first) in firsts.iter_mut().enumerate() {
            let Some(around) = grid.around(x as u32, y as u32) else { continue };
            *first = here.first(&around);
            centres.push(x, around.start(&around.centre()), around.centre(), first.pitch);
            if samples > 1 {
                let places = lattice(samples, seed_of(x, y));
                first.samples = gather(&mut around_them, x, &around, first.pitch, places);
            }
        }
        let is_enough = samples <= 1;
        centres.follow(
            view.scene,
            &outlook,
            |_, _| is_enough,
            |x, found| {
                firsts[x].range_mm = if found.surface == NOTHING { f32::NAN } else { found.range_mm as f32 };
                if is_enough {
                    firsts[x].samples = firsts[x].samples.with(found.light);
                }
            },
        );
        around_them.follow(
            view.scene,
            &outlook,
            |_, _| true,
            |x, found| {
                firsts[x].samples = firsts[x].samples.with(found.light);
            },
        );
    });

    let mut light = vec![[0.0; 3]; pixels];
    for_each_row(view, rows, rays, &mut light, |light, _, grid, y| {
        let mut edges = Bundle::default();
        let mut more = vec![LightSamples::default(); width];
        for (x, more) in more.iter_mut().enumerate().filter(|(x, _)| is_edge(&firsts, width, *x, y)) {
            let Some(around) = grid.around(x as u32, y as u32) else { continue };
            let places = lattice(view.optics.edge_samples, mix64(seed_of(x, y)));
            *more = gather(&mut edges, x, &around, firsts[y * width + x].pitch, places);
        }
        edges.follow(view.scene, &outlook, |_, _| true, |x, found| more[x] = more[x].with(found.light));
        for ((light, first), more) in light.iter_mut().zip(&firsts[y * width..]).zip(more) {
            let samples = first.samples.joined(more);
            let exposure = first.exposure / samples.count.max(1) as f32;
            *light = samples.sum.map(|c| c * exposure);
        }
    });

    let spots: Vec<f32> = firsts.iter().map(|first| first.spot).collect();
    let light = spread(&light, width, view.optics.blur_px, &spots);
    let mut image = RgbImage::new(size.width, size.height);
    image.par_chunks_exact_mut(3).zip(&light).zip(&firsts).enumerate().for_each(|(i, ((pixel, light), first))| {
        if first.samples.count > 0 {
            pixel.copy_from_slice(&view.optics.expose(*light, !seed_of(i % width, i / width)));
        }
    });
    let mm = firsts.into_iter().map(|first| first.range_mm).collect();
    Photograph { image, range: RangeMap::new(size, mm) }
}

/// Whether a pixel needs more rays.
fn is_edge(firsts: &[First], width: usize, x: usize, y: usize) -> bool {
    let samples = firsts[y * width + x].samples;
    let rows = y.saturating_sub(1)..(y + 2).min(firsts.len() / width);
    let columns = x.saturating_sub(1)..(x + 2).min(width);
    let near = rows.flat_map(|y| &firsts[y * width..][columns.clone()]).map(|first| first.samples);
    samples.contrast() > EDGE || near.fold(samples, LightSamples::joined_contrast).contrast() > STRONG_EDGE
}

/// The result of the first rays of a pixel. The default is that of a pixel outside the field.
#[derive(Clone, Copy, Debug)]
struct First {
    samples: LightSamples,
    /// Range at the centre of the pixel; not a number if its ray meets nothing.
    range_mm: f32,
    /// The share of the light that passes the lens.
    exposure: f32,
    /// Variance of the lens's own spot, in square pixels.
    spot: f32,
    /// Radians from one pixel to the next.
    pitch: f64,
}

impl Default for First {
    fn default() -> Self {
        Self { samples: LightSamples::default(), range_mm: f32::NAN, exposure: 0.0, spot: 0.0, pitch: 0.0 }
    }
}

/// The light of some rays of a pixel.
#[derive(Clone, Copy, Debug)]
struct LightSamples {
    sum: Rgb,
    count: u32,
    /// The least and the most light, as the mean of red, green and blue.
    low: f32,
    high: f32,
}

impl Default for LightSamples {
    fn default() -> Self {
        Self { sum: [0.0; 3], count: 0, low: f32::INFINITY, high: 0.0 }
    }
}

impl LightSamples {
    /// Adds the light of one more ray.
    fn with(self, colour: Rgb) -> Self {
        let level = colour.iter().sum::<f32>() / 3.0;
        self.joined(Self { sum: colour, count: 1, low: level, high: level })
    }

    fn joined(self, other: Self) -> Self {
        let sum = std::array::from_fn(|i| self.sum[i] + other.sum[i]);
        Self { sum, count: self.count.saturating_add(other.count), ..self.joined_contrast(other) }
    }

    /// Combines the contrast of two groups of rays.
    fn joined_contrast(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high), ..self }
    }

    /// Difference of the square roots of the light, which is about that of the grey levels / 255.
    fn contrast(&self) -> f32 {
        self.high.sqrt() - self.low.sqrt()
    }
}

/// The lens made ready, and what [`directions_of_all`] gives of it.
#[derive(Clone, Copy)]
struct Rays<'a> {
    lens: &'a LensRays<'a>,
    of_pixels: &'a [[f64; 3]],
}

/// Calls `visit(row of items, view, rays, y)`, the view as at that row, for the rows of the view, in parallel.
fn for_each_row<T: Send>(
    view: &View<'_>,
    rows: Rows<'_>,
    rays: Rays<'_>,
    items: &mut [T],
    visit: impl Fn(&mut [T], &View<'_>, &RayGrid<'_>, usize) + Sync,
) {
    let width = (view.camera.size().width as usize).max(1);
    items.par_chunks_mut(width * rows.at_once).enumerate().for_each(|(number, items)| {
        let top = number * rows.at_once;
        let here = rows.view(view, top as u32);
        let posed = PosedLens::new(view.camera, rays.lens, &here.world_from_camera);
        let grid = RayGrid::of_table(&posed, rays.of_pixels, view.camera.size().width);
        items.chunks_mut(width).enumerate().for_each(|(row, items)| visit(items, &here, &grid, top + row));
    });
}

/// Adds the rays through these `places` on the square of a pixel, and returns the light of those outside the field: none.
fn gather(
    bundle: &mut Bundle,
    owner: usize,
    around: &Around<'_>,
    pitch: f64,
    places: impl Iterator<Item = [f64; 2]>,
) -> LightSamples {
    let nearby = around.nearby();
    places.fold(LightSamples::default(), |dark, place| match nearby.at(place) {
        Some(ray) => {
            bundle.push(owner, around.start(&ray), ray, pitch);
            dark
        }
        None => dark.with([0.0; 3]),
    })
}

impl View<'_> {
    /// How far from the origin of the camera's frame the place is that a pixel shows; `None` outside the field and where nothing is met. The
    /// light of a lens without one centre starts from the pupil of its angle, while ranges count from the origin.
    #[must_use]
    pub fn true_range(&self, pixel: Pixel) -> Option<Length> {
        let (start, ray) = self.camera.light_of(pixel)?;
        let (start, ray) = (self.world_from_camera * start, self.world_from_camera * ray);
        let place = start.mm() + ray.vector() * self.scene.reach(&start, &ray)?.mm();
        Some(Length::from_mm((place - self.world_from_camera.origin().mm()).norm()))
    }

    /// What the lens does with a pixel.
    fn first(&self, around: &Around<'_>) -> First {
        let theta = self.theta(around);
        First {
            exposure: self.optics.light_at(theta, self.camera) as f32,
            spot: self.camera.spot_variance(theta) as f32,
            pitch: 1.0 / self.camera.pixels_per_radian(theta),
            ..First::default()
        }
    }

    /// The angle of a pixel's centre to the optical axis.
    fn theta(&self, around: &Around<'_>) -> Angle {
        let axis = self.world_from_camera.rotation() * Vector3::z();
        Angle::from_rad(axis.dot(&around.centre()).clamp(-1.0, 1.0).acos())
    }
}

/// `count` places on a pixel's square, in pixels from its centre, as a golden-ratio lattice turned about the square by
/// a random offset (R. Cranley and T. Patterson, SIAM J. Numer. Anal. 13, 1976): unbiased, and far less grainy than
/// independent places.
pub fn lattice(count: u32, hash: u64) -> impl Iterator<Item = [f64; 2]> {
    const GOLDEN: f64 = 0.618_033_988_749_894_9;
    let (a, b) = unit_pair(hash);
    (0..count).map(move |i| {
        let i = f64::from(i);
        [(a + i / f64::from(count)).fract() - 0.5, (b + i * GOLDEN).fract() - 0.5]
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lattice_is_uniform_on_the_square() {
        let places: Vec<[f64; 2]> = (0..20_000).flat_map(|pixel| lattice(7, mix64(pixel))).collect();
        for axis in 0..2 {
            let n = places.len() as f64;
            let mean = places.iter().map(|p| p[axis]).sum::<f64>() / n;
            let variance = places.iter().map(|p| p[axis] * p[axis]).sum::<f64>() / n;
            assert!(mean.abs() < 1e-3 && (variance * 12.0 - 1.0).abs() < 0.01, "mean {mean}, variance {variance}");
        }
    }
}
