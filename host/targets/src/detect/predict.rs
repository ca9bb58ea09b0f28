//! Predicts the position of a corner from the others.

use nalgebra::{Matrix2, OMatrix, SMatrix, SVector, U6, Vector2};
use vergence_vision::KannalaBrandt;

use super::CornerQuality;
use super::lattice::{Found, Lattice, Node};
use super::plane::TargetPlane;

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

    /// The same in steps that are `part` of these.
    pub fn within(self, part: f64) -> Self {
        Self { steps: self.steps.map(|step| step * part), bends: self.bends.map(|bend| bend * (part * part)), ..self }
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
        Self { plane: hint.and_then(|camera| plane_of(camera, lattice)) }
    }

    /// Predicted corner at `node`; `None` if too few corners are near.
    pub fn predict(&self, lattice: &Lattice, node: Node) -> Option<Prediction> {
        let smooth = smooth_continuation(lattice, node)?;
        let Some(plane) = self.plane else { return Some(smooth) };
        corrected(&plane, lattice, node).or(Some(smooth))
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

/// The plane of a lattice, whose nodes are its places.
fn plane_of<'a>(camera: &'a KannalaBrandt, lattice: &Lattice) -> Option<TargetPlane<'a>> {
    let usable = lattice.iter().filter(|(_, found)| found.quality != CornerQuality::Blunder);
    let observed: Vec<_> = usable.map(|(&node, found)| (place(node), found.position)).collect();
    TargetPlane::fit(camera, &observed)
}

/// The projection of `node`, corrected by the mean residual of the nearest corners.
fn corrected(plane: &TargetPlane<'_>, lattice: &Lattice, node: Node) -> Option<Prediction> {
    const NEAR: i32 = 2;
    let projected = plane.project(place(node))?;
    let (mut shift, mut sum) = (Vector2::zeros(), 0.0);
    for (at, found) in usable(lattice, node, NEAR) {
        if let Some(expected) = plane.project(place(at)) {
            let (di, dj) = (f64::from(at[0] - node[0]), f64::from(at[1] - node[1]));
            let weight = 1.0 / (di * di + dj * dj);
            shift += (found.position - expected.position) * weight;
            sum += weight;
        }
    }
    let position = projected.position + shift / sum;
    (sum > 0.0).then(|| Prediction { position, variance: 1.0 / sum, ..projected })
}

fn place(node: Node) -> Vector2<f64> {
    Vector2::new(f64::from(node[0]), f64::from(node[1]))
}

/// Turns offsets in cells into offsets in pixels.
pub fn cell(steps: &[Vector2<f64>; 2]) -> Matrix2<f64> {
    Matrix2::from_columns(steps)
}
