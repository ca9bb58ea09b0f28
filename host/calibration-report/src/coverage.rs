//! Coverage of the field by corners.

use std::f64::consts::TAU;

use vergence_page::{Anchor, Drawing, Path, significant};
use vergence_vision::{Angle, Camera, KannalaBrandt, Pixel};

use crate::colour::GREENS;
use crate::image_frame::{ImageFrame, OCTANTS, octant};
use crate::images::LitArea;
use crate::residuals::Observation;

/// Width of a ring of cells.
const RING_DEG: f64 = 15.0;
/// Least share of a cell that must lie on the sensor for the cell to count.
const LEAST_SHARE: f64 = 0.3;
/// Samples along the longer side of the image, to find which cells it shows.
const SAMPLES: u32 = 160;

/// A cell of the field.
struct Cell {
    theta: [f64; 2],
    phi: [f64; 2],
    /// Area in the image, in square pixels.
    area: f64,
    /// Middle of the part that the image shows.
    middle: Pixel,
    corners: usize,
}

/// The field that the sensor sees, divided into cells.
pub(crate) struct FieldCoverage {
    cells: Vec<Cell>,
    /// Largest angle to the axis that the sensor and that the corners reach, by octant, in radians.
    octants: [(f64, f64); OCTANTS],
}

impl FieldCoverage {
    /// Coverage up to the angle `half_field` if known, to the sensor's border otherwise; with `lit`, only where the
    /// images show anything.
    pub fn of(
        camera: &KannalaBrandt,
        half_field: Option<Angle>,
        lit: Option<&LitArea>,
        observations: &[Observation],
    ) -> Self {
        let frame = ImageFrame::of(camera);
        let limit = half_field.map_or(f64::INFINITY, Angle::rad).min(frame.lens().theta_max().rad());
        let mut coverage = Self { cells: cells(limit), octants: [(0.0, 0.0); OCTANTS] };
        coverage.sample(frame.lens(), limit, lit);
        for observation in observations.iter().filter(|observation| observation.used) {
            let counted = coverage.cells.iter_mut().find(|cell| cell.holds(observation.theta, observation.phi));
            counted.into_iter().for_each(|cell| cell.corners += 1);
            let (_, outermost) = &mut coverage.octants[octant(observation.phi)];
            *outermost = outermost.max(observation.theta);
        }
        coverage
    }

    /// Finds how much of each cell the sensor shows.
    fn sample(&mut self, lens: &KannalaBrandt, limit: f64, lit: Option<&LitArea>) {
        let size = lens.size();
        let step = f64::from(size.width.max(size.height).max(1)) / f64::from(SAMPLES);
        let [columns, rows] = [size.width, size.height].map(|length| (f64::from(length) / step).ceil() as u32);
        let mut sums = vec![[0.0; 3]; self.cells.len()];
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let pixel = Pixel { u: (f64::from(column) + 0.5) * step - 0.5, v: (f64::from(row) + 0.5) * step - 0.5 };
            let Ok(ray) = lens.unproject::<Camera>(pixel) else { continue };
            let (theta, phi) = (ray.angle_to_axis().rad(), ray.vector().y.atan2(ray.vector().x));
            if theta > limit || lit.is_some_and(|lit| !lit.shows(pixel, size)) {
                continue;
            }
            let (reach, _) = &mut self.octants[octant(phi)];
            *reach = reach.max(theta);
            let holder = self.cells.iter().zip(&mut sums).find(|(cell, _)| cell.holds(theta, phi));
            if let Some((_, [count, u, v])) = holder {
                (*count, *u, *v) = (*count + 1.0, *u + pixel.u, *v + pixel.v);
            }
        }
        for (cell, [count, u, v]) in self.cells.iter_mut().zip(sums) {
            cell.area = count * step * step;
            cell.middle = Pixel { u: u / count, v: v / count };
        }
        self.cells.retain(|cell| cell.area > LEAST_SHARE * cell.full_area(lens));
    }

    /// Number of cells without a corner, and of all cells.
    pub fn empty(&self) -> (usize, usize) {
        (self.cells.iter().filter(|cell| cell.corners == 0).count(), self.cells.len())
    }

    /// Largest angle to the axis that the sensor and that the corners reach, by octant, in radians.
    pub fn reach(&self) -> &[(f64, f64); OCTANTS] {
        &self.octants
    }

    pub fn draw(&self, camera: &KannalaBrandt) -> Drawing {
        let frame = ImageFrame::of(camera);
        let mut drawing = frame.drawing();
        frame.background(&mut drawing);
        let densest = self.cells.iter().map(Cell::density).fold(0.0, f64::max);
        frame.inside(&mut drawing, |drawing| {
            for cell in &self.cells {
                let mut path = Path::default();
                path.polygon(&frame.cell(cell.theta, cell.phi));
                // The root spreads the many cells with few corners over the scale.
                let style = format!("fill:{}", GREENS.at((cell.density() / densest).sqrt()));
                if cell.corners == 0 {
                    drawing.path(&path, "cell empty", "");
                } else {
                    drawing.path(&path, "cell", &style);
                }
            }
        });
        frame.rings(&mut drawing);
        for cell in &self.cells {
            let [x, y] = frame.at(cell.middle);
            let class = if cell.corners == 0 { "count zero" } else { "count" };
            drawing.text([x, y + 4.0], Anchor::Middle, class, &cell.corners.to_string());
        }
        legend(&mut drawing, frame.legend(), densest);
        drawing
    }
}

