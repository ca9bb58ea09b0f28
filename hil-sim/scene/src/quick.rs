//! Images in real time, for cameras that run live.
//!
//! Of each pixel one ray is cast, through its centre, and a texture is faded to the size of the pixel; some more rays are cast where that
//! ray or a neighbour's meets something else, or another light. A ray that meets what a neighbour shows takes the neighbour's light. What depends on lens and pixel alone is computed once, in a [`RayTable`].
//! What the rays through the centres meet is kept while neither the camera nor what it sees moves: then only noise and edges are new.
//! Nothing is displaced from where [`render`](crate::render) shows it: places on a pixel's square are symmetric about its centre.

use std::sync::{Arc, Mutex, PoisonError};

use image::RgbImage;
use rayon::prelude::*;
use vergence_vision::{Angle, Camera, ImageSize, Transform, World};

use crate::Optics;
use crate::lens::Lens;
use crate::packet::QUICK_LANES;
use crate::quick_bundle::{Block, QuickBundle};
use crate::quick_canvas::{Canvas, CanvasRows};
use crate::quick_edges::EdgeRows;
use crate::quick_eye::{Eye, TileEyes};
use crate::quick_glance::Glance;
use crate::quick_sensor::develop;
use crate::rays::directions_of_all;
use crate::render::{Rows, View};
use crate::sight::Sight;
use crate::texture::Rgb;
use crate::texture_noise::mix64;

/// Number of rows that one task renders: some tiles.
pub const BAND: usize = 2 * TILE;

/// Rows and columns of pixels whose rays are followed side by side: what is side by side shows few surfaces.
pub const TILE: usize = 8;

/// What a lens does with each pixel: computed once for all images of the size of its sensor.
#[derive(Clone, Debug)]
pub struct RayTable {
    pub(crate) size: ImageSize,
    /// Components of the rays of the pixels and one more on every side, row by row, in the camera's frame. Not numbers outside the field.
    pub(crate) rays: [Vec<f32>; 3],
    /// Of the pixels: radians from one to the next.
    pub(crate) pitches: Vec<f32>,
    /// The share of the light that passes the lens.
    pub(crate) exposures: Vec<f32>,
    /// Variance of the lens's own spot, in square pixels.
    pub(crate) spots: Vec<f32>,
    /// How far along the axis from the camera's origin light crosses it, mm.
    pub(crate) pupils: Vec<f32>,
    /// The cosine of the largest angle of light to the axis.
    pub(crate) least_z: f32,
    /// Of earlier images: what the next one shows too, or at least its memory, since new memory takes the system a tenth of an image's time.
    kept: Arc<Mutex<Vec<Glance>>>,
}

impl RayTable {
    /// Of a camera with this lens.
    #[must_use]
    pub fn new(lens: &dyn Lens, optics: &Optics) -> Self {
        let (size, lens_rays) = (lens.size(), lens.rays());
        let rays = directions_of_all(size, &lens_rays);
        let (width, stride) = (size.width as usize, size.width as usize + 2);
        let inner = rays.par_chunks(stride).skip(1).take(size.height as usize);
        let mut planes = [(); 4].map(|()| vec![0.0; width * size.height as usize]);
        let [pitches, exposures, spots, pupils] = planes.each_mut().map(|plane| plane.par_chunks_mut(width.max(1)));
        let rows = pitches.zip(exposures).zip(spots.zip(pupils)).zip(inner);
        rows.for_each(|(((pitches, exposures), (spots, pupils)), rays)| {
            for (x, ray) in rays[1..=width].iter().enumerate().filter(|(_, ray)| !ray[2].is_nan()) {
                let theta = Angle::from_rad(ray[2].clamp(-1.0, 1.0).acos());
                pitches[x] = (1.0 / lens.pixels_per_radian(theta)) as f32;
                exposures[x] = optics.light_at(theta, lens) as f32;
                spots[x] = lens.spot_variance(theta) as f32;
                pupils[x] = lens.pupil(theta).map_or(0.0, |shift| shift.mm() as f32);
            }
        });
        let [pitches, exposures, spots, pupils] = planes;
        Self {
            size,
            rays: [0, 1, 2].map(|axis| rays.iter().map(|ray| ray[axis] as f32).collect()),
            pitches,
            exposures,
            spots,
            pupils,
            least_z: lens.theta_max().rad().cos() as f32,
            kept: Arc::default(),
        }
    }

    /// Whether a pixel is within the field.
    pub(crate) fn is_seen(&self, x: usize, y: usize) -> bool {
        !self.rays[2][(y + 1) * (self.size.width as usize + 2) + x + 1].is_nan()
    }

