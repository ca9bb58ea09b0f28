//! Predicts the position of a corner from the others.

use nalgebra::{Matrix2, Matrix3, OMatrix, OVector, SMatrix, SVector, U6, Vector2, Vector3};
use vergence_vision::{Camera, KannalaBrandt, Pixel, UnitRay};

use super::CornerQuality;
use super::lattice::{Found, Lattice, Node};

/// A predicted corner and the local shape of the target.
#[derive(Clone, Copy, Debug)]
pub struct Prediction {
    /// u and v.
    pub position: Vector2<f64>,
    /// Pixels per step along the lattice's two axes.
    pub steps: [Vector2<f64>; 2],
    /// Curvature of the lattice's two axes: pixels per squared step. Zero if the camera is unknown.
    pub bends: [Vector2<f64>; 2],
    /// Variance of the prediction in units of one corner's variance.
    pub variance: f64,
}

impl Prediction {
    /// The distance of the neighbouring edges in pixels: the lesser height of the cell's parallelogram.
    pub fn spacing(&self) -> f64 {
        let [along, across] = self.steps;
        along.perp(&across).abs() / along.norm().max(across.norm())
    }
}

/// Predicts corners of a lattice from the corners about them, never from the corner itself.
#[derive(Clone, Copy, Debug)]
pub struct Predictor<'a> {
    plane: Option<TargetPlane<'a>>,
}

impl<'a> Predictor<'a> {
    /// With `hint`, through that camera if it sees the corners as a plane to a tenth of a cell.
    pub fn new(lattice: &Lattice, hint: Option<&'a KannalaBrandt>) -> Self {
        Self { plane: hint.and_then(|camera| TargetPlane::fit(camera, lattice)) }
    }

    /// Predicted corner at `node`; `None` if too few corners are near.
    pub fn predict(&self, lattice: &Lattice, node: Node) -> Option<Prediction> {
        let smooth = smooth_continuation(lattice, node)?;
        let Some(plane) = self.plane else { return Some(smooth) };
        plane.predict(lattice, node).or(Some(smooth))
    }
}

/// Reach of the corners that a prediction uses.
const REACH: i32 = 3;

/// A polynomial of second order in the lattice's coordinates about `node`, or of first order where rows are few.
fn smooth_continuation(lattice: &Lattice, node: Node) -> Option<Prediction> {
    // Near corners count more: a fisheye image of a plane is smooth but no polynomial.
    const WEIGHT_RADIUS: f64 = 1.0;
    let mut normal = OMatrix::<f64, U6, U6>::zeros();
    let mut moments = SMatrix::<f64, 6, 2>::zeros();
    let (mut columns, mut rows, mut count) = (0_u32, 0_u32, 0);
    for (at, found) in usable(lattice, node, REACH) {
        let (di, dj) = (at[0] - node[0], at[1] - node[1]);
        columns |= 1 << (di + REACH);
        rows |= 1 << (dj + REACH);
        count += 1;
        let (x, y) = (f64::from(di), f64::from(dj));
        let weight = (-(x * x + y * y) / (2.0 * WEIGHT_RADIUS * WEIGHT_RADIUS)).exp();
        let terms = SVector::<f64, 6>::from([1.0, x, y, x * x, x * y, y * y]);
        normal += weight * terms * terms.transpose();
        moments += weight * terms * found.position.transpose();
    }
    let [columns, rows] = [columns, rows].map(u32::count_ones);
    if columns >= 3 && rows >= 3 && count >= 8 {
        solved(normal, moments).or_else(|| linear(&normal, &moments))
    } else if columns >= 2 && rows >= 2 && count >= 4 {
        linear(&normal, &moments)
    } else {
        None
    }
}

/// The solution with all six terms.
fn solved(normal: OMatrix<f64, U6, U6>, moments: SMatrix<f64, 6, 2>) -> Option<Prediction> {
    let inverse = normal.cholesky()?.inverse();
    // A set of corners that leaves a term open (all on one conic) shows as a huge variance.
    const LARGEST_VARIANCE: f64 = 1e3;
    let variance = *inverse.get((0, 0))?;
    (variance < LARGEST_VARIANCE).then(|| prediction(&(inverse * moments).fixed_rows::<3>(0).into_owned(), variance))
}

/// The solution with constant and linear terms only.
fn linear(normal: &OMatrix<f64, U6, U6>, moments: &SMatrix<f64, 6, 2>) -> Option<Prediction> {
    let inverse = normal.fixed_view::<3, 3>(0, 0).into_owned().cholesky()?.inverse();
    Some(prediction(&(inverse * moments.fixed_rows::<3>(0)), *inverse.get((0, 0))?))
}

fn prediction(terms: &SMatrix<f64, 3, 2>, variance: f64) -> Prediction {
    let [position, along, across] = [0, 1, 2].map(|i| terms.row(i).transpose());
    Prediction { position, steps: [along, across], bends: [Vector2::zeros(); 2], variance }
}

/// Corners near `node` that are not known to be wrong.
fn usable(lattice: &Lattice, node: Node, reach: i32) -> impl Iterator<Item = (Node, &Found)> {
    lattice.around(node, reach).filter(|(_, found)| found.quality != CornerQuality::Blunder)
}

/// A plane seen through a camera: rays are homogeneous coordinates of lattice nodes.
#[derive(Clone, Copy, Debug)]
struct TargetPlane<'a> {
    camera: &'a KannalaBrandt,
    ray_from_node: Matrix3<f64>,
}

