//! Cost of a point by the lenses of other programs' models, beside this program's own.

use std::hint::black_box;

use serde_json::{Value, json};
use vergence_vision::{
    Angle, Asymmetry, BatchLens, CameraModel, Central, DoubleSphere, Eucm, Fisheye624, Formula, ImageSize,
    KannalaBrandt, Mei, OCam, Pinhole, Pixel, Pupil, Radtan, SightRegion, SplineGrid, SplinedStereographic, UnitRay,
    fit_lens,
};

use crate::error::BenchError;
use crate::{Clock, timed};

const SIZE: ImageSize = ImageSize { width: 2048, height: 2044 };
const SMALL: ImageSize = ImageSize { width: 1040, height: 1024 };
const PINHOLE: [f64; 4] = [600.0, 601.0, 1024.0, 1022.0];
/// How many times the polynomial's time a lens with one centre may take, and how many times its own with one centre a lens with a moving pupil.
const LIMIT: f64 = 3.0;
const PUPIL_LIMIT: f64 = 1.5;
/// Rays of an array: as many as stay in the cache.
const RAYS: u32 = 4096;

/// Nanoseconds per point of one lens, the least of all runs.
#[derive(Clone, Debug)]
pub struct LensTimes {
    /// What the lens is.
    pub name: &'static str,
    /// Rays to pixels.
    pub project_ns: f64,
    /// Pixels to rays.
    pub unproject_ns: f64,
    /// The lens that it is compared with: the polynomial, or of a moving pupil the same lens with one centre.
    pub beside: &'static str,
    /// The same over those of that lens.
    pub ratios: [f64; 2],
    /// What these ratios may be at most.
    pub limit: f64,
}

/// A ratio of times for people, which says so where it is more than `limit`.
pub(crate) fn ratio_in_words(ratio: f64, limit: f64) -> String {
    let over = if ratio > limit { ", more than allowed" } else { "" };
    format!("{ratio:.2}{over}")
}

impl LensTimes {
    /// Nanoseconds for people.
    #[must_use]
    pub fn in_words(&self) -> String {
        let ratio = |ratio| ratio_in_words(ratio, self.limit);
        format!(
            "project {:.1} ({}), unproject {:.1} ({}) times {}, {} allowed",
            self.project_ns,
            ratio(self.ratios[0]),
            self.unproject_ns,
            ratio(self.ratios[1]),
            self.beside,
            self.limit
        )
    }

    pub(crate) fn json(&self) -> Value {
        let [project_ratio, unproject_ratio] = self.ratios;
        json!({
            "lens": self.name,
            "project_ns": self.project_ns,
            "unproject_ns": self.unproject_ns,
            "project_ratio": project_ratio,
            "unproject_ratio": unproject_ratio,
            "beside": self.beside,
            "largest_ratio": self.limit,
        })
    }
}

/// Measures every lens, `repeats` times in turn.
pub(crate) fn lenses(repeats: u32, clock: Clock) -> Result<Vec<LensTimes>, BenchError> {
    let arrays = all()?.into_iter().map(|(name, lens)| Array::of(name, &lens)).collect::<Vec<_>>();
    let mut least = vec![[f64::INFINITY; 2]; arrays.len()];
    for _ in 0..repeats {
        for (array, least) in arrays.iter().zip(&mut least) {
            let seconds = array.seconds(clock);
            *least = [least[0].min(seconds[0]), least[1].min(seconds[1])];
        }
    }
    let ns: Vec<_> = least.iter().map(|seconds| seconds.map(|seconds| seconds * 1e9 / f64::from(RAYS))).collect();
    let times = |(index, (array, [project_ns, unproject_ns])): (usize, (&Array, &[f64; 2]))| {
        // A lens with a moving pupil follows the same one with one centre.
        let (beside, limit) = if array.is_central { (0, LIMIT) } else { (index - 1, PUPIL_LIMIT) };
        LensTimes {
            name: array.name,
            project_ns: *project_ns,
            unproject_ns: *unproject_ns,
            beside: arrays[beside].name,
            ratios: [project_ns / ns[beside][0], unproject_ns / ns[beside][1]],
            limit,
        }
    };
    Ok(arrays.iter().zip(&ns).enumerate().map(times).collect())
}

/// Rays all over the sensor of a lens, and their pixels.
struct Array {
    name: &'static str,
    batch: BatchLens,
    /// Rays of a central lens, and points at 0.2 to 3 m before another.
    rays: Vec<[f64; 3]>,
    pixels: Vec<[f64; 2]>,
    is_central: bool,
}

impl Array {
    fn of(name: &'static str, lens: &KannalaBrandt) -> Self {
        let batch = BatchLens::new(lens);
        let place = |n: u32| {
            let (sine, cosine) = (lens.theta_max().rad() * f64::from(n) / f64::from(RAYS)).sin_cos();
            let (sin, cos) = (2.4 * f64::from(n)).sin_cos();
            [sine * cos, sine * sin, cosine]
        };
        let on_sensor = |ray: &[f64; 3]| {
            let ray = UnitRay::<vergence_vision::Camera>::new((*ray).into());
            ray.and_then(|ray| lens.project(&ray).ok()).is_some_and(|pixel| lens.on_sensor(pixel))
        };
        let seen: Vec<_> = (0..RAYS).map(place).filter(on_sensor).collect();
        let mut rays: Vec<_> = seen.iter().cycle().take(RAYS as usize).copied().collect();
        let pixels = batch.project(&rays);
        let is_central = lens.is_central();
        if !is_central {
            let distance = |i: u32| 200.0 * 15f64.powf(f64::from(i % 97) / 96.0);
            rays.iter_mut().zip(0..).for_each(|(ray, i)| *ray = ray.map(|component| component * distance(i)));
        }
        Self { name, batch, rays, pixels, is_central }
    }

