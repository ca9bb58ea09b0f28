//! Rays through the surfaces of a design.

use crate::design::Design;
use crate::error::LostRay;
use crate::surface::Ray;

/// What ends a ray besides the glass itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limits {
    /// Nothing: a surface has no rim.
    None,
    /// The stop alone.
    Stop,
    /// The stop and the rims of all surfaces.
    Rims,
}

impl Design {
    /// The ray behind the last surface of one that comes from the scene.
    ///
    /// # Errors
    /// Where the ray ends.
    pub fn trace(&self, ray: &Ray, limits: Limits) -> Result<Ray, LostRay> {
        self.trace_through(ray, self.surfaces.len(), limits)
    }

    /// The ray where it meets the stop, with its direction behind it.
    ///
    /// # Errors
    /// Where the ray ends before.
    pub fn trace_to_stop(&self, ray: &Ray, limits: Limits) -> Result<Ray, LostRay> {
        self.trace_through(ray, self.stop + 1, limits)
    }

    /// Where a ray that comes from the scene meets the plane of the image, in millimetres.
    ///
    /// # Errors
    /// Where the ray ends before.
    pub fn on_image(&self, ray: &Ray, limits: Limits) -> Result<[f64; 2], LostRay> {
        let last = self.trace(ray, limits)?;
        let to_image = (self.image - last.at.z) / last.along.z;
        let at = last.at + last.along * to_image;
        Ok([at.x, at.y])
    }

    fn trace_through(&self, ray: &Ray, surfaces: usize, limits: Limits) -> Result<Ray, LostRay> {
        let mut ray = *ray;
        for (index, surface) in self.surfaces[..surfaces].iter().enumerate() {
            let number = index + 1;
            let at = surface.meet(&ray).ok_or(LostRay::Missed(number))?;
            let limited = limits == Limits::Rims || (limits == Limits::Stop && index == self.stop);
            if limited && at.x.hypot(at.y) > surface.rim {
                return Err(LostRay::Rim(number));
            }
            let along = surface.refract(&at, &ray.along).ok_or(LostRay::TotalReflection(number))?;
            ray = Ray { at, along };
        }
        Ok(ray)
    }
}