impl<'a> TargetPlane<'a> {
    /// The direct linear transformation on rays (R. Hartley and A. Zisserman, "Multiple View Geometry", 2nd ed.,
    /// alg. 4.1): ray × (H node) = 0, which holds at any angle to the axis. Weights make the error an angle.
    fn fit(camera: &'a KannalaBrandt, lattice: &Lattice) -> Option<Self> {
        const FEWEST: usize = 8;
        let usable = lattice.iter().filter(|(_, found)| found.quality != CornerQuality::Blunder);
        let observed_views: Vec<(Node, Vector3<f64>)> =
            usable.filter_map(|(&node, found)| Some((node, ray(camera, found.position)?))).collect();
        if observed_views.len() < FEWEST {
            return None;
        }
        let mut plane = Self { camera, ray_from_node: Matrix3::zeros() };
        for _ in 0..3 {
            plane.ray_from_node = plane.reweighted(&observed_views)?;
        }
        plane.explains(lattice).then_some(plane)
    }

    fn reweighted(&self, observed_views: &[(Node, Vector3<f64>)]) -> Option<Matrix3<f64>> {
        let mut normal = SMatrix::<f64, 9, 9>::zeros();
        for (node, ray) in observed_views {
            let node = homogeneous(*node);
            let depth = (self.ray_from_node * node).norm();
            let weight = if depth > 0.0 { depth.recip() } else { 1.0 };
            // Rows of [ray]× (H node), with H row by row in a vector of nine.
            let rows = ray.cross_matrix().kronecker(&node.transpose()) * weight;
            normal += rows.transpose() * rows;
        }
        let eigen = normal.symmetric_eigen();
        let least = eigen.eigenvalues.imin();
        let h: OVector<f64, _> = eigen.eigenvectors.column(least).into_owned();
        let matrix = Matrix3::from_row_iterator(h.iter().copied());
        let towards: f64 =
            observed_views.iter().map(|(node, ray)| ray.dot(&(matrix * homogeneous(*node))).signum()).sum();
        towards.is_finite().then(|| matrix * towards.signum())
    }

    /// Whether the root mean square of the distances is below a tenth of the mean cell's side.
    fn explains(&self, lattice: &Lattice) -> bool {
        const PART_OF_CELL: f64 = 0.1;
        let (mut squares, mut areas) = (0.0, 0.0);
        for (&node, found) in lattice.iter().filter(|(_, found)| found.quality != CornerQuality::Blunder) {
            let Some(expected) = self.project(node) else { return false };
            squares += (expected.position - found.position).norm_squared();
            areas += expected.steps[0].perp(&expected.steps[1]).abs();
        }
        squares < PART_OF_CELL * PART_OF_CELL * areas
    }

    /// Projection of the node, without the observations near it.
    fn project(&self, node: Node) -> Option<Prediction> {
        const HALF: f64 = 0.5;
        let at = |di: f64, dj: f64| {
            let ray = UnitRay::<Camera>::new(self.ray_from_node * (homogeneous(node) + Vector3::new(di, dj, 0.0)))?;
            let pixel = self.camera.project(&ray).ok()?;
            Some(Vector2::new(pixel.u, pixel.v))
        };
        let here = at(0.0, 0.0)?;
        // One-sided, and without a bend, where the field ends within half a cell.
        let step = |di: f64, dj: f64| match (at(di, dj), at(-di, -dj)) {
            (Some(ahead), Some(behind)) => Some((ahead - behind, 2.0 * (ahead - 2.0 * here + behind))),
            (Some(ahead), None) => Some((2.0 * (ahead - here), Vector2::zeros())),
            (None, Some(behind)) => Some((2.0 * (here - behind), Vector2::zeros())),
            (None, None) => None,
        };
        let ((along, along_bend), (across, across_bend)) = (step(HALF, 0.0)?, step(0.0, HALF)?);
        Some(Prediction { position: here, steps: [along, across], bends: [along_bend, across_bend], variance: 0.0 })
    }

    /// The projection, corrected by the mean residual of the nearest corners.
    fn predict(&self, lattice: &Lattice, node: Node) -> Option<Prediction> {
        const NEAR: i32 = 2;
        let projected = self.project(node)?;
        let (mut shift, mut sum) = (Vector2::zeros(), 0.0);
        for (at, found) in usable(lattice, node, NEAR) {
            if let Some(expected) = self.project(at) {
                let (di, dj) = (f64::from(at[0] - node[0]), f64::from(at[1] - node[1]));
                let weight = 1.0 / (di * di + dj * dj);
                shift += (found.position - expected.position) * weight;
                sum += weight;
            }
        }
        let position = projected.position + shift / sum;
        (sum > 0.0).then(|| Prediction { position, variance: 1.0 / sum, ..projected })
    }
}

fn homogeneous(node: Node) -> Vector3<f64> {
    Vector3::new(f64::from(node[0]), f64::from(node[1]), 1.0)
}

fn ray(camera: &KannalaBrandt, position: Vector2<f64>) -> Option<Vector3<f64>> {
    let ray = camera.unproject::<Camera>(Pixel { u: position.x, v: position.y }).ok()?;
    Some(ray.vector())
}

/// Turns offsets in cells into offsets in pixels.
pub fn cell(steps: &[Vector2<f64>; 2]) -> Matrix2<f64> {
    Matrix2::from_columns(steps)
}
