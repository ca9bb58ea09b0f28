//! One surface of a lens: where a ray meets it, and how it goes on behind it.

use nalgebra::Vector3;

/// A ray of light: a point on it, and its direction, a unit vector. Millimetres in the coordinates of the design.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// A point on the ray.
    pub at: Vector3<f64>,
    /// The direction in which light travels.
    pub along: Vector3<f64>,
}

/// A rotationally symmetric surface: a plane, a sphere, or a conic with even powers of the distance from the axis.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Place of the vertex on the axis.
    pub vertex: f64,
    /// 1 / radius, 0 of a plane; positive where the centre lies on the side of the image.
    pub curvature: f64,
    /// Conic constant K; 0 of a sphere.
    pub conic: f64,
    /// Coefficients of r⁴, r⁶, ... that are added to the conic.
    pub powers: Vec<f64>,
    /// Refractive index in front of the surface.
    pub index_before: f64,
    /// Refractive index behind it.
    pub index_behind: f64,
    /// Largest distance from the axis that is polished, or open in a stop.
    pub rim: f64,
}

/// Steps of Newton's method on an aspheric surface. Some four are needed.
const NEWTON_STEPS: usize = 20;

/// A point on an aspheric surface is this close to it, in millimetres.
const ON_SURFACE: f64 = 1e-13;

impl Surface {
    /// Where `ray` meets the surface; `None` where it misses.
    pub fn meet(&self, ray: &Ray) -> Option<Vector3<f64>> {
        let base = self.meet_sphere(ray)?;
        if self.is_sphere() { Some(base) } else { self.meet_asphere(ray, base) }
    }

    fn is_sphere(&self) -> bool {
        self.conic == 0.0 && self.powers.is_empty()
    }

    /// Of the two intersections with the sphere, the one on the side of the vertex: there the ray crosses the surface against the
    /// direction to the centre where the radius is positive. This also holds for rays from behind the first surface, past 90 degrees.
    fn meet_sphere(&self, ray: &Ray) -> Option<Vector3<f64>> {
        let from_vertex = ray.at - Vector3::z() * self.vertex;
        // c |p + t d|² - 2 z = 0 in coordinates of the vertex; the root that stays finite as c goes to 0.
        let c = self.curvature;
        let b = ray.along.z - c * from_vertex.dot(&ray.along);
        let q = c * from_vertex.norm_squared() - 2.0 * from_vertex.z;
        let root = (b * b - c * q).sqrt();
        let t = if b >= 0.0 { q / (b + root) } else { (b - root) / c };
        let at = ray.at + ray.along * t;
        at.iter().all(|x| x.is_finite()).then_some(at)
    }

    fn meet_asphere(&self, ray: &Ray, base: Vector3<f64>) -> Option<Vector3<f64>> {
        let mut at = base;
        for _ in 0..NEWTON_STEPS {
            let (sag, slope) = self.sag(at.x.hypot(at.y))?;
            let off = at.z - self.vertex - sag;
            let radial = if slope == 0.0 { 0.0 } else { (at.x * ray.along.x + at.y * ray.along.y) / at.x.hypot(at.y) };
            let step = off / (ray.along.z - slope * radial);
            if off.abs() < ON_SURFACE {
                return Some(at);
            }
            at -= ray.along * step;
        }
        None
    }

    /// Depth of the surface at `r` from the axis, and its derivative; `None` outside of the conic.
    fn sag(&self, r: f64) -> Option<(f64, f64)> {
        let (c, r2) = (self.curvature, r * r);
        let under = 1.0 - (1.0 + self.conic) * c * c * r2;
        if under <= 0.0 {
            return None;
        }
        let root = under.sqrt();
        let mut sag = c * r2 / (1.0 + root);
        let mut slope = c * r / root;
        let (mut power, mut order) = (r2 * r, 4.0);
        for a in &self.powers {
            sag += a * power * r;
            slope += order * a * power;
            (power, order) = (power * r2, order + 2.0);
        }
        Some((sag, slope))
    }

    /// The unit normal at a point of the surface, towards the image on the axis.
    fn normal(&self, at: &Vector3<f64>) -> Vector3<f64> {
        let r = at.x.hypot(at.y);
        if self.is_sphere() {
            // Exact past the equator of the sphere too, where the depth is no function of the distance from the axis.
            let from_vertex = at - Vector3::z() * self.vertex;
            return Vector3::z() - from_vertex * self.curvature;
        }
        match self.sag(r) {
            Some((_, slope)) if r > 0.0 => Vector3::new(-slope * at.x / r, -slope * at.y / r, 1.0).normalize(),
            _ => Vector3::z(),
        }
    }

