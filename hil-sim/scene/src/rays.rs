//! The rays of pixels and of points between them, without solving the lens equation for each.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use vergence_vision::{Angle, Camera, ImageSize, Pixel, Transform, World};

use crate::lens::{Lens, LensRays};

/// A lens with its pose.
pub struct PosedLens<'a> {
    lens: &'a dyn Lens,
    rays: &'a LensRays<'a>,
    /// Whether all light goes through the origin.
    is_central: bool,
    world_from_camera: Matrix3<f64>,
    origin: Vector3<f64>,
}

/// The rays of the pixel centres of an image and of their neighbours, in the world.
pub struct RayGrid<'a> {
    posed: &'a PosedLens<'a>,
    stride: usize,
    /// One row above to one row below; each from one column left to one column right. NaN outside the field.
    rays: &'a [[f64; 3]],
}

/// A pixel's ray and its neighbours'.
pub struct Around<'a> {
    grid: &'a RayGrid<'a>,
    pixel: Pixel,
    /// Index of the pixel in the grid of rays.
    middle: usize,
    centre: Vector3<f64>,
}

/// Derivatives of a ray about a pixel.
pub struct Nearby<'a> {
    posed: &'a PosedLens<'a>,
    pixel: Pixel,
    centre: Vector3<f64>,
    /// First and second derivatives per pixel: u, v, uu, uv, vv. `None` at the edge of the field.
    derivatives: Option<[Vector3<f64>; 5]>,
}

impl<'a> PosedLens<'a> {
    /// `rays` are those of `lens`.
    pub fn new(lens: &'a dyn Lens, rays: &'a LensRays<'a>, world_from_camera: &Transform<World, Camera>) -> Self {
        Self {
            lens,
            rays,
            is_central: lens.pupil(Angle::from_rad(0.0)).is_none(),
            world_from_camera: world_from_camera.rotation().to_rotation_matrix().into_inner(),
            origin: world_from_camera.origin().mm(),
        }
    }

    /// Where light from a direction of the world crosses the axis: the camera's origin, or the pupil of that angle.
    #[inline]
    pub fn start(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        if self.is_central {
            return self.origin;
        }
        let axis = self.world_from_camera.column(2);
        let theta = Angle::from_rad(axis.dot(direction).clamp(-1.0, 1.0).acos());
        self.lens.pupil(theta).map_or(self.origin, |shift| self.origin + axis * shift.mm())
    }

    /// The ray of one point; `None` outside the field.
    fn ray(&self, pixel: Pixel) -> Option<Vector3<f64>> {
        self.in_world(self.rays.directions(&[[pixel.u, pixel.v]]).first()?)
    }

    #[inline]
    fn in_world(&self, ray: &[f64; 3]) -> Option<Vector3<f64>> {
        (!ray[2].is_nan()).then(|| self.world_from_camera * Vector3::from(*ray))
    }
}

/// The directions of the light of all pixels of an image and of one more on every side, row by row, in the camera's frame; not numbers outside
/// the field. A true lens searches each of them.
pub fn directions_of_all(size: ImageSize, rays: &LensRays<'_>) -> Vec<[f64; 3]> {
    let row =
        |y: u32| -> Vec<[f64; 2]> { (0..size.width + 2).map(|x| [f64::from(x) - 1.0, f64::from(y) - 1.0]).collect() };
    (0..size.height + 2).into_par_iter().flat_map_iter(|y| rays.directions(&row(y))).collect()
}

impl<'a> RayGrid<'a> {
    /// For the whole image of `columns` with the rays of [`directions_of_all`].
    pub const fn of_table(posed: &'a PosedLens<'a>, rays: &'a [[f64; 3]], columns: u32) -> Self {
        Self { posed, stride: columns as usize + 2, rays }
    }

