//! Corners to a fraction of a pixel.
//!
//! W. Förstner and E. Gülch, "A fast operator for detection and precise location of distinct points, corners and
//! centres of circular features", ISPRS 1987: about a corner each grey-level gradient is square to the line from the
//! corner to the place of the gradient.

use nalgebra::{Matrix2, Vector2};

use super::CornerQuality;
use super::intensity::Intensity;
use super::lattice::{Lattice, Node};
use super::predict::Predictor;

/// A corner to a fraction of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Refined {
    pub position: Vector2<f64>,
    /// Standard deviation per axis in pixels, from how far the gradients miss the corner.
    pub sigma_px: f64,
}

/// Part of the distance to the neighbouring edges that the window reaches.
const WINDOW_PART: f64 = 0.5;

/// Least and greatest radius of the window in pixels. Less holds no corner. The greatest was chosen by the residuals of
/// calibrations from real photographs: they grow slowly above it as edges curve, and on blurred images below it.
const WINDOW_PX: [f64; 2] = [2.6, 9.0];

/// The window's radius where neighbouring edges are `spacing` pixels away.
pub fn window(spacing: f64) -> f64 {
    let [least, greatest] = WINDOW_PX;
    (WINDOW_PART * spacing).clamp(least, greatest)
}

/// How far a refinement may lead where neighbouring edges are `spacing` pixels away. The search is right to a pixel or
/// so; where overexposed white eats the corners of large black squares, to some.
pub fn bound(spacing: f64) -> f64 {
    const PART: f64 = 0.15;
    const PX: [f64; 2] = [0.75, 5.0];
    (PART * spacing).clamp(PX[0], PX[1])
}

/// The corner near `start`, no further than `bound` pixels from it, by the gradients in a window of `radius` pixels;
/// none if it is not there, or at the image's border.
pub fn refine(image: &Intensity<'_>, start: Vector2<f64>, radius: f64, bound: f64) -> Option<Refined> {
    const ITERATIONS: usize = 30;
    const SETTLED_PX: f64 = 1e-3;
    let mut position = start;
    for _ in 0..ITERATIONS {
        let fit = Fit::about(image, position, radius)?;
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

/// One step of the refinement.
struct Fit {
    corner: Vector2<f64>,
    sigma_px: f64,
}

impl Fit {
    fn about(image: &Intensity<'_>, centre: Vector2<f64>, radius: f64) -> Option<Self> {
        let reach = radius.ceil() as i64;
        let (column, row) = (centre.x.round() as i64, centre.y.round() as i64);
        let (mut normal, mut moment, mut square, mut count) = (Matrix2::zeros(), Vector2::zeros(), 0.0, 0.0);
        for y in row - reach..=row + reach {
            for x in column - reach..=column + reach {
                let place = Vector2::new(x as f64, y as f64) - centre;
                // Falls smoothly to zero: as the window follows the corner no pixel jumps in or out.
                let weight = (1.0 - place.norm_squared() / (radius * radius)).max(0.0).powi(2);
                let gradient = image.gradient(x, y)?;
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

/// Refines every corner of the search; those that leave their bounds keep their place and are marked.
pub fn refine_all(lattice: &mut Lattice, image: &Intensity<'_>) {
    let predictor = Predictor::new(lattice, None);
    let refined: Vec<(Node, Option<Refined>)> = lattice
        .iter()
        .map(|(&node, found)| {
            let spacing = predictor.predict(lattice, node).map(|expected| expected.spacing());
            let refined = spacing.and_then(|spacing| refine(image, found.position, window(spacing), bound(spacing)));
            (node, refined)
        })
        .collect();
    for (node, refined) in refined {
        if let (Some(refined), Some(found)) = (refined, lattice.get_mut(node)) {
            (found.position, found.sigma_px) = (refined.position, refined.sigma_px);
            found.quality = CornerQuality::Good;
        }
    }
}
