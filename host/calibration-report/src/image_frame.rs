//! Figures that show the image: where pixels and directions lie in them, rings of equal field angle, the valid cone, and
//! names of places.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;
use vergence_page::{Anchor, Drawing, Path, fixed};
use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Pixel, UnitRay};

/// Width of a figure.
pub(crate) const WIDTH: f64 = 620.0;
/// The image is never drawn higher than this.
const HIGHEST: f64 = 620.0;
const MARGIN: f64 = 8.0;
/// Room for a legend below the image.
const LEGEND: f64 = 54.0;

/// Mapping of image pixels to a drawing.
pub(crate) struct ImageFrame {
    scale: f64,
    left: f64,
    size: ImageSize,
    /// The lens, valid as far as its polynomial increases, which is beyond the valid cone.
    lens: KannalaBrandt,
    valid: Angle,
}

impl ImageFrame {
    pub fn of(camera: &KannalaBrandt) -> Self {
        let size = camera.size();
        let (width, height) = (f64::from(size.width.max(1)), f64::from(size.height.max(1)));
        let scale = ((WIDTH - 2.0 * MARGIN) / width).min(HIGHEST / height);
        let left = 0.5 * (WIDTH - scale * width);
        Self { scale, left, size, lens: camera.extrapolated(), valid: camera.theta_max() }
    }

    /// An empty drawing with room for the image and a legend.
    pub fn drawing(&self) -> Drawing {
        Drawing::new(WIDTH, self.extent()[1] + MARGIN + LEGEND)
    }

    /// The lens as far as its polynomial holds.
    pub fn lens(&self) -> &KannalaBrandt {
        &self.lens
    }

    pub fn valid(&self) -> Angle {
        self.valid
    }

    pub fn corner(&self) -> [f64; 2] {
        [self.left, MARGIN]
    }

    pub fn extent(&self) -> [f64; 2] {
        [self.size.width, self.size.height].map(|n| self.scale * f64::from(n.max(1)))
    }

    /// Upper left corner of the legend in the picture's coordinates.
    pub fn legend(&self) -> [f64; 2] {
        [self.left, MARGIN + self.extent()[1] + 14.0]
    }

    pub fn at(&self, pixel: Pixel) -> [f64; 2] {
        [self.left + self.scale * (pixel.u + 0.5), MARGIN + self.scale * (pixel.v + 0.5)]
    }

    /// Position of a direction in the drawing.
    pub fn direction(&self, theta: f64, phi: f64) -> Option<[f64; 2]> {
        self.lens.project(&direction(theta, phi)?).ok().map(|pixel| self.at(pixel))
    }

    /// The part of the field between two angles to the axis and two azimuths.
    pub fn cell(&self, theta: [f64; 2], phi: [f64; 2]) -> Vec<[f64; 2]> {
        let steps = ((phi[1] - phi[0]) / TAU * 96.0).ceil().max(1.0) as u32;
        let along = |i: u32| phi[0] + (phi[1] - phi[0]) * f64::from(i) / f64::from(steps);
        let outer = (0..=steps).filter_map(|i| self.direction(theta[1], along(i)));
        let inner = (0..=steps).rev().filter_map(|i| self.direction(theta[0], along(i)));
        outer.chain(inner).collect()
    }

    /// Draws within the image.
    pub fn inside(&self, drawing: &mut Drawing, draw: impl FnOnce(&mut Drawing)) {
        drawing.clipped(self.corner(), self.extent(), draw);
    }

    pub fn background(&self, drawing: &mut Drawing) {
        drawing.rect(self.corner(), self.extent(), "sensor", "");
    }

    /// Rings every 15°, the valid cone, and the sensor's border.
    pub fn rings(&self, drawing: &mut Drawing) {
        const STEP_DEG: u32 = 15;
        self.inside(drawing, |drawing| {
            for degrees in (1..12).map(|i| f64::from(i * STEP_DEG)) {
                if degrees < self.lens.theta_max().deg() {
                    drawing.path(&self.ring(degrees.to_radians()), "ring", "");
                }
            }
            drawing.path(&self.ring(self.valid.rad()), "cone", "");
        });
        drawing.rect(self.corner(), self.extent(), "border", "");
        for degrees in (1..6).map(|i| f64::from(i * 2 * STEP_DEG)) {
            self.label_ring(drawing, degrees);
        }
    }

    /// At the top of the ring, or at its right where the sensor does not show the top.
    fn label_ring(&self, drawing: &mut Drawing, degrees: f64) {
        let [left, top] = self.corner();
        let [width, height] = self.extent();
        let within = |[x, y]: &[f64; 2]| {
            (left + 14.0..left + width - 14.0).contains(x) && (top + 12.0..top + height - 6.0).contains(y)
        };
        let places = [-0.25, 0.0, 0.5, 0.25].map(|turn| self.direction(degrees.to_radians(), turn * TAU));
        if let Some([x, y]) = places.into_iter().flatten().find(within) {
            drawing.text([x, y + 4.0], Anchor::Middle, "ringlabel", &format!("{}°", fixed(degrees, 0)));
        }
    }

    fn ring(&self, theta: f64) -> Path {
        const POINTS: u32 = 120;
        let points = (0..POINTS).filter_map(|i| self.direction(theta, TAU * f64::from(i) / f64::from(POINTS)));
        let mut path = Path::default();
        path.polygon(&points.collect::<Vec<_>>());
        path
    }
}

/// The ray at `theta` from the axis with the azimuth `phi`, in radians.
pub(crate) fn direction(theta: f64, phi: f64) -> Option<UnitRay<Camera>> {
    UnitRay::new(Vector3::new(theta.sin() * phi.cos(), theta.sin() * phi.sin(), theta.cos()))
}

/// Number of named azimuth sectors.
pub(crate) const OCTANTS: usize = 8;

const NAMES: [&str; OCTANTS] =
    ["right", "lower right", "bottom", "lower left", "left", "upper left", "top", "upper right"];

/// The octant of the azimuth `phi`, in radians from right to down.
pub(crate) fn octant(phi: f64) -> usize {
    let share = (phi + PI / OCTANTS as f64).rem_euclid(TAU) / TAU;
    ((share * OCTANTS as f64) as usize).min(OCTANTS - 1)
}

pub(crate) fn name(octant: usize) -> &'static str {
    NAMES.get(octant).copied().unwrap_or("")
}

/// "a", "a and b", "a, b and c".
pub(crate) fn list(names: &[String]) -> String {
    match names {
        [] => String::new(),
        [only] => only.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}
