//! The splined stereographic model of mrcal.
//!
//! mrcal, "Lens models: splined stereographic": the stereographic image u = 2 tan(θ/2) (cos φ, sin φ) of a ray is moved by a B-spline surface
//! over u, and scaled by the focal lengths. The surface has Nx times Ny control points, evenly spaced over the field that the model's name states.

use nalgebra::Vector3;

use super::double_sphere::{must, positive};
use super::{Formula, LensSteps, ModelParameter, OntoPlane, ParameterUnit, Radtan};
use crate::{InvalidLens, Pixel};

/// The grid of control points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SplineGrid {
    /// Order of the spline: 2 or 3.
    pub order: usize,
    /// Number of control points across.
    pub columns: usize,
    /// Number of control points down.
    pub rows: usize,
    /// Full horizontal field in degrees over which they are spread.
    pub field_deg: f64,
}

impl SplineGrid {
    /// Intervals of the grid in a unit of u. A spline needs half an interval beyond its edge, or a whole one, by its order.
    #[must_use]
    pub fn intervals_per_unit(&self) -> f64 {
        let edge = 2.0 * (self.field_deg.to_radians() / 4.0).tan();
        let inside = self.columns as f64 - self.order as f64;
        inside / (2.0 * edge)
    }

    /// The first control point that acts at the place `at` of `points` along an axis, and the weights of it and those that follow.
    /// `None` beyond the edge.
    fn weights(&self, at: f64, points: usize) -> Option<(usize, [f64; 4])> {
        let last = points as f64 - if self.order == 3 { 3.0 } else { 2.0 };
        let nearest = if self.order == 3 { at.floor() } else { at.round() };
        // At the far edge itself the last interval of a cubic spline ends.
        let start = if self.order == 3 && at <= last + 1.0 { nearest.min(last) } else { nearest };
        let x = at - start;
        if !(1.0..=last).contains(&start) {
            return None;
        }
        let weights = if self.order == 3 {
            let (back, x2) = (1.0 - x, x * x);
            [
                back * back * back / 6.0,
                ((3.0 * x - 6.0) * x2 + 4.0) / 6.0,
                (((3.0 - 3.0 * x) * x + 3.0) * x + 1.0) / 6.0,
                x2 * x / 6.0,
            ]
        } else {
            [(2.0 * x - 1.0) * (2.0 * x - 1.0) / 8.0, 0.75 - x * x, (2.0 * x + 1.0) * (2.0 * x + 1.0) / 8.0, 0.0]
        };
        Some((start as usize - 1, weights))
    }
}

/// The splined stereographic model.
#[derive(Clone, Debug, PartialEq)]
pub struct SplinedStereographic {
    /// Focal lengths fx, fy and principal point cx, cy in pixels.
    pub pinhole: [f64; 4],
    /// The grid.
    pub grid: SplineGrid,
    /// The control points row by row: the shift of u along x and along y.
    pub control: Vec<[f64; 2]>,
}

impl SplinedStereographic {
    /// Column and row of the first control point that acts at u, and the weights of it and of those that follow, across and down; `None` beyond
    /// the edge.
    fn place(&self, u: [f64; 2]) -> Option<([usize; 2], [[f64; 4]; 2])> {
        let SplineGrid { columns, rows, .. } = self.grid;
        let scale = self.grid.intervals_per_unit();
        let place = |u: f64, points: usize| u * scale + (points as f64 - 1.0) / 2.0;
        let (left, across) = self.grid.weights(place(u[0], columns), columns)?;
        let (top, down) = self.grid.weights(place(u[1], rows), rows)?;
        Some(([left, top], [across, down]))
    }

    /// The control points that act at u, by their index, and the weight of each; `None` beyond the edge.
    #[must_use]
    pub fn weights(&self, u: [f64; 2]) -> Option<Vec<(usize, f64)>> {
        let SplineGrid { columns, order, .. } = self.grid;
        let ([left, top], [across, down]) = self.place(u)?;
        let used = || (0..=order).flat_map(|row| (0..=order).map(move |column| (row, column)));
        Some(used().map(|(row, column)| ((top + row) * columns + left + column, down[row] * across[column])).collect())
    }

    /// What the surface adds at u; `None` beyond its edge.
    fn shift(&self, u: [f64; 2]) -> Option<[f64; 2]> {
        let ([left, top], [across, down]) = self.place(u)?;
        let mut sum = [0.0; 2];
        for (row, down) in down.iter().enumerate().take(self.grid.order + 1) {
            let first = (top + row) * self.grid.columns + left;
            for ([x, y], across) in self.control.get(first..=first + self.grid.order)?.iter().zip(across) {
                let weight = down * across;
                sum = [sum[0] + weight * x, sum[1] + weight * y];
            }
        }
        Some(sum)
    }
}

impl Formula for SplinedStereographic {
    fn name(&self) -> &'static str {
        "splined stereographic"
    }

    fn parameters(&self) -> Vec<ModelParameter> {
        let point = |(index, [x, y]): (usize, &[f64; 2])| {
            let (row, column) = (index / self.grid.columns, index % self.grid.columns);
            [("x", x), ("y", y)].map(|(axis, value)| {
                ModelParameter::new(&format!("d{axis}_{row}_{column}"), ParameterUnit::One, *value)
            })
        };
        let SplineGrid { order, columns, rows, field_deg } = self.grid;
        let grid = [order as f64, columns as f64, rows as f64, field_deg];
        ModelParameter::named(&["order", "Nx", "Ny", "fov_x_deg"], ParameterUnit::One, &grid)
            .into_iter()
            .chain(ModelParameter::pinhole(self.pinhole))
            .chain(self.control.iter().enumerate().flat_map(point))
            .collect()
    }

    fn check(&self) -> Result<(), InvalidLens> {
        let SplineGrid { order, columns, rows, field_deg } = self.grid;
        must("order", order as f64, (2..=3).contains(&order), "be 2 or 3")?;
        let fewest = columns.min(rows);
        must("Nx or Ny", fewest as f64, fewest > order, "be more than the order")?;
        must("fov_x_deg", field_deg, field_deg > 0.0 && field_deg < 360.0, "lie between 0 and 360")?;
        let points = self.control.len();
        must("number of control points", points as f64, points == columns * rows, "be Nx times Ny")?;
        positive(&self.pinhole)
    }

    /// The corner of the grid.
    fn ends(&self) -> f64 {
        let SplineGrid { columns, rows, order, .. } = self.grid;
        let half = |points: usize| (points as f64 - order as f64) / 2.0 / self.grid.intervals_per_unit();
        let corner = half(columns).hypot(half(rows));
        2.0 * (corner / 2.0).atan()
    }

    fn image(&self, d: &Vector3<f64>) -> Option<Pixel> {
        let ahead = d.norm() + d.z;
        let u = [2.0 * d.x / ahead, 2.0 * d.y / ahead];
        let shift = self.shift(u)?;
        let [fx, fy, cx, cy] = self.pinhole;
        Some(Pixel { u: fx * (u[0] + shift[0]) + cx, v: fy * (u[1] + shift[1]) + cy })
    }

    fn steps(&self) -> Option<LensSteps> {
        let onto_plane = OntoPlane::Stereographic(self.clone());
        Some(LensSteps::new(onto_plane, Radtan::default(), self.pinhole, 0.0))
    }
}
