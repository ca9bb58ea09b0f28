//! One target before one camera: photographed and found, in the fisheye or in an undistorted picture, or, where that is asked
//! for, its corners projected.

use std::str::FromStr;

use image::GrayImage;
use nalgebra::Vector3;
use vergence_scene::{Lens, Optics, SheetView, Target, TrueLens, photograph_sheet};
use vergence_sim::Random;
use vergence_targets::{Corner, Placement, SearchedImage, TargetView, detect_from};
use vergence_vision::{Camera, ImageSize, KannalaBrandt, Length, Pixel, Point, Transform};

use crate::bench::{TARGET, scene_target};
use crate::conditions::Conditions;
use crate::undistort::Pinhole;

/// Margin around a sheet in its part of the photograph.
const MARGIN_PX: f64 = 16.0;
/// Grey levels of noise that move a corner of the bench's targets by about one pixel.
const GREY_PER_PX: f64 = 75.0;
/// Rays for a pixel at an edge of the target. Their sampling error is part of the noise that is measured.
const EDGE_SAMPLES: u32 = 48;
/// Noise of projected corners at least: about what whole grey levels leave of a rendered one.
const ROUNDING_PX: f64 = 0.01;
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

/// A target before a camera.
#[derive(Clone, Copy, Debug)]
pub struct TargetShot<'a> {
    /// The true lens.
    pub lens: &'a TrueLens,
    /// Pose of the target.
    pub camera_from_target: Transform<Camera, Target>,
    /// How far it is bent: [`Conditions::bow`].
    pub bow: Length,
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
    Picture(Window, GrayImage, SearchedImage),
    Corners(TargetView),
}

impl FromStr for Corners {
    type Err = &'static str;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        match name {
            "rendered" => Ok(Self::Rendered),
            "projected" => Ok(Self::Projected),
            _ => Err("corners are rendered or projected"),
        }
    }
}

impl Photo {
    /// The corners that the detector finds, with what is `known` of the lens; `None` where it finds no target.
    pub fn found(&self, known: Option<&KannalaBrandt>) -> Option<FoundCorners> {
        let (view, labelled) = match &self.shown {
            Shown::Corners(view) => (view.clone(), true),
            Shown::Picture(window, image, searched) => {
                let hint = known.and_then(|lens| window.part_of(lens));
                let on_sensor = |at: Pixel| Pixel { u: at.u + f64::from(window.left), v: at.v + f64::from(window.top) };
                target_in(image, searched, hint.as_ref(), on_sensor)?
            }
        };
        let errors_px = errors(&view, &self.truth);
        Some(FoundCorners { view, labelled, errors_px })
    }

    /// The corners that the detector finds in the undistorted picture, as places of that picture; `None` where it finds no
    /// target or none is in the picture.
    pub fn undistorted(&self, pinhole: &Pinhole<'_>) -> Option<FoundCorners> {
        let truth = placed(&self.truth, pinhole);
        let (view, labelled) = match &self.shown {
            Shown::Corners(view) => (placed(view, pinhole), true),
            Shown::Picture(window, image, _) => {
                let places: Vec<Pixel> = truth.corners.iter().map(|corner| corner.pixel).collect();
                let patch = pinhole.patch(&places)?;
                let picture = pinhole.picture(&patch, image, [window.left, window.top]);
                target_in(&picture, &SearchedImage::default(), None, |at| patch.place(at))?
            }
        };
        let errors_px = errors(&view, &truth);
        Some(FoundCorners { view, labelled, errors_px })
    }

    /// Where the corners that are in the undistorted picture truly are, as far as what is known of the lens is true.
    pub fn undistorted_truth(&self, pinhole: &Pinhole<'_>) -> TargetView {
        placed(&self.truth, pinhole)
    }
}

/// The good corners of the target in a picture, moved by `place`, and whether their labels are certain.
fn target_in(
    picture: &GrayImage,
    searched: &SearchedImage,
    hint: Option<&KannalaBrandt>,
    place: impl Fn(Pixel) -> Pixel,
) -> Option<(TargetView, bool)> {
    let found = detect_from(searched, picture, &TARGET, hint).ok()?;
    let mut view = found.view("", &TARGET);
    view.corners.iter_mut().for_each(|corner| corner.pixel = place(corner.pixel));
    Some((view, found.placement == Placement::Unique))
}

/// The corners that are in the undistorted picture, where they are there.
fn placed(view: &TargetView, pinhole: &Pinhole<'_>) -> TargetView {
    let corner = |corner: &Corner| Some(Corner { pixel: pinhole.place(corner.pixel)?, ..*corner });
    TargetView { name: String::new(), corners: view.corners.iter().filter_map(corner).collect() }
}