    /// The direction behind the surface of a ray that comes `along` to the point `at`, by Snell's law; `None` where it is reflected
    /// totally.
    pub fn refract(&self, at: &Vector3<f64>, along: &Vector3<f64>) -> Option<Vector3<f64>> {
        let towards_image = self.normal(at);
        // Against the ray, so that the cosine is positive.
        let normal = if towards_image.dot(along) > 0.0 { -towards_image } else { towards_image };
        let ratio = self.index_before / self.index_behind;
        let cosine = -normal.dot(along);
        let under = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
        (under >= 0.0).then(|| along * ratio + normal * (ratio * cosine - under.sqrt()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn surface(radius: f64, powers: &[f64]) -> Surface {
        Surface {
            vertex: 3.0,
            curvature: 1.0 / radius,
            conic: if powers.is_empty() { 0.0 } else { -0.4 },
            powers: powers.to_vec(),
            index_before: 1.0,
            index_behind: 1.6,
            rim: f64::INFINITY,
        }
    }

    proptest! {
        #[test]
        fn a_ray_meets_the_sphere_and_keeps_snells_invariant(
            radius in prop_oneof![5.0..200.0, -200.0..-5.0], x in -2.0..2.0, y in -2.0..2.0, tilt in -0.5..0.5, turn in 0.0..6.2,
        ) {
            let along = Vector3::new(f64::sin(tilt) * f64::cos(turn), f64::sin(tilt) * f64::sin(turn), f64::cos(tilt));
            let ray = Ray { at: Vector3::new(x, y, -7.0) , along };
            let surface = surface(radius, &[]);
            if let Some(at) = surface.meet(&ray) {
                let centre = Vector3::new(0.0, 0.0, 3.0 + radius);
                prop_assert!(((at - centre).norm() - radius.abs()).abs() < 1e-10);
                prop_assert!((at.z - 3.0).abs() <= radius.abs(), "on the side of the vertex");
                let normal = (at - centre) / radius;
                let behind = surface.refract(&at, &along).unwrap();
                prop_assert!((behind.norm() - 1.0).abs() < 1e-12);
                prop_assert!((normal.cross(&along) - normal.cross(&behind) * 1.6).norm() < 1e-12, "n sin i is kept");
            }
        }

        #[test]
        fn a_ray_meets_the_asphere(x in -4.0..4.0, y in -4.0..4.0, tilt in -0.4..0.4) {
            let along = Vector3::new(f64::sin(tilt), 0.0, f64::cos(tilt));
            let surface = surface(40.0, &[-1e-5, 3e-8]);
            let at = surface.meet(&Ray { at: Vector3::new(x, y, -7.0), along }).unwrap();
            let (sag, slope) = surface.sag(at.x.hypot(at.y)).unwrap();
            prop_assert!((at.z - 3.0 - sag).abs() < 1e-12);
            let step = 1e-5;
            let around = [at.x.hypot(at.y) + step, at.x.hypot(at.y) - step].map(|r| surface.sag(r).unwrap().0);
            prop_assert!(((around[0] - around[1]) / (2.0 * step) - slope).abs() < 1e-8);
        }
    }

    #[test]
    fn a_ray_past_ninety_degrees_meets_the_front() {
        // A sphere of 10 mm bulges towards the scene; the ray comes from the side and from slightly behind.
        let surface = Surface { vertex: 0.0, ..surface(10.0, &[]) };
        let along = Vector3::new(-(100_f64.to_radians().sin()), 0.0, 100_f64.to_radians().cos());
        let ray = Ray { at: Vector3::new(0.0, 0.0, 5.0) - along * 50.0, along };
        let at = surface.meet(&ray).unwrap();
        assert!(at.x > 0.0 && (at - Vector3::z() * 10.0).norm() - 10.0 < 1e-12, "{at}");
        assert!(surface.refract(&at, &along).unwrap().z > along.z, "it is bent into the lens");
    }

    #[test]
    fn light_is_reflected_totally_beyond_the_critical_angle() {
        let glass_to_air = Surface { index_before: 1.6, index_behind: 1.0, ..surface(f64::INFINITY, &[]) };
        let direction = |deg: f64| Vector3::new(deg.to_radians().sin(), 0.0, deg.to_radians().cos());
        let critical = (1.0_f64 / 1.6).asin().to_degrees();
        assert!(glass_to_air.refract(&Vector3::zeros(), &direction(critical - 0.01)).is_some());
        assert!(glass_to_air.refract(&Vector3::zeros(), &direction(critical + 0.01)).is_none());
    }
}
