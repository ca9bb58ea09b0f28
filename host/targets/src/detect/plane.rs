//! A flat target seen through a known camera: where its points are expected in the image.

use nalgebra::{Matrix3, OVector, SMatrix, Vector2, Vector3};
use vergence_vision::{Camera, KannalaBrandt, Pixel, UnitRay};

use super::predict::Prediction;

/// A plane seen through a camera: rays are homogeneous coordinates of places on the plane, which are counted in cells.
#[derive(Clone, Copy, Debug)]
pub struct TargetPlane<'a> {
    camera: &'a KannalaBrandt,
    ray_from_place: Matrix3<f64>,
}

/// A place on the plane, in cells, and where it is in the image.
pub type Observed = (Vector2<f64>, Vector2<f64>);

impl<'a> TargetPlane<'a> {
    /// The direct linear transformation on rays (R. Hartley and A. Zisserman, "Multiple View Geometry", 2nd ed.,
    /// alg. 4.1): ray × (H place) = 0, which holds at any angle to the axis. Weights make the error an angle. `None` where
    /// the camera does not see the places as a plane to a tenth of a cell.
    pub fn fit(camera: &'a KannalaBrandt, observed: &[Observed]) -> Option<Self> {
        const FEWEST: usize = 8;
        let views: Vec<(Vector2<f64>, Vector3<f64>)> =
            observed.iter().filter_map(|(place, at)| Some((*place, ray(camera, *at)?))).collect();
        if views.len() < FEWEST {
            return None;
        }
        let mut plane = Self { camera, ray_from_place: Matrix3::zeros() };
        for _ in 0..3 {
            plane.ray_from_place = plane.reweighted(&views)?;
        }
        plane.explains(observed).then_some(plane)
    }

    fn reweighted(&self, views: &[(Vector2<f64>, Vector3<f64>)]) -> Option<Matrix3<f64>> {
        let mut normal = SMatrix::<f64, 9, 9>::zeros();
        for (place, ray) in views {
            let place = place.push(1.0);
            let depth = (self.ray_from_place * place).norm();
            let weight = if depth > 0.0 { depth.recip() } else { 1.0 };
            // Rows of [ray]× (H place), with H row by row in a vector of nine.
            let rows = ray.cross_matrix().kronecker(&place.transpose()) * weight;
            normal += rows.transpose() * rows;
        }
        let eigen = normal.symmetric_eigen();
        let least = eigen.eigenvalues.imin();
        let h: OVector<f64, _> = eigen.eigenvectors.column(least).into_owned();
        let matrix = Matrix3::from_row_iterator(h.iter().copied());
        let towards: f64 = views.iter().map(|(place, ray)| ray.dot(&(matrix * place.push(1.0))).signum()).sum();
        towards.is_finite().then(|| matrix * towards.signum())
    }

    /// Whether the root mean square of the distances is below a tenth of the mean cell's side.
    fn explains(&self, observed: &[Observed]) -> bool {
        const PART_OF_CELL: f64 = 0.1;
        let (mut squares, mut areas) = (0.0, 0.0);
        for (place, at) in observed {
            let Some(expected) = self.project(*place) else { return false };
            squares += (expected.position - at).norm_squared();
            areas += expected.steps[0].perp(&expected.steps[1]).abs();
        }
        squares < PART_OF_CELL * PART_OF_CELL * areas
    }

    /// Projection of the place, without the observations near it.
    pub fn project(&self, place: Vector2<f64>) -> Option<Prediction> {
        const HALF: f64 = 0.5;
        let at = |dx: f64, dy: f64| {
            let ray = UnitRay::<Camera>::new(self.ray_from_place * (place + Vector2::new(dx, dy)).push(1.0))?;
            let pixel = self.camera.project(&ray).ok()?;
            Some(Vector2::new(pixel.u, pixel.v))
        };
        let here = at(0.0, 0.0)?;
        // One-sided, and without a bend, where the field ends within half a cell.
        let step = |dx: f64, dy: f64| match (at(dx, dy), at(-dx, -dy)) {
            (Some(ahead), Some(behind)) => Some((ahead - behind, 2.0 * (ahead - 2.0 * here + behind))),
            (Some(ahead), None) => Some((2.0 * (ahead - here), Vector2::zeros())),
            (None, Some(behind)) => Some((2.0 * (here - behind), Vector2::zeros())),
            (None, None) => None,
        };
        let ((along, along_bend), (across, across_bend)) = (step(HALF, 0.0)?, step(0.0, HALF)?);
        Some(Prediction { position: here, steps: [along, across], bends: [along_bend, across_bend], variance: 0.0 })
    }
}

fn ray(camera: &KannalaBrandt, position: Vector2<f64>) -> Option<Vector3<f64>> {
    let ray = camera.unproject::<Camera>(Pixel { u: position.x, v: position.y }).ok()?;
    Some(ray.vector())
}