    /// The rays of the tile of pixels whose first is (`x`, `y`).
    fn tile(&self, x: usize, y: usize, eyes: &TileEyes, block: &mut Block) {
        let (width, height) = (self.size.width as usize, self.size.height as usize);
        let (mut pupils, mut rays) = ([0.0; QUICK_LANES], [[f32::NAN; QUICK_LANES]; 3]);
        let columns = TILE.min(width - x);
        for row in 0..TILE.min(height - y) {
            let (lanes, pixel) = (row * TILE..row * TILE + columns, (y + row) * width + x);
            let from = (y + row + 1) * (width + 2) + x + 1;
            for (rays, component) in rays.iter_mut().zip(&self.rays) {
                copy_row(&mut rays[lanes.clone()], &component[from..from + columns]);
            }
            copy_row(&mut pupils[lanes.clone()], &self.pupils[pixel..pixel + columns]);
            copy_row(&mut block.spreads[lanes], &self.pitches[pixel..pixel + columns]);
        }
        eyes.aim(&mut block.rays, &rays, &pupils);
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
    if table.pitches.is_empty() {
        return RgbImage::new(table.size.width, table.size.height);
    }
    let poses: Vec<_> = (0..table.size.height).into_par_iter().map(world_from_camera).collect();
    let eyes: Vec<Eye> = poses.iter().map(Eye::new).collect();
    let kept = table.kept.lock().unwrap_or_else(PoisonError::into_inner).pop();
    let mut glance = match kept {
        Some(glance) if glance.is_of(view.scene, &poses) => glance,
        other => looked(view, table, other.map(|other| other.canvas), poses, &eyes),
    };
    let Glance { canvas, sight, .. } = &mut glance;
    let bands = eyes.par_chunks(BAND).enumerate();
    let mut edges: Vec<_> = bands
        .map_init(EdgeRows::default, |rows, (band, eyes)| {
            rows.lights((view, table, seed), sight, (canvas, band * BAND, eyes))
        })
        .collect();
    let swap = |canvas: &mut Canvas, (pixel, light): &mut (usize, Rgb)| canvas.swap_light(*pixel, light);
    edges.iter_mut().flatten().for_each(|edge| swap(canvas, edge));
    let image = develop(canvas, table, view.optics, !mix64(seed));
    // Each image has its own rays at edges.
    edges.iter_mut().flatten().for_each(|edge| swap(canvas, edge));
    table.kept.lock().unwrap_or_else(PoisonError::into_inner).push(glance);
    image
}

/// What the rays through the centres of the pixels meet from these poses of the rows, which `eyes` are of; on a `used` canvas of the table if
/// there is one.
fn looked(
    view: &View<'_>,
    table: &RayTable,
    used: Option<Canvas>,
    poses: Vec<Transform<World, Camera>>,
    eyes: &[Eye],
) -> Glance {
    let world_from_camera = |row: u32| poses[row as usize];
    let (place, slack) = Rows { at_once: 1, world_from_camera: &world_from_camera }.reach(view);
    let sight = view.scene.sight(place, slack);
    let size = table.size;
    let mut canvas = used.unwrap_or_else(|| Canvas::new(size.width as usize, size.height as usize));
    canvas.par_bands(BAND).enumerate().for_each_init(QuickBundle::default, |bundle, (band, mut rows)| {
        look(view, table, &sight, bundle, (band * BAND, &eyes[band * BAND..]), &mut rows);
    });
    Glance::new(canvas, sight, view.scene, poses)
}

/// What the rays through the centres of the pixels of some rows meet, of which the first is row `top`.
fn look(
    view: &View<'_>,
    table: &RayTable,
    sight: &Sight,
    bundle: &mut QuickBundle,
    (top, eyes): (usize, &[Eye]),
    rows: &mut CanvasRows<'_>,
) {
    let width = table.size.width as usize;
    for (y, of_rows) in (0..rows.height()).step_by(TILE).zip(eyes.chunks(TILE)) {
        let eyes = TileEyes::new(of_rows);
        for x in (0..width).step_by(TILE) {
            let block = bundle.add_block();
            table.tile(x, top + y, &eyes, block);
            block.owners[0] = (y * width + x) as u32;
            if !block.rays.counts.iter().any(|counts| *counts) {
                bundle.drop_block();
            }
        }
    }
    bundle.follow(view.scene, sight, |_, _| None);
    for block in bundle.blocks() {
        let [left, top] = [block.owners[0] as usize % width, block.owners[0] as usize / width];
        let (columns, height) = (TILE.min(width - left), TILE.min(rows.height() - top));
        for row in 0..height {
            let lanes = row * TILE..row * TILE + columns;
            let (light, surfaces) = rows.pixels([left, top + row], columns);
            // Outside the field there is no light.
            for (shown, light) in light.into_iter().zip(&block.lights) {
                copy_row(shown, &light[lanes.clone()]);
            }
            copy_row(surfaces, &block.surfaces[lanes]);
        }
    }
    bundle.clear();
}

/// Copies a row of a tile, or what of it is within the image: of a whole one in one instruction.
#[inline(always)]
fn copy_row<T: Copy>(to: &mut [T], from: &[T]) {
    match (to.first_chunk_mut::<TILE>(), from.first_chunk::<TILE>()) {
        (Some(to), Some(from)) => *to = *from,
        _ => to.copy_from_slice(from),
    }
}
