//! A board before cameras: whether it is seen, held still, and worth an image.

use image::imageops::grayscale;
use rayon::prelude::*;
use vergence_calibration::detect::detect;
use vergence_calibration::{BoardSpec, BoardView, Coverage};

use crate::camera::Frame;

/// A board that moves by less than this between two frames is held still, in pixels.
const STILL_PX: f64 = 1.0;
/// A board is elsewhere where its corners have moved by this much on average, in pixels.
const ELSEWHERE_PX: f64 = 25.0;

/// What the cameras call themselves in file names.
pub const NAMES: [&str; 2] = ["left", "right"];

/// The views of one instant, one for each camera; empty where one of them does not see the board.
pub type Seen = Vec<BoardView>;

/// Looks for the board in the frames of one instant.
#[must_use]
pub fn seen(frames: &[Frame], board: &BoardSpec) -> Seen {
    let view = |frame: &Frame| Some(detect(&grayscale(&frame.image), board, None).ok()?.view(&frame.name, board));
    frames.par_iter().map(view).collect::<Option<_>>().unwrap_or_default()
}

/// A set of views in the making: what was covered, taken and seen last.
pub struct BoardWatch {
    coverage: Vec<Coverage>,
    last: Seen,
    views: Vec<Seen>,
}

impl BoardWatch {
    /// Nothing yet; one coverage for each camera.
    #[must_use]
    pub fn new(coverage: Vec<Coverage>) -> Self {
        Self { coverage, last: Seen::new(), views: Vec::new() }
    }

    /// Takes note of what is seen now; whether all cameras see the board held still.
    pub fn look(&mut self, now: Seen) -> bool {
        let before = std::mem::replace(&mut self.last, now);
        !before.is_empty()
            && before.len() == self.last.len()
            && before.iter().zip(&self.last).all(|(a, b)| is_still(a, b))
    }

    /// Whether the board is seen where, or as, it was not seen enough.
    #[must_use]
    pub fn is_news(&self) -> bool {
        self.coverage.iter().zip(&self.last).any(|(coverage, view)| coverage.is_news(view))
    }

    /// Whether the board is somewhere else than in every view taken.
    #[must_use]
    pub fn is_elsewhere(&self) -> bool {
        self.views.iter().all(|taken| taken.iter().zip(&self.last).any(|(a, b)| distance(a, b) > ELSEWHERE_PX))
    }

    /// Takes what was seen last.
    pub fn take(&mut self) {
        for (coverage, view) in self.coverage.iter_mut().zip(&self.last) {
            coverage.add(view);
        }
        self.views.push(self.last.clone());
    }

    /// How many views were taken.
    #[must_use]
    pub fn taken(&self) -> usize {
        self.views.len()
    }

    /// Whether every camera has what it needs.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        !self.coverage.is_empty() && self.coverage.iter().all(|coverage| coverage.advice().is_none())
    }

    /// For the camera that needs it most; `None` where nothing is missing.
    #[must_use]
    pub fn advice(&self) -> Option<String> {
        let advice = self.coverage.iter().zip(NAMES).find_map(|(coverage, name)| Some((coverage.advice()?, name)));
        advice.map(|(advice, name)| match self.coverage.len() {
            0 | 1 => advice.to_string(),
            _ => format!("{name} camera: {advice}"),
        })
    }
}

/// Whether the board stands where it stood.
fn is_still(before: &BoardView, now: &BoardView) -> bool {
    let (mut count, mut worst) = (0, 0f64);
    for px in motion(before, now) {
        (count, worst) = (count + 1, worst.max(px));
    }
    count * 2 >= now.corners.len() && count > 0 && worst < STILL_PX
}

/// Mean motion of the corners that both views have; infinite where they have none in common.
fn distance(before: &BoardView, now: &BoardView) -> f64 {
    let (count, sum) = motion(before, now).fold((0.0, 0.0), |(count, sum), px| (count + 1.0, sum + px));
    if count > 0.0 { sum / count } else { f64::INFINITY }
}

fn motion<'a>(before: &'a BoardView, now: &'a BoardView) -> impl Iterator<Item = f64> + 'a {
    now.corners.iter().filter_map(|corner| {
        let same = before.corners.iter().find(|other| same_place(other.board_mm, corner.board_mm))?;
        Some((corner.pixel.u - same.pixel.u).hypot(corner.pixel.v - same.pixel.v))
    })
}

fn same_place([x, y]: [f64; 2], [other_x, other_y]: [f64; 2]) -> bool {
    (x - other_x).abs() < 1e-6 && (y - other_y).abs() < 1e-6
}
