//! The rays of pixels and of points between them, without solving the lens equation for each.

use nalgebra::Vector3;
use vergence_vision::{Camera, KannalaBrandt, Pixel, Transform, UnitRay, World};

/// The rays of the pixel centres of some rows and of their neighbours, in the world.
pub struct RayGrid<'a> {
    camera: &'a KannalaBrandt,
    world_from_camera: &'a Transform<World, Camera>,
    top: u32,
    /// One row above to one row below; each from one column left to one column right of the image.
    rays: Vec<Option<Vector3<f64>>>,
}

/// A pixel's ray and how it changes about the pixel.
pub struct Around<'a> {
    grid: &'a RayGrid<'a>,
    pixel: Pixel,
    centre: Vector3<f64>,
    /// First and second derivatives per pixel: u, v, uu, uv, vv. `None` at the edge of the field.
    derivatives: Option<[Vector3<f64>; 5]>,
}

impl<'a> RayGrid<'a> {
    /// For the `rows` rows from `top` on.
    pub fn new(
        camera: &'a KannalaBrandt,
        world_from_camera: &'a Transform<World, Camera>,
        top: u32,
        rows: u32,
    ) -> Self {
        let mut grid = Self { camera, world_from_camera, top, rays: Vec::new() };
        let width = camera.size().width;
        grid.rays = (0..rows + 2)
            .flat_map(|row| (0..width + 2).map(move |column| (row, column)))
            .map(|(row, column)| {
                grid.solve(Pixel { u: f64::from(column) - 1.0, v: f64::from(top) + f64::from(row) - 1.0 })
            })
            .collect();
        grid
    }

    /// The ray of a pixel of the grid's rows; `None` outside the field.
    pub fn around(&'a self, x: u32, y: u32) -> Option<Around<'a>> {
        let stride = self.camera.size().width as usize + 2;
        let middle = ((y - self.top) as usize + 1) * stride + x as usize + 1;
        let ray = |row: usize, column: usize| self.rays[middle + row * stride + column - stride - 1];
        let centre = ray(1, 1)?;
        let derivatives = || {
            let (west, east, north, south) = (ray(1, 0)?, ray(1, 2)?, ray(0, 1)?, ray(2, 1)?);
            let twist = ray(2, 2)? - ray(2, 0)? - ray(0, 2)? + ray(0, 0)?;
            let bend = |a: Vector3<f64>, b: Vector3<f64>| a - 2.0 * centre + b;
            Some([0.5 * (east - west), 0.5 * (south - north), bend(west, east), 0.25 * twist, bend(north, south)])
        };
        let pixel = Pixel { u: f64::from(x), v: f64::from(y) };
        Some(Around { grid: self, pixel, centre, derivatives: derivatives() })
    }

    fn solve(&self, pixel: Pixel) -> Option<Vector3<f64>> {
        let ray: UnitRay<Camera> = self.camera.unproject(pixel).ok()?;
        Some((*self.world_from_camera * ray).vector())
    }
}

impl Around<'_> {
    /// The ray through the pixel's centre, exactly.
    pub const fn centre(&self) -> Vector3<f64> {
        self.centre
    }

    /// The ray `offset` = (u, v) pixels from the pixel's centre; `None` outside the field.
    ///
    /// By Taylor's series to the second order. The third is below (offset / focal length in pixels)³: less than a
    /// ten-thousandth of a pixel for any offset that matters.
    pub fn at(&self, [u, v]: [f64; 2]) -> Option<Vector3<f64>> {
        let Some([du, dv, duu, duv, dvv]) = self.derivatives else {
            return self.grid.solve(Pixel { u: self.pixel.u + u, v: self.pixel.v + v });
        };
        let ray = self.centre + du * u + dv * v + duu * (0.5 * u * u) + duv * (u * v) + dvv * (0.5 * v * v);
        Some(ray / ray.norm())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;
    use vergence_vision::{Angle, ImageSize};

    #[test]
    fn the_series_agrees_with_the_lens_equation() {
        let size = ImageSize { width: 640, height: 640 };
        let centre = Pixel { u: 321.3, v: 317.9 };
        let k = [187.0, -3.0, 0.4, 0.0, 0.0];
        let camera = KannalaBrandt::new(k, 1.002, centre, Angle::from_deg(98.0), size).unwrap();
        let pose = Transform::new(UnitQuaternion::from_euler_angles(0.3, -1.1, 0.2), Vector3::zeros());
        let grid = RayGrid::new(&camera, &pose, 300, 40);
        for (x, y) in [(321, 318), (100, 320), (15, 310), (620, 339), (400, 300)] {
            let around = grid.around(x, y).unwrap();
            for offset in [[0.0, 0.0], [0.5, -0.5], [1.4, 1.1], [-2.0, 0.3]] {
                let exact = grid.solve(Pixel { u: f64::from(x) + offset[0], v: f64::from(y) + offset[1] }).unwrap();
                let error_px = (around.at(offset).unwrap() - exact).norm() * 187.0;
                assert!(error_px < 2e-4, "{error_px} px at ({x}, {y}) + {offset:?}");
            }
        }
    }
}