    /// The ray of a pixel; `None` outside the field.
    #[inline]
    pub fn around(&'a self, x: u32, y: u32) -> Option<Around<'a>> {
        let middle = (y as usize + 1) * self.stride + x as usize + 1;
        let centre = self.posed.in_world(&self.rays[middle])?;
        Some(Around { grid: self, pixel: Pixel { u: f64::from(x), v: f64::from(y) }, middle, centre })
    }
}

impl<'a> Around<'a> {
    /// The ray through the pixel's centre, exactly.
    pub const fn centre(&self) -> Vector3<f64> {
        self.centre
    }

    /// Where light from a direction of the world crosses the axis of the lens, in the world.
    #[inline]
    pub fn start(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        self.grid.posed.start(direction)
    }

    /// The rays about the pixel's centre.
    pub fn nearby(&self) -> Nearby<'a> {
        let (grid, centre) = (self.grid, self.centre);
        let ray = |row: usize, column: usize| {
            grid.posed.in_world(&grid.rays[self.middle + row * grid.stride + column - grid.stride - 1])
        };
        let derivatives = || {
            let (west, east, north, south) = (ray(1, 0)?, ray(1, 2)?, ray(0, 1)?, ray(2, 1)?);
            let twist = ray(2, 2)? - ray(2, 0)? - ray(0, 2)? + ray(0, 0)?;
            let bend = |a: Vector3<f64>, b: Vector3<f64>| a - 2.0 * centre + b;
            Some([0.5 * (east - west), 0.5 * (south - north), bend(west, east), 0.25 * twist, bend(north, south)])
        };
        Nearby { posed: grid.posed, pixel: self.pixel, centre, derivatives: derivatives() }
    }
}

impl Nearby<'_> {
    /// The ray `offset` = (u, v) pixels from the pixel's centre; `None` outside the field.
    ///
    /// By Taylor's series to the second order. The third is below (offset / focal length in pixels)³: less than a
    /// ten-thousandth of a pixel for any offset that matters.
    pub fn at(&self, [u, v]: [f64; 2]) -> Option<Vector3<f64>> {
        let Some([du, dv, duu, duv, dvv]) = self.derivatives else {
            return self.posed.ray(Pixel { u: self.pixel.u + u, v: self.pixel.v + v });
        };
        let ray = self.centre + du * u + dv * v + duu * (0.5 * u * u) + duv * (u * v) + dvv * (0.5 * v * v);
        Some(ray * (1.0 / ray.norm()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;
    use vergence_vision::{ImageSize, KannalaBrandt};

    #[test]
    fn the_series_agrees_with_the_lens_equation() {
        let size = ImageSize { width: 640, height: 640 };
        let centre = Pixel { u: 321.3, v: 317.9 };
        let k = [187.0, -3.0, 0.4, 0.0, 0.0];
        let camera = KannalaBrandt::new(k, 1.002, centre, Angle::from_deg(98.0), size).unwrap();
        let pose = Transform::new(UnitQuaternion::from_euler_angles(0.3, -1.1, 0.2), Vector3::zeros());
        let rays = camera.rays();
        let posed = PosedLens::new(&camera, &rays, &pose);
        let of_pixels = directions_of_all(size, &rays);
        let grid = RayGrid::of_table(&posed, &of_pixels, size.width);
        for (x, y) in [(321, 318), (100, 320), (15, 310), (620, 339), (400, 300)] {
            let nearby = grid.around(x, y).unwrap().nearby();
            for offset in [[0.0, 0.0], [0.5, -0.5], [1.4, 1.1], [-2.0, 0.3]] {
                let pixel = Pixel { u: f64::from(x) + offset[0], v: f64::from(y) + offset[1] };
                let exact = (pose * camera.unproject::<Camera>(pixel).unwrap()).vector();
                let error_px = (nearby.at(offset).unwrap() - exact).norm() * 187.0;
                assert!(error_px < 2e-4, "{error_px} px at ({x}, {y}) + {offset:?}");
            }
        }
    }
}
