//! Images in real time, for cameras that run live.
//!
//! Of each pixel one ray is cast, through its centre, and a texture is faded to the size of the pixel; some more rays are cast where that
//! ray or a neighbour's meets something else, or another light. A ray that meets what a neighbour shows takes the neighbour's light. What depends on lens and pixel alone is computed once, in a [`RayTable`].
//! Nothing is displaced from where [`render`](crate::render) shows it: places on a pixel's square are symmetric about its centre.

use image::RgbImage;
use nalgebra::Vector3;
use rayon::prelude::*;
use vergence_vision::{Angle, Camera, Transform, World};

use crate::Optics;
use crate::blur::spread;
use crate::lens::Lens;
use crate::quick_bundle::QuickBundle;
use crate::quick_sensor::develop;
use crate::rays::{Around, PosedLens, RayGrid, directions_of_all};
use crate::render::{Rows, View, lattice};
use crate::texture::Rgb;
use crate::texture_noise::mix64;
use crate::trace::NOTHING;

/// Further rays of a pixel at an edge between surfaces, and at one within a surface: those of prints are measured.
const EDGE_RAYS: [u32; 2] = [6, 16];

/// Number of rows that one task renders.
const BAND: usize = 8;

/// Difference of the square roots of the light of neighbours above which more rays are cast.
const EDGE: f32 = 0.4;

/// What a lens does with each pixel: computed once for all images of the size of its sensor.
#[derive(Clone, Debug)]
pub struct RayTable {
    /// Of the pixels and one more on every side, row by row, in the camera's frame. Not numbers outside the field.
    rays: Vec<[f64; 3]>,
    pixels: Vec<PixelOptics>,
}

/// What light goes through on its way to a pixel.
#[derive(Clone, Copy, Debug)]
struct PixelOptics {
    /// Radians from one pixel to the next.
    pitch: f32,
    /// The share of the light that passes the lens.
    exposure: f32,
    /// Variance of the lens's own spot, in square pixels.
    spot: f32,
}

impl RayTable {
    /// Of a camera with this lens.
    #[must_use]
    pub fn new(lens: &dyn Lens, optics: &Optics) -> Self {
        let (size, lens_rays) = (lens.size(), lens.rays());
        let rays = directions_of_all(size, &lens_rays);
        let of_ray = |ray: &[f64; 3]| {
            let theta = Angle::from_rad(ray[2].clamp(-1.0, 1.0).acos());
            PixelOptics {
                pitch: (1.0 / lens.pixels_per_radian(theta)) as f32,
                exposure: optics.light_at(theta, lens) as f32,
                spot: if ray[2].is_nan() { 0.0 } else { lens.spot_variance(theta) as f32 },
            }
        };
        let (width, stride) = (size.width as usize, size.width as usize + 2);
        let inner = rays.par_chunks(stride).skip(1).take(size.height as usize);
        let pixels = inner.flat_map_iter(|row| row[1..=width].iter().map(of_ray)).collect();
        Self { rays, pixels }
    }
}

/// What the ray through the centre of a pixel meets.
#[derive(Clone, Copy)]
struct Glance {
    light: Rgb,
    /// The square root of the mean of its colours.
    level: f32,
    /// Number of the surface; [`NOTHING`] where nothing is met, and outside the field.
    surface: u32,
}

impl Default for Glance {
    fn default() -> Self {
        Self { light: [0.0; 3], level: 0.0, surface: NOTHING }
    }
}

