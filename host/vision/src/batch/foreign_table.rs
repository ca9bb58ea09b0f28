//! Lenses of other programs' models as tables, both ways.

use nalgebra::Vector3;

use super::polar_table::{ASK, PlaneMap, PolarTable};
use crate::{Camera, ForeignModel, KannalaBrandt, Pixel, UnitRay};

/// Largest error of a ray, in radians.
const LARGEST_ERROR: f64 = 5e-10;
/// Places computed at a time, so that what lies between stays in the cache.
const CHUNK: usize = 2048;

/// A lens as two maps between pixels and stereographic places tan(θ/2) (cos φ, sin φ), which are smooth on the axis and past 90°.
#[derive(Debug)]
pub(crate) struct ForeignTables {
    theta_max: f64,
    /// Pixels of the lens that they are of for each of the model's.
    scale: f64,
    project: Option<PolarTable>,
    unproject: Option<PolarTable>,
}

impl ForeignTables {
    /// Of a lens that is computed by another model.
    pub(crate) fn new(lens: &KannalaBrandt) -> Self {
        let theta_max = lens.theta_max().rad();
        let unproject = Unprojection::of(lens).and_then(|map| PolarTable::new(&map));
        let scale = scale_of(lens);
        Self { theta_max, scale, project: PolarTable::new(&Projection { lens }), unproject }
    }

    /// Whether they are of this lens's field.
    #[expect(clippy::float_cmp, reason = "the same number")]
    pub(crate) fn are_of(&self, lens: &KannalaBrandt) -> bool {
        self.theta_max == lens.theta_max().rad()
    }

    /// Appends the pixels of points; `one` computes a single one. `false` where there is no table.
    pub(super) fn project(
        &self,
        lens: &KannalaBrandt,
        points: &[[f64; 3]],
        best: bool,
        one: impl Fn(&[f64; 3]) -> [f64; 2],
        pixels: &mut Vec<[f64; 2]>,
    ) -> bool {
        let Some(table) = &self.project else { return false };
        let to_lens = resampled(scale_of(lens) / self.scale);
        let mut places = Vec::with_capacity(CHUNK.min(points.len()));
        pixels.reserve(points.len());
        for chunk in points.chunks(CHUNK) {
            let first = pixels.len();
            places.clear();
            places.extend(chunk.iter().map(|&[x, y, z]| {
                let over = 1.0 / ((x * x + y * y + z * z).sqrt() + z);
                [x * over, y * over]
            }));
            table.images(&places, best, pixels);
            for (pixel, point) in pixels.iter_mut().skip(first).zip(chunk) {
                *pixel = if pixel[0] == ASK[0] { one(point) } else { to_lens(*pixel) };
            }
        }
        true
    }

    /// Appends the rays of pixels; `one` computes a single one. `false` where there is no table.
    pub(super) fn unproject(
        &self,
        lens: &KannalaBrandt,
        pixels: &[[f64; 2]],
        best: bool,
        one: impl Fn(&[f64; 2]) -> [f64; 3],
        rays: &mut Vec<[f64; 3]>,
    ) -> bool {
        let Some(table) = &self.unproject else { return false };
        let to_table = resampled(self.scale / scale_of(lens));
        let mut places = Vec::with_capacity(CHUNK.min(pixels.len()));
        let mut own = Vec::with_capacity(CHUNK.min(pixels.len()));
        rays.reserve(pixels.len());
        for chunk in pixels.chunks(CHUNK) {
            places.clear();
            own.clear();
            own.extend(chunk.iter().map(|pixel| to_table(*pixel)));
            table.images(&own, best, &mut places);
            rays.extend(places.iter().zip(chunk).map(
                |(&[a, b], pixel)| {
                    if a == ASK[0] { one(pixel) } else { ray_at([a, b]) }
                },
            ));
        }
        true
    }
}

fn scale_of(lens: &KannalaBrandt) -> f64 {
    lens.foreign_model().map_or(1.0, ForeignModel::scale)
}

/// A pixel on a sensor with `scale` pixels for each of this one's. Pixel centres are whole numbers, so the sensor's corner is at (-1/2, -1/2).
fn resampled(scale: f64) -> impl Fn([f64; 2]) -> [f64; 2] {
    let shift = 0.5 * (scale - 1.0);
    move |[u, v]| [u * scale + shift, v * scale + shift]
}

/// The ray at a stereographic place.
#[inline(always)]
fn ray_at([a, b]: [f64; 2]) -> [f64; 3] {
    let square = a * a + b * b;
    let over = 1.0 / (1.0 + square);
    [2.0 * a * over, 2.0 * b * over, (1.0 - square) * over]
}

/// From stereographic places to pixels.
struct Projection<'a> {
    lens: &'a KannalaBrandt,
}

impl PlaneMap for Projection<'_> {
    fn middle(&self) -> [f64; 2] {
        [0.0; 2]
    }

    fn middle_image(&self) -> [f64; 2] {
        self.image([0.0; 2]).unwrap_or([f64::NAN; 2])
    }

    fn rim(&self, _: f64) -> Option<f64> {
        Some((0.5 * self.lens.theta_max().rad()).tan())
    }

    fn image(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let ray = UnitRay::<Camera>::new(ray_at(place).into())?;
        self.lens.project(&ray).ok().map(|pixel| [pixel.u, pixel.v])
    }

    fn tolerance(&self) -> f64 {
        LARGEST_ERROR * self.lens.k()[0]
    }
}

/// From pixels to stereographic places.
struct Unprojection<'a> {
    lens: &'a KannalaBrandt,
    middle: Pixel,
}

impl<'a> Unprojection<'a> {
    fn of(lens: &'a KannalaBrandt) -> Option<Self> {
        let ahead = UnitRay::<Camera>::new(Vector3::z())?;
        Some(Self { lens, middle: lens.project(&ahead).ok()? })
    }

    /// From the middle to the image of the rim of the field, at an angle about the axis.
    fn rim_at(&self, phi: f64) -> Option<[f64; 2]> {
        let (sin, cos) = (self.lens.theta_max().rad() * (1.0 - 1e-15)).sin_cos();
        let ray = UnitRay::<Camera>::new(Vector3::new(sin * phi.cos(), sin * phi.sin(), cos))?;
        let pixel = self.lens.project(&ray).ok()?;
        Some([pixel.u - self.middle.u, pixel.v - self.middle.v])
    }
}

impl PlaneMap for Unprojection<'_> {
    fn middle(&self) -> [f64; 2] {
        [self.middle.u, self.middle.v]
    }

    fn middle_image(&self) -> [f64; 2] {
        [0.0; 2]
    }

    /// The image of the rim is nearly a circle: its direction is nearly that of the ray.
    fn rim(&self, direction: f64) -> Option<f64> {
        const STEPS: usize = 60;
        let (sin, cos) = direction.sin_cos();
        let mut phi = direction;
        for _ in 0..STEPS {
            let [x, y] = self.rim_at(phi)?;
            let off = (x * sin - y * cos).atan2(x * cos + y * sin);
            phi += off;
            if off.abs() < 1e-14 {
                break;
            }
        }
        let [x, y] = self.rim_at(phi)?;
        Some(x.hypot(y))
    }

    fn image(&self, [u, v]: [f64; 2]) -> Option<[f64; 2]> {
        let ray = self.lens.unproject::<Camera>(Pixel { u, v }).ok()?.vector();
        Some([ray.x / (1.0 + ray.z), ray.y / (1.0 + ray.z)])
    }

    /// A ray turns by up to twice what its stereographic place moves.
    fn tolerance(&self) -> f64 {
        0.5 * LARGEST_ERROR
    }
}