impl TargetShot<'_> {
    /// Its photograph; `None` where no corner is in sight.
    pub fn photograph(self, conditions: &Conditions) -> Option<Photo> {
        let truth = self.truth();
        if truth.corners.is_empty() {
            return None;
        }
        let shown = match conditions.corners {
            Corners::Projected => Shown::Corners(self.moved(&truth, conditions.noise_px.max(ROUNDING_PX))),
            Corners::Rendered if self.bow.mm() != 0.0 => return None,
            Corners::Rendered => {
                let window = Window::about(&self.outline(), self.lens.size());
                let image = self.picture(&window, conditions.noise_px)?;
                Shown::Picture(window, image, SearchedImage::default())
            }
        };
        Some(Photo { truth, shown })
    }

    /// Where a point of the target truly is in the picture; `None` outside the field.
    fn pixel(&self, [x, y]: [f64; 2]) -> Option<Pixel> {
        let (middle, half) = (scene_target().centre().mm().x, 0.5 * scene_target().size()[0].mm());
        let behind = self.bow.mm() * (1.0 - ((x - middle) / half).powi(2));
        let at = self.camera_from_target * Point::from_mm(Vector3::new(x, y, behind));
        self.lens.image_of(&at)
    }

    /// The corners where they truly are.
    fn truth(&self) -> TargetView {
        let place = |index: u32| {
            let target_mm = TARGET.corner_mm(index);
            Some(Corner::new(target_mm, self.pixel(target_mm).filter(|pixel| self.lens.size().contains(*pixel))?))
        };
        TargetView { name: String::new(), corners: (0..TARGET.columns * TARGET.rows).filter_map(place).collect() }
    }

    /// Points along the edge of the sheet, as far as they are in the field.
    fn outline(&self) -> Vec<Pixel> {
        const ALONG_SIDE: u32 = 12;
        let (middle, half) = (scene_target().centre().mm(), scene_target().size().map(|side| 0.5 * side.mm()));
        let along = (0..=ALONG_SIDE).map(|step| 2.0 * f64::from(step) / f64::from(ALONG_SIDE) - 1.0);
        let sides = along.flat_map(|at| [[at, -1.0], [at, 1.0], [-1.0, at], [1.0, at]]);
        sides.filter_map(|[x, y]| self.pixel([middle.x + half[0] * x, middle.y + half[1] * y])).collect()
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
        let camera = self.lens.before_part([window.left, window.top], window.size)?;
        let grey = noise_px * GREY_PER_PX;
        let optics = Optics {
            edge_samples: EDGE_SAMPLES,
            blur_px: BLUR_PX,
            read_noise: grey,
            shot_noise: grey,
            ..Optics::default()
        };
        let view = SheetView {
            sheet: scene_target().into(),
            camera_from_sheet: self.camera_from_target,
            camera: &camera,
            optics: &optics,
        };
        Some(photograph_sheet(&view, self.seed))
    }
}

/// The part of a picture that shows the target.
struct Window {
    left: u32,
    top: u32,
    size: ImageSize,
}

impl Window {
    fn about(outline: &[Pixel], size: ImageSize) -> Self {
        let extent = |value: fn(Pixel) -> f64, size: u32| {
            let values = outline.iter().map(|pixel| value(*pixel));
            let (low, high) = values.fold((f64::INFINITY, 0.0f64), |(low, high), x| (low.min(x), high.max(x)));
            let low = (low - MARGIN_PX).max(0.0) as u32;
            (low, ((high + MARGIN_PX) as u32).min(size).saturating_sub(low).max(1))
        };
        let ((left, width), (top, height)) = (extent(|p| p.u, size.width), extent(|p| p.v, size.height));
        Self { left, top, size: ImageSize { width, height } }
    }

    /// The same lens before this part of its sensor: its centre moves.
    fn part_of(&self, lens: &KannalaBrandt) -> Option<KannalaBrandt> {
        match lens.before_part([self.left, self.top], self.size)? {
            TrueLens::Ideal(part) => Some(part),
            TrueLens::Traced(_) => None,
        }
    }
}

fn errors(view: &TargetView, truth: &TargetView) -> Vec<f64> {
    let of = |corner: &Corner| {
        let truth = truth.corners.iter().find(|truth| same_place(truth, corner))?;
        Some([corner.pixel.u - truth.pixel.u, corner.pixel.v - truth.pixel.v])
    };
    view.corners.iter().filter_map(of).flatten().collect()
}

/// The corners of `of` that `other` has too.
pub fn in_both<'a>(of: &'a [Corner], other: &'a [Corner]) -> impl Iterator<Item = &'a Corner> {
    of.iter().filter(|corner| other.iter().any(|twin| same_place(corner, twin)))
}

/// Whether both are the same corner of the target.
pub fn same_place(a: &Corner, b: &Corner) -> bool {
    /// Labels are exact; this is rounding.
    const ROUNDING_MM: f64 = 1e-6;
    (a.target_mm[0] - b.target_mm[0]).hypot(a.target_mm[1] - b.target_mm[1]) < ROUNDING_MM
}
