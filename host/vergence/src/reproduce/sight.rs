//! One board before one camera: photographed and found, or, where that is asked for, its corners projected.

use image::GrayImage;
use image::imageops::grayscale;
use nalgebra::{UnitQuaternion, Vector3};
use vergence_calibration::detect::{Placement, detect};
use vergence_calibration::{BoardView, Corner};
use vergence_scene::{Board, Optics, Scene, View, render};
use vergence_vision::{Camera, ImageSize, KannalaBrandt, Pixel, Point, Transform, World};

use super::bench::{BOARD, scene_board};
use crate::sim::Random;

/// Around the corners of a board: its outer squares and the paper about them.
const MARGIN_PX: f64 = 90.0;
/// Noise of so many grey levels makes corners of the bench's boards off by a pixel, by and large.
const GREY_PER_PX: f64 = 100.0;
/// Rays for a pixel at an edge of the board. What so few leave to chance is part of the noise that is measured.
const EDGE_SAMPLES: u32 = 48;
/// Of the lens, in pixels.
const BLUR_PX: f64 = 0.8;

/// How corners come about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Corners {
    /// Photographs are rendered and our detector finds the corners.
    Rendered,
    /// The corners are projected and moved by Gaussian noise: quick, and not the whole chain.
    Projected,
}

/// Where corners come from, and how noisy they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eyesight {
    /// How they come about.
    pub corners: Corners,
    /// Standard deviation of a corner's u or v that the noise aims at, in pixels. What came about is measured.
    pub noise_px: f64,
}

/// A board before a camera.
#[derive(Clone, Copy, Debug)]
pub struct Sight<'a> {
    /// The true lens.
    pub lens: &'a KannalaBrandt,
    /// The board.
    pub camera_from_board: Transform<Camera, Board>,
    /// Drives the noise.
    pub seed: u64,
}

/// What became of a sight.
#[derive(Clone, Debug)]
pub struct Seen {
    /// The corners found.
    pub view: BoardView,
    /// Whether their labels are certain.
    pub labelled: bool,
    /// How far each is from where it truly is, u and v one after the other, in pixels.
    pub errors_px: Vec<f64>,
}

/// What the camera makes of a sight.
pub struct Photo {
    truth: BoardView,
    shown: Shown,
}

enum Shown {
    Picture(Window, GrayImage),
    Corners(BoardView),
}

impl Photo {
    /// What our detector, or the projection, makes of it, told what is known of the lens. `None` where no board is found.
    pub fn seen(&self, known: Option<&KannalaBrandt>) -> Option<Seen> {
        let (view, labelled) = match &self.shown {
            Shown::Corners(view) => (view.clone(), true),
            Shown::Picture(window, image) => {
                let hint = known.and_then(|lens| window.part_of(lens));
                let found = detect(image, &BOARD, hint.as_ref()).ok()?;
                let mut view = found.view("", &BOARD);
                for Corner { pixel, .. } in &mut view.corners {
                    *pixel = Pixel { u: pixel.u + f64::from(window.left), v: pixel.v + f64::from(window.top) };
                }
                (view, found.placement == Placement::Unique)
            }
        };
        let errors_px = errors(&view, &self.truth);
        Some(Seen { view, labelled, errors_px })
    }
}

impl Sight<'_> {
    /// Its photograph; `None` where no corner is in sight.
    pub fn photograph(self, eyesight: &Eyesight) -> Option<Photo> {
        let truth = self.truth();
        if truth.corners.is_empty() {
            return None;
        }
        let shown = match eyesight.corners {
            Corners::Projected => Shown::Corners(self.moved(&truth, eyesight.noise_px)),
            Corners::Rendered => {
                let window = Window::about(&truth, self.lens.size());
                let image = self.picture(&window, eyesight.noise_px)?;
                Shown::Picture(window, image)
            }
        };
        Some(Photo { truth, shown })
    }

    /// The corners where they truly are.
    fn truth(&self) -> BoardView {
        let place = |index: u32| {
            let board_mm = BOARD.corner_mm(index);
            let at = self.camera_from_board * Point::from_mm(Vector3::new(board_mm[0], board_mm[1], 0.0));
            let pixel = self.lens.project_point(&at).ok().filter(|pixel| self.lens.on_sensor(*pixel))?;
            Some(Corner::new(board_mm, pixel))
        };
        BoardView { name: String::new(), corners: (0..BOARD.columns * BOARD.rows).filter_map(place).collect() }
    }

    fn moved(&self, truth: &BoardView, sigma_px: f64) -> BoardView {
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
        let scene = Scene::board_alone(scene_board(), self.camera_from_board.renamed::<World, Board>());
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
        let view = View { scene: &scene, camera: &camera, world_from_camera, optics: &optics };
        Some(grayscale(&render(&view, self.seed).image))
    }
}

/// The part of a picture that shows the board.
struct Window {
    left: u32,
    top: u32,
    size: ImageSize,
}

impl Window {
    fn about(truth: &BoardView, size: ImageSize) -> Self {
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

fn errors(view: &BoardView, truth: &BoardView) -> Vec<f64> {
    let of = |corner: &Corner| {
        let truth = truth.corners.iter().find(|truth| same_place(truth, corner))?;
        Some([corner.pixel.u - truth.pixel.u, corner.pixel.v - truth.pixel.v])
    };
    view.corners.iter().filter_map(of).flatten().collect()
}

/// Whether both are the same corner of the board.
pub fn same_place(a: &Corner, b: &Corner) -> bool {
    /// Labels are exact; this is rounding.
    const ROUNDING_MM: f64 = 1e-6;
    (a.board_mm[0] - b.board_mm[0]).hypot(a.board_mm[1] - b.board_mm[1]) < ROUNDING_MM
}