    /// Seconds of projecting all, and of the way back, into arrays that exist: in new memory, each page waits for the system first.
    fn seconds(&self, clock: Clock) -> [f64; 2] {
        let (mut pixels, mut rays, mut from) = (Vec::new(), Vec::new(), Vec::new());
        let mut project = || {
            pixels.clear();
            self.batch.project_points_into(black_box(&self.rays), &mut pixels);
        };
        let mut unproject = || {
            rays.clear();
            from.clear();
            match self.is_central {
                true => self.batch.unproject_into(black_box(&self.pixels), &mut rays),
                false => self.batch.unproject_with_shifts_into(black_box(&self.pixels), &mut from),
            }
        };
        project();
        unproject();
        let [project, unproject] = [timed(clock, project).1, timed(clock, unproject).1];
        black_box((pixels, rays, from));
        [project, unproject]
    }
}

/// The polynomial lens first, a lens with a moving pupil after the same one with one centre, then an example of every model.
fn all() -> Result<Vec<(&'static str, KannalaBrandt)>, BenchError> {
    let refused = |error: &dyn std::fmt::Display| BenchError::Work(format!("a lens of the measurement: {error}"));
    let k = [599.1, -31.1532, 2.45631, -1.13829, 0.11982];
    let centre = Pixel { u: 1024.0, v: 1024.0 };
    let own = KannalaBrandt::new(k, 1.01, centre, Angle::from_deg(98.0), SIZE).map_err(|error| refused(&error))?;
    let by = Asymmetry { tangential: [4e-4, -3e-4], prism: [5e-4, -1e-4, -4e-4, 2e-4], growth: [1e-4, -5e-5] };
    let displaced = own.with_asymmetry(by).map_err(|error| refused(&error))?;
    let longer = own.with_further_terms([4e-5, -3e-6]).map_err(|error| refused(&error))?;
    let pupil = Pupil::from_mm([2.77, 0.056]);
    let moving = |lens: KannalaBrandt| lens.with_pupil(pupil).map_err(|error| refused(&error));
    let mut all = vec![
        ("polynomial", own),
        ("polynomial, moving pupil", moving(own)?),
        ("polynomial, displaced", displaced),
        ("polynomial, displaced, moving pupil", moving(displaced)?),
        ("polynomial of seven terms", longer),
        ("polynomial of seven terms, moving pupil", moving(longer)?),
    ];
    for (name, model) in models()? {
        let size = if name == "OCamCalib" { SMALL } else { SIZE };
        let fit = fit_lens(model.as_ref(), SightRegion { size, outline: &[] }).map_err(|error| refused(&error))?;
        all.push((name, fit.lens.computed_by(model, 1.0)));
    }
    Ok(all)
}

type Model = (&'static str, Box<dyn CameraModel>);

fn models() -> Result<Vec<Model>, BenchError> {
    let radtan = |coefficients: &[f64]| Radtan::new(coefficients).unwrap_or_default();
    let pinhole = |coefficients: &[f64]| Pinhole { pinhole: PINHOLE, distortion: radtan(coefficients) };
    let fisheye624 = Fisheye624 {
        pinhole: [600.0, 600.0, 1024.0, 1022.0],
        radial: [-0.02, 0.003, -0.001, 0.0002, -1e-5, 1e-6],
        tangential: [1e-3, -5e-4],
        prism: [2e-4, -1e-4, 3e-4, 5e-5],
    };
    let mei = Mei {
        pinhole: [1500.0, 1501.0, 1024.0, 1022.0],
        skew: 0.0,
        xi: 1.5,
        distortion: radtan(&[-0.05, 0.01, 1e-3, -5e-4]),
    };
    let ocam = OCam::new(&[-320.0, 0.0, 8.2e-4, -6e-8, 5e-10], [511.0, 519.5], [0.9998, 3e-4, -2e-4])
        .map_err(|error| BenchError::Work(format!("a lens of the measurement: {error}")))?;
    let rational = [0.2, -0.1, 1e-3, -5e-4, 0.02, 0.5, 0.1, 0.01, 1e-3, -1e-3, 5e-4, 2e-4, 0.02, -0.01];
    let wave = |index: usize| 0.02 * (0.7 * index as f64).sin();
    let splined = |order: usize| {
        let grid = SplineGrid { order, columns: 14, rows: 11, field_deg: 200.0 };
        let control = (0..14 * 11).map(|index| [wave(index), wave(2 * index + 1)]).collect();
        SplinedStereographic { pinhole: PINHOLE, grid, control }
    };
    Ok(vec![
        central("double sphere", DoubleSphere { pinhole: PINHOLE, xi: -0.2, alpha: 0.6 })?,
        central("enhanced unified", Eucm { pinhole: PINHOLE, alpha: 0.65, beta: 1.1 })?,
        central("unified", Eucm { pinhole: PINHOLE, alpha: 0.55, beta: 1.0 })?,
        central("omnidirectional", mei)?,
        central("FISHEYE624", fisheye624)?,
        central("OCamCalib", ocam)?,
        central("pinhole", pinhole(&[]))?,
        central("pinhole, radial and tangential", pinhole(&[-0.28, 0.07, 2e-4, 2e-5]))?,
        central("pinhole, rational, tilted", pinhole(&rational))?,
        central("splined stereographic", splined(3))?,
        central("splined, of order 2", splined(2))?,
    ])
}

fn central(name: &'static str, formula: impl Formula + 'static) -> Result<Model, BenchError> {
    let model = Central::new(formula).map_err(|error| BenchError::Work(format!("{name}: {error}")))?;
    Ok((name, Box::new(model)))
}
