//! One target before one camera: photographed and found, or, where that is asked for, its corners projected.

use image::GrayImage;
use image::imageops::grayscale;
use nalgebra::{UnitQuaternion, Vector3};
use vergence_scene::{Optics, Target};
use vergence_sim::{Random, photograph_target};
use vergence_targets::{Corner, Placement, TargetView, detect};
use vergence_vision::{Camera, ImageSize, KannalaBrandt, Pixel, Point, Transform, World};

use crate::bench::{TARGET, scene_target};

/// Margin around the corners of a target, for its outer squares and the paper around them.
const MARGIN_PX: f64 = 90.0;
/// Grey levels of noise that move a corner of the bench's targets by about one pixel.
const GREY_PER_PX: f64 = 100.0;
/// Rays for a pixel at an edge of the target. Their sampling error is part of the noise that is measured.
const EDGE_SAMPLES: u32 = 48;
/// Standard deviation of the blur of the lens, in pixels.
const BLUR_PX: f64 = 0.8;

/// Kind of the source of corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Corners {
    /// Photographs are rendered, and the detector finds the corners.
    Rendered,
    /// The corners are projected, and Gaussian noise is added: quick, but not the whole chain.
    Projected,
}

/// Where corners come from, and how noisy they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CornerSource {
    /// Kind of the source.
    pub corners: Corners,
    /// Intended standard deviation of a corner's u or v, in pixels; the real one is measured.
    pub noise_px: f64,
}

/// A target before a camera.
#[derive(Clone, Copy, Debug)]
pub struct TargetShot<'a> {
    /// The true lens.
    pub lens: &'a KannalaBrandt,
    /// Pose of the target.
    pub camera_from_target: Transform<Camera, Target>,
    /// Seed of the noise.
    pub seed: u64,
}

/// Corners that were found in a photograph.
#[derive(Clone, Debug)]
pub struct FoundCorners {
    /// The corners found.
    pub view: TargetView,
    /// Whether their labels are certain.
    pub labelled: bool,
    /// How far each is from where it truly is, u and v one after the other, in pixels.
    pub errors_px: Vec<f64>,
}

/// A photograph of a target.
pub struct Photo {
    truth: TargetView,
    shown: Shown,
}

enum Shown {
    Picture(Window, GrayImage),
    Corners(TargetView),
}

impl Photo {
    /// The corners that the detector finds, with what is `known` of the lens; `None` where it finds no target.
    pub fn found(&self, known: Option<&KannalaBrandt>) -> Option<FoundCorners> {
        let (view, labelled) = match &self.shown {
            Shown::Corners(view) => (view.clone(), true),
            Shown::Picture(window, image) => {
                let hint = known.and_then(|lens| window.part_of(lens));
                let found = detect(image, &TARGET, hint.as_ref()).ok()?;
                let mut view = found.view("", &TARGET);
                for Corner { pixel, .. } in &mut view.corners {
                    *pixel = Pixel { u: pixel.u + f64::from(window.left), v: pixel.v + f64::from(window.top) };
                }
                (view, found.placement == Placement::Unique)
            }
        };
        let errors_px = errors(&view, &self.truth);
        Some(FoundCorners { view, labelled, errors_px })
    }
}

impl TargetShot<'_> {
    /// Its photograph; `None` where no corner is in sight.
    pub fn photograph(self, corner_source: &CornerSource) -> Option<Photo> {
        let truth = self.truth();
        if truth.corners.is_empty() {
            return None;
        }
        let shown = match corner_source.corners {
            Corners::Projected => Shown::Corners(self.moved(&truth, corner_source.noise_px)),
            Corners::Rendered => {
                let window = Window::about(&truth, self.lens.size());
                let image = self.picture(&window, corner_source.noise_px)?;
                Shown::Picture(window, image)
            }
        };
        Some(Photo { truth, shown })
    }

    /// The corners where they truly are.
    fn truth(&self) -> TargetView {
        let place = |index: u32| {
            let target_mm = TARGET.corner_mm(index);
            let at = self.camera_from_target * Point::from_mm(Vector3::new(target_mm[0], target_mm[1], 0.0));
            let pixel = self.lens.project_point(&at).ok().filter(|pixel| self.lens.on_sensor(*pixel))?;
            Some(Corner::new(target_mm, pixel))
        };
        TargetView { name: String::new(), corners: (0..TARGET.columns * TARGET.rows).filter_map(place).collect() }
    }

    fn moved(&self, truth: &TargetView, sigma_px: f64) -> TargetView {
        let mut random = Random::new(self.seed);
        let mut view = truth.clone();
        for Corner { pixel, .. } in &mut view.corners {
            *pixel = Pixel { u: pixel.u + sigma_px * random.normal(), v: pixel.v + sigma_px * random.normal() };
        }
        view
    }

    /// The part of the photograph in the window.
    fn picture(&self, window: &Window, noise_px: f64) -> Option<GrayImage> {
        let camera = window.part_of(self.lens)?;
        let world_from_camera = Transform::<World, Camera>::new(UnitQuaternion::identity(), Vector3::zeros());
        let grey = noise_px * GREY_PER_PX;
        let optics = Optics {
            samples: 1,
            edge_samples: EDGE_SAMPLES,
            blur_px: BLUR_PX,
            read_noise: grey,
            shot_noise: grey,
            ..Optics::default()
        };
        let place = self.camera_from_target.renamed();
        let image = photograph_target(scene_target(), place, &camera, world_from_camera, &optics, self.seed);
        Some(grayscale(&image))
    }
}

/// The part of a picture that shows the target.
struct Window {
    left: u32,
    top: u32,
    size: ImageSize,
}

impl Window {
    fn about(truth: &TargetView, size: ImageSize) -> Self {
        let extent = |value: fn(Pixel) -> f64, size: u32| {
            let values = truth.corners.iter().map(|corner| value(corner.pixel));
            let (low, high) = values.fold((f64::INFINITY, 0.0f64), |(low, high), x| (low.min(x), high.max(x)));
            let low = (low - MARGIN_PX).max(0.0) as u32;
            (low, ((high + MARGIN_PX) as u32).min(size).saturating_sub(low).max(1))
        };
        let ((left, width), (top, height)) = (extent(|p| p.u, size.width), extent(|p| p.v, size.height));
        Self { left, top, size: ImageSize { width, height } }
    }

    /// The same lens before this part of its sensor: its centre moves.
    fn part_of(&self, lens: &KannalaBrandt) -> Option<KannalaBrandt> {
        let mut part = lens.to_opencv();
        (part.cx, part.cy) = (part.cx - f64::from(self.left), part.cy - f64::from(self.top));
        KannalaBrandt::from_opencv(part, lens.theta_max(), self.size).ok()
    }
}

fn errors(view: &TargetView, truth: &TargetView) -> Vec<f64> {
    let of = |corner: &Corner| {
        let truth = truth.corners.iter().find(|truth| same_place(truth, corner))?;
        Some([corner.pixel.u - truth.pixel.u, corner.pixel.v - truth.pixel.v])
    };
    view.corners.iter().filter_map(of).flatten().collect()
}

/// Whether both are the same corner of the target.
pub fn same_place(a: &Corner, b: &Corner) -> bool {
    /// Labels are exact; this is rounding.
    const ROUNDING_MM: f64 = 1e-6;
    (a.target_mm[0] - b.target_mm[0]).hypot(a.target_mm[1] - b.target_mm[1]) < ROUNDING_MM
}
