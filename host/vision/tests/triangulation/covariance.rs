//! The closed-form covariance: computed figures, and sampled errors.

use nalgebra::{Matrix3, Vector3};
use vergence_vision::{Angle, Left, Point, UnitRay, covariance, pseudo_intersection, range_sigma};

use super::{point, towards};

/// On the midline 350 mm ahead of a baseline of 145 mm: σ = 1 mrad makes 1.246, 0.258 and 0.253 mm.
#[test]
fn covariance_on_the_midline() {
    let (p, t) = (point(72.5, 0.0, 350.0), point(145.0, 0.0, 0.0));
    let c = covariance(&p, &t, Angle::from_rad(1e-3)).unwrap();
    for (variance, sigma) in [(c.m33, 1.2460), (c.m11, 0.2581), (c.m22, 0.2527)] {
        assert!((variance.sqrt() - sigma).abs() <= 5.1e-5, "{} {sigma}", variance.sqrt());
    }
    let along = p.direction().unwrap().vector();
    let expected = along.dot(&(c * along)).sqrt();
    assert!((range_sigma(&c, &p).unwrap().mm() - expected).abs() < 1e-12);
}

#[test]
fn covariance_is_refused_where_there_is_none() {
    let (p, t, sigma) = (point(72.5, 0.0, 350.0), point(145.0, 0.0, 0.0), Angle::from_rad(1e-3));
    assert_eq!(covariance(&point(300.0, 0.0, 0.0), &t, sigma), None);
    assert_eq!(covariance(&point(0.0, 0.0, 0.0), &t, sigma), None);
    assert_eq!(covariance(&p, &point(0.0, 0.0, 0.0), sigma), None);
    assert_eq!(covariance(&point(f64::NAN, 0.0, 1.0), &t, sigma), None);
    assert_eq!(covariance(&point(f64::INFINITY, 0.0, 1.0), &t, sigma), None);
    assert_eq!(covariance(&p, &t, Angle::from_rad(f64::NAN)), None);
    assert_eq!(range_sigma(&Matrix3::identity(), &point(0.0, 0.0, 0.0)), None);
}

/// Gaussian numbers from SplitMix64 (Steele, Lea and Flood, 2014) by the Box-Muller method.
struct Gaussian(u64);

impl Gaussian {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * (0.5f64).powi(53)
    }

    fn next(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// `ray` turned by an angle of standard deviation `sigma` in each of its two directions.
    fn disturb(&mut self, ray: &UnitRay<Left>, sigma: f64) -> UnitRay<Left> {
        let noise = Vector3::new(self.next(), self.next(), self.next()) * sigma;
        towards(ray.vector() + noise)
    }
}

/// The normalised estimation error squared has mean 3 and variance 6; its mean over n trials stays within four sigma.
#[test]
fn errors_are_as_large_as_the_covariance_says() {
    const TRIALS: u32 = 20_000;
    const SIGMA: f64 = 1e-4;
    let mut gaussian = Gaussian(20_240_229);
    for (p, t) in [
        ([72.5, 0.0, 350.0], [145.0, 0.0, 0.0]),
        ([225.0, 120.0, 268.0], [145.0, 0.0, 0.0]),
        ([340.0, 30.0, -40.0], [145.0, 3.0, -12.0]),
        ([-120.0, -60.0, 900.0], [140.0, 3.0, -12.0]),
    ] {
        let (p, t) = (Vector3::from(p), Point::from_mm(Vector3::from(t)));
        let (u, v) = (towards(p), towards(p - t.mm()));
        let c = covariance(&Point::from_mm(p), &t, Angle::from_rad(SIGMA)).unwrap();
        let information = c.try_inverse().unwrap();
        let (mut nees, mut range_squared) = (0.0, 0.0);
        for _ in 0..TRIALS {
            let (u, v) = (gaussian.disturb(&u, SIGMA), gaussian.disturb(&v, SIGMA));
            let found = pseudo_intersection(&u, &v, &t).unwrap();
            let error = found.point.mm() - p;
            nees += error.dot(&(information * error)) / f64::from(TRIALS);
            range_squared += (found.left_range.mm() - p.norm()).powi(2) / f64::from(TRIALS);
        }
        let band = 4.0 * (6.0 / f64::from(TRIALS)).sqrt();
        assert!((nees - 3.0).abs() < band, "{p:?}: {nees} is not within {band} of 3");
        let ratio = range_squared.sqrt() / range_sigma(&c, &Point::from_mm(p)).unwrap().mm();
        assert!((ratio - 1.0).abs() < 4.0 / (2.0 * f64::from(TRIALS)).sqrt(), "{p:?}: {ratio}");
    }
}