impl Cell {
    fn holds(&self, theta: f64, phi: f64) -> bool {
        (self.theta[0]..self.theta[1]).contains(&theta) && (self.phi[0]..self.phi[1]).contains(&phi.rem_euclid(TAU))
    }

    /// Corners per square pixel.
    fn density(&self) -> f64 {
        if self.area > 0.0 { self.corners as f64 / self.area } else { 0.0 }
    }

    /// Area in the image if the sensor showed all of the cell, in square pixels.
    fn full_area(&self, lens: &KannalaBrandt) -> f64 {
        let radius = |t: f64| lens.radius(Angle::from_rad(t));
        let squares = radius(self.theta[1]).powi(2) - radius(self.theta[0]).powi(2);
        0.5 * (self.phi[1] - self.phi[0]) * squares * lens.aspect()
    }
}

/// Rings from the axis to `limit`; the inner ones have fewer cells.
fn cells(limit: f64) -> Vec<Cell> {
    let width = RING_DEG.to_radians();
    let rings = (limit / width - 0.1).ceil().max(1.0) as usize;
    let ring = |ring: usize| {
        let sectors = [4, 8].get(ring).copied().unwrap_or(12);
        let outer = if ring + 1 == rings { limit } else { (ring + 1) as f64 * width };
        let theta = [ring as f64 * width, outer];
        let edge = move |sector: usize| TAU * sector as f64 / sectors as f64;
        let cell = move |sector| Cell {
            theta,
            phi: [edge(sector), edge(sector + 1)],
            area: 0.0,
            middle: Pixel::default(),
            corners: 0,
        };
        (0..sectors).map(cell)
    };
    (0..rings).flat_map(ring).collect()
}

fn legend(drawing: &mut Drawing, [x, y]: [f64; 2], densest: f64) {
    const STEPS: usize = 24;
    const WIDE: f64 = 200.0;
    let part = WIDE / STEPS as f64;
    for step in 0..STEPS {
        let style = format!("fill:{}", GREENS.class(step, STEPS));
        drawing.rect([x + part * step as f64, y], [part + 0.5, 12.0], "patch", &style);
    }
    for (share, anchor) in [(0.0, Anchor::Start), (0.5, Anchor::Middle), (1.0, Anchor::End)] {
        let text = significant(1e4 * densest * share * share, 2);
        drawing.text([x + WIDE * share, y + 26.0], anchor, "tick", &text);
    }
    drawing.text([x + WIDE + 10.0, y + 11.0], Anchor::Start, "tick", "corners per 100 × 100 px");
    drawing.rect([x + 400.0, y], [18.0, 12.0], "cell empty", "");
    drawing.text([x + 425.0, y + 11.0], Anchor::Start, "tick", "no corner");
}
