//! Refinement of corners to a fraction of a pixel.
//!
//! W. Förstner and E. Gülch, "A fast operator for detection and precise location of distinct points, corners and
//! centres of circular features", ISPRS 1987: around a corner each grey-level gradient is orthogonal to the line from
//! the corner to the gradient's position.
//!
//! That holds for straight edges. In a fisheye image they bend, and all gradients of a bent edge point past the corner
//! on the same side: with radii of 600 px by a hundredth of a pixel. That is small beside the noise of one corner but
//! common to all corners of a target, so averaging does not remove it. If the camera is known, at least roughly, the
//! bend of the edges follows from it and the gradients are straightened: the frontal-plane refinement of A. Datta,
//! J.-S. Kim and T. Kanade, "Accurate camera calibration using iterative refinement of control points", ICCV Workshops
//! 2009, with the corner's surroundings straightened to the second order instead of the whole image.

use nalgebra::{Matrix2, Vector2};
use vergence_vision::KannalaBrandt;

use super::CornerQuality;
use super::intensity::Intensity;
use super::lattice::{Lattice, Node};
use super::predict::{Prediction, Predictor, cell};

/// A refined corner.
#[derive(Clone, Copy, Debug)]
pub struct Refined {
    pub position: Vector2<f64>,
    /// Standard deviation per axis in pixels, from how far the gradients miss the corner.
    pub sigma_px: f64,
}

/// Part of the distance to the neighbouring edges that the window reaches.
const WINDOW_PART: f64 = 0.5;

/// Least and greatest radius of the window in pixels. A smaller window holds no corner. The greatest was chosen by the
/// residuals of calibrations from real photographs: they grow slowly above it as edges curve, and on blurred images
/// below it.
const WINDOW_PX: [f64; 2] = [2.6, 9.0];

/// The window's radius where neighbouring edges are `spacing` pixels away.
fn window(spacing: f64) -> f64 {
    let [least, greatest] = WINDOW_PX;
    (WINDOW_PART * spacing).clamp(least, greatest)
}

/// Largest distance a refinement may move a corner where neighbouring edges are `spacing` pixels away. The search is
/// accurate to about a pixel, less where overexposed white erodes the corners of large black squares.
fn bound(spacing: f64) -> f64 {
    const PART: f64 = 0.15;
    const PX: [f64; 2] = [0.75, 5.0];
    (PART * spacing).clamp(PX[0], PX[1])
}

/// The corner near `start` by the gradients about it, in an image whose lattice there has the steps and bends of
/// `expected`; `None` if there is none, or at the image's border.
pub fn refine(image: &Intensity<'_>, start: Vector2<f64>, expected: &Prediction) -> Option<Refined> {
    const ITERATIONS: usize = 30;
    const SETTLED_PX: f64 = 1e-3;
    let (radius, bound) = (window(expected.spacing()), bound(expected.spacing()));
    let edges = Edges::of(expected)?;
    let mut position = start;
    for _ in 0..ITERATIONS {
        let fit = Fit::about(image, position, radius, &edges)?;
        let moved = fit.corner - position;
        position = fit.corner;
        let away = (position - start).norm();
        if away.is_nan() || away > bound {
            return None;
        }
        if moved.norm() < SETTLED_PX {
            return Some(Refined { position, sigma_px: fit.sigma_px });
        }
    }
    None
}

/// How edges run through a corner and bend.
struct Edges {
    steps_from_pixels: Matrix2<f64>,
    bends: [Vector2<f64>; 2],
}

impl Edges {
    fn of(expected: &Prediction) -> Option<Self> {
        // Where the cells only grow along an edge it stays straight; stretching that, too, would make the blur of the
        // crossing edge lopsided.
        let square_to = |bend: Vector2<f64>, step: Vector2<f64>| bend - step * (bend.dot(&step) / step.norm_squared());
        let [along, across] = expected.steps;
        let bends = [square_to(expected.bends[0], along), square_to(expected.bends[1], across)];
        Some(Self { steps_from_pixels: cell(&expected.steps).try_inverse()?, bends })
    }

    /// Where a place, in pixels from the corner, would be if the edges were straight, and how the place moves with
    /// that. To the second order: an edge's third is odd about the corner and does not move it.
    fn straightened(&self, place: Vector2<f64>) -> (Vector2<f64>, Matrix2<f64>) {
        let [along, across] = self.bends;
        let steps = self.steps_from_pixels * place;
        let bow = along * steps.x * steps.x + across * steps.y * steps.y;
        let by_steps = Matrix2::from_columns(&[along * (2.0 * steps.x), across * (2.0 * steps.y)]);
        (place - bow, Matrix2::identity() + by_steps * self.steps_from_pixels)
    }
}

/// One step of the refinement.
struct Fit {
    corner: Vector2<f64>,
    sigma_px: f64,
}

impl Fit {
    fn about(image: &Intensity<'_>, centre: Vector2<f64>, radius: f64, edges: &Edges) -> Option<Self> {
        let reach = radius.ceil() as i64;
        let (column, row) = (centre.x.round() as i64, centre.y.round() as i64);
        let (mut normal, mut moment, mut square, mut count) = (Matrix2::zeros(), Vector2::zeros(), 0.0, 0.0);
        for y in row - reach..=row + reach {
            for x in column - reach..=column + reach {
                let place = Vector2::new(x as f64, y as f64) - centre;
                // Falls smoothly to zero: as the window follows the corner no pixel jumps in or out.
                let weight = (1.0 - place.norm_squared() / (radius * radius)).max(0.0).powi(2);
                let (place, by_straight) = edges.straightened(place);
                let gradient = by_straight.tr_mul(&image.gradient(x, y)?);
                let along = gradient.dot(&place);
                normal += gradient * gradient.transpose() * weight;
                moment += gradient * along * weight;
                square += along * along * weight;
                count += weight;
            }
        }
        // Along a single edge the place is open: two edges at an angle φ give the eigenvalues 1 ± cos φ.
        const LEAST_EIGENVALUE_RATIO: f64 = 0.02;
        let eigenvalues = normal.symmetric_eigenvalues();
        if eigenvalues.min() <= LEAST_EIGENVALUE_RATIO * eigenvalues.max() {
            return None;
        }
        let inverse = normal.try_inverse()?;
        let shift = inverse * moment;
        let variance = (square - moment.dot(&shift)).max(0.0) / (count - 2.0).max(1.0);
        Some(Self { corner: centre + shift, sigma_px: (0.5 * variance * inverse.trace()).sqrt() })
    }
}

/// Refines every corner from where it is, along edges that `hint`, if given, knows to bend. Those that leave their
/// bounds keep their place.
pub fn refine_all(lattice: &mut Lattice, image: &Intensity<'_>, hint: Option<&KannalaBrandt>) {
    let predictor = Predictor::new(lattice, hint);
    let refined: Vec<(Node, Option<Refined>)> = lattice
        .iter()
        .map(|(&node, found)| {
            let expected = predictor.predict(lattice, node);
            (node, expected.and_then(|expected| refine(image, found.position, &expected.within(lattice.clear))))
        })
        .collect();
    for (node, refined) in refined {
        if let (Some(refined), Some(found)) = (refined, lattice.get_mut(node)) {
            (found.position, found.sigma_px) = (refined.position, refined.sigma_px);
            found.quality = CornerQuality::Good;
        }
    }
}
