//! Rays near the axis: focal length, focus and entrance pupil (Welford, chapter 3).

use crate::design::Design;

/// A ray in a plane through the axis, so near to it that sines and tangents are angles.
#[derive(Clone, Copy)]
struct NearAxis {
    height: f64,
    slope: f64,
}

impl Design {
    /// The focal length in millimetres.
    #[must_use]
    pub fn focal_length(&self) -> f64 {
        -1.0 / self.parallel_to_axis().slope
    }

    /// The distance from the last surface to the focus of light from infinity, in millimetres.
    #[must_use]
    pub fn back_focus(&self) -> f64 {
        let last = self.parallel_to_axis();
        -last.height / last.slope
    }

    /// The place on the axis of the paraxial entrance pupil: the image of the stop by the surfaces in front of it.
    #[must_use]
    pub fn entrance_pupil(&self) -> f64 {
        // Backwards from the centre of the stop.
        let mut ray = NearAxis { height: 0.0, slope: 1.0 };
        let mut at = self.surfaces[self.stop].vertex;
        for surface in self.surfaces[..self.stop].iter().rev() {
            ray.height += ray.slope * (surface.vertex - at);
            at = surface.vertex;
            let bent = surface.index_behind * ray.slope
                + ray.height * surface.curvature * (surface.index_behind - surface.index_before);
            ray.slope = bent / surface.index_before;
        }
        at - ray.height / ray.slope
    }

    /// The ray behind the last surface of one that comes parallel to the axis at a height of one.
    fn parallel_to_axis(&self) -> NearAxis {
        let mut ray = NearAxis { height: 1.0, slope: 0.0 };
        let mut at = 0.0;
        for surface in &self.surfaces {
            ray.height += ray.slope * (surface.vertex - at);
            at = surface.vertex;
            let bent = surface.index_before * ray.slope
                - ray.height * surface.curvature * (surface.index_behind - surface.index_before);
            ray.slope = bent / surface.index_behind;
        }
        ray
    }
}