/// Renders a view in real time, every row from the pose that `world_from_camera` gives for it. `table` is of the lens and the optics of the
/// view, whose numbers of samples do not matter. The same `seed` gives the same bytes on any number of threads.
#[must_use]
pub fn render_quick(
    view: &View<'_>,
    table: &RayTable,
    seed: u64,
    world_from_camera: &(dyn Fn(u32) -> Transform<World, Camera> + Sync),
) -> RgbImage {
    let (size, rows) = (view.camera.size(), Rows { at_once: 1, world_from_camera });
    let width = (size.width as usize).max(1);
    let (place, slack) = rows.reach(view);
    let (sight, lens_rays) = (view.scene.sight(place, slack), view.camera.rays());
    let eyes = |top: usize, rows: usize| -> Vec<PosedLens<'_>> {
        (top..top + rows).map(|y| PosedLens::new(view.camera, &lens_rays, &world_from_camera(y as u32))).collect()
    };

    let mut glances = vec![Glance::default(); table.pixels.len()];
    glances.par_chunks_mut(width * BAND).enumerate().for_each(|(band, glances)| {
        let (top, rows) = (band * BAND, glances.len() / width);
        let eyes = eyes(top, rows);
        let mut centres = QuickBundle::default();
        for [x, y] in tiled(width, rows) {
            let (y_of_image, optics) = (top + y, &table.pixels[(top + y) * width + x]);
            let grid = RayGrid::of_table(&eyes[y], &table.rays, size.width);
            if let Some(around) = grid.around(x as u32, y_of_image as u32) {
                centres.push(y * width + x, around.start(&around.centre()), around.centre(), optics.pitch);
            }
        }
        centres.follow(
            view.scene,
            &sight,
            |_, _| true,
            |at, surface, light| {
                glances[at] = Glance { light, level: (light.iter().sum::<f32>() / 3.0).sqrt(), surface };
            },
        );
    });

    let mut image = vec![[0.0; 3]; glances.len()];
    image.par_chunks_mut(width * BAND).enumerate().for_each(|(band, pixels)| {
        let (top, first) = (band * BAND, band * BAND * width);
        let eyes = eyes(top, pixels.len() / width);
        let (mut rays, mut edges, mut counts) = (QuickBundle::default(), Vec::new(), vec![1.0; pixels.len()]);
        for (at, pixel) in pixels.iter_mut().enumerate() {
            let [x, y] = [at % width, at / width];
            *pixel = glances[first + at].light;
            let Some(edge) = edge(&glances, width, x, top + y) else { continue };
            let grid = RayGrid::of_table(&eyes[y], &table.rays, size.width);
            let Some(around) = grid.around(x as u32, (top + y) as u32) else { continue };
            let pitch = table.pixels[first + at].pitch;
            let places = EDGE_RAYS[usize::from(edge.within)];
            // A ray outside the field brings no light.
            for ray in rays_of(&around, lattice(places, mix64(seed ^ (first + at) as u64))) {
                rays.push(edges.len(), around.start(&ray), ray, pitch);
            }
            counts[at] += places as f32;
            edges.push((at, edge));
        }
        rays.follow(
            view.scene,
            &sight,
            |edge, surface| edges[edge].1.light_of(&glances, surface).is_none(),
            |edge, surface, light| {
                let (at, edge) = &edges[edge];
                let light = edge.light_of(&glances, surface).unwrap_or(light);
                pixels[*at] = [0, 1, 2].map(|i| pixels[*at][i] + light[i]);
            },
        );
        for ((pixel, optics), count) in pixels.iter_mut().zip(&table.pixels[first..]).zip(counts) {
            *pixel = pixel.map(|c| c * optics.exposure / count);
        }
    });
    let spots: Vec<f32> = table.pixels.iter().map(|pixel| pixel.spot).collect();
    develop(&spread(&image, width, view.optics.blur_px, &spots), &table.rays, view, !mix64(seed))
}

/// The places (x, y) of a band of so many columns and rows, square by square: what is side by side shows few surfaces.
fn tiled(columns: usize, rows: usize) -> impl Iterator<Item = [usize; 2]> {
    const SIDE: usize = 4;
    let tops = (0..rows).step_by(SIDE).flat_map(move |top| (0..columns).step_by(SIDE).map(move |left| [left, top]));
    tops.flat_map(move |[left, top]| {
        let of_tile = move |y| (left..(left + SIDE).min(columns)).map(move |x| [x, y]);
        (top..(top + SIDE).min(rows)).flat_map(of_tile)
    })
}

/// The rays through these places on a pixel, in pixels from its centre. Between neighbours they are taken to change evenly, which is wrong by
/// less than a thousandth of a pixel.
fn rays_of(around: &Around<'_>, places: impl Iterator<Item = [f64; 2]>) -> impl Iterator<Item = Vector3<f64>> {
    let (centre, slopes) = (around.centre(), around.slopes());
    let nearby = slopes.is_none().then(|| around.nearby());
    places.filter_map(move |place| match slopes {
        Some([du, dv]) => Some(centre + du * place[0] + dv * place[1]),
        None => nearby.as_ref()?.at(place),
    })
}

/// A pixel, then those left, right, above and below of it, one of which shows something else; itself again in place of those beside the image.
struct Edge {
    pixels: [usize; 5],
    /// Whether the light differs much within one surface, which the rays then must see for themselves.
    within: bool,
}

impl Edge {
    /// The light of a surface that one of the pixels shows.
    fn light_of(&self, glances: &[Glance], surface: u32) -> Option<Rgb> {
        let mut shown = self.pixels.iter().map(|pixel| &glances[*pixel]);
        shown.find(|glance| glance.surface == surface && !self.within).map(|glance| glance.light)
    }
}

/// The edge at a pixel, if it shows something else than one beside, above or below it.
fn edge(glances: &[Glance], width: usize, x: usize, y: usize) -> Option<Edge> {
    let at = y * width + x;
    let beside = |is_there: bool, other: usize| if is_there { other } else { at };
    let pixels = [
        at,
        beside(x > 0, at.saturating_sub(1)),
        beside(x + 1 < width, at + 1),
        beside(y > 0, at.saturating_sub(width)),
        beside(at + width < glances.len(), at + width),
    ];
    let here = &glances[at];
    let (mut within, mut differs) = (false, false);
    for other in pixels.map(|pixel| &glances[pixel]) {
        let is_same = other.surface == here.surface;
        within |= is_same & ((other.level - here.level).abs() > EDGE);
        differs |= !is_same;
    }
    (within | differs).then_some(Edge { pixels, within })
}
