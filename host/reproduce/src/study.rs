//! How the methods of triangulation compare on the precision bench: with noise, and with matches that slipped along an
//! edge.
//!
//! Two equal equidistant lenses of 560 px/rad stand 145 mm apart, their axes turned outwards. Points are placed around
//! the middle of the rig; its axes have x along the baseline, y down and z forward between the cameras. Everything is
//! seeded.

use nalgebra::{UnitQuaternion, Vector3};

use vergence_vision::{
    Angle, Base, ImageSize, InvalidLens, KannalaBrandt, Kernel, Left, Length, Pixel, PixelPair, Point, Right,
    StereoPair, Transform, UnitRay,
};

/// Of the bench.
pub const BASELINE: Length = Length::from_mm(145.0);
/// The methods in the order of the tables.
pub const METHODS: [Kernel; 6] = [
    Kernel::Midpoint,
    Kernel::PseudoIntersection,
    Kernel::AngularL1,
    Kernel::AngularLinf,
    Kernel::AngularL2,
    Kernel::Reprojection,
];

/// A point before the bench: human mode is a separation of 0°, herbivore of 120°.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Between the optical axes.
    pub separation: Angle,
    /// From the middle of the rig.
    pub range: Length,
    /// To the right.
    pub azimuth: Angle,
    /// Upwards.
    pub elevation: Angle,
}

/// The places of the table on noise.
pub const NOISE_PLACES: [(&str, Place); 5] = [
    ("human, ahead", Place::new(0.0, 0.0, 0.0)),
    ("human, 40° right, 20° up", Place::new(0.0, 40.0, 20.0)),
    ("human, 80° right", Place::new(0.0, 80.0, 0.0)),
    ("herbivore, ahead", Place::new(120.0, 0.0, 0.0)),
    ("herbivore, 25° right", Place::new(120.0, 25.0, 0.0)),
];

/// The places of the table on slipped matches, and how far they slip.
pub const SLIPS: [(&str, Place, Length); 7] = [
    ("human, ahead", Place::new(0.0, 0.0, 0.0), Length::from_mm(5.0)),
    ("herbivore, ahead", Place::new(120.0, 0.0, 0.0), Length::from_mm(5.0)),
    ("human, ahead", Place::new(0.0, 0.0, 0.0), Length::from_mm(20.0)),
    ("herbivore, ahead", Place::new(120.0, 0.0, 0.0), Length::from_mm(20.0)),
    ("human, ahead", Place::new(0.0, 0.0, 0.0), Length::from_mm(50.0)),
    ("herbivore, ahead", Place::new(120.0, 0.0, 0.0), Length::from_mm(50.0)),
    ("herbivore, 25° right", Place::new(120.0, 25.0, 0.0), Length::from_mm(20.0)),
];

impl Place {
    /// 350 mm away, angles in degrees.
    const fn new(separation: f64, azimuth: f64, elevation: f64) -> Self {
        Self {
            separation: Angle::from_deg(separation),
            range: Length::from_mm(350.0),
            azimuth: Angle::from_deg(azimuth),
            elevation: Angle::from_deg(elevation),
        }
    }

    /// In rig axes.
    #[must_use]
    pub fn in_rig(&self) -> Vector3<f64> {
        around(self.range, self.azimuth, self.elevation)
    }
}

/// The bench's lens over 2080 × 2080 pixels: r = 560 (θ + k1 θ³).
///
/// # Errors
/// Where `k1` makes it no lens.
pub fn lens(k1: f64) -> Result<KannalaBrandt, InvalidLens> {
    let size = ImageSize { width: 2080, height: 2080 };
    let k = [560.0, 560.0 * k1, 0.0, 0.0, 0.0];
    KannalaBrandt::new(k, 1.0, Pixel { u: 1039.5, v: 1039.5 }, Angle::from_deg(98.0), size)
}

/// Cameras at the bench's distance with their axes `separation` apart, outward.
#[must_use]
pub fn left_from_right(separation: Angle) -> Transform<Left, Right> {
    let half = separation.rad() / 2.0;
    let turned = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 2.0 * half);
    Transform::new(turned, Vector3::new(BASELINE.mm() * half.cos(), 0.0, -BASELINE.mm() * half.sin()))
}

/// The rig's axes, with their origin in the middle of the rig, seen in the left frame.
#[must_use]
pub fn left_from_middle(separation: Angle) -> Transform<Left, Base> {
    let turned = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), separation.rad() / 2.0);
    Transform::new(turned, turned * Vector3::new(BASELINE.mm() / 2.0, 0.0, 0.0))
}

/// At `range` from the middle of the rig, to the right by an azimuth and upwards by an elevation; rig axes,
/// millimetres.
#[must_use]
pub fn around(range: Length, azimuth: Angle, elevation: Angle) -> Vector3<f64> {
    let (az, el) = (azimuth.rad(), elevation.rad());
    Vector3::new(az.sin() * el.cos(), -el.sin(), az.cos() * el.cos()) * range.mm()
}

/// Where both cameras see a point; `None` outside a field.
#[must_use]
pub fn see(pair: &StereoPair<'_>, point: &Point<Left>) -> Option<PixelPair> {
    let left = pair.left.project_point(point).ok()?;
    let right = pair.right.project_point(&(pair.left_from_right.inverse() * *point)).ok()?;
    Some(PixelPair { left, right })
}

/// RMS error of the distance from the middle of the rig in millimetres, of each of [`METHODS`], over `samples` pairs of
/// pixels with Gaussian noise of `sigma_px` in every coordinate. All methods see the same noise. `None` where a method
/// has no point.
#[must_use]
pub fn with_noise(place: &Place, sigma_px: f64, samples: u32, seed: u64) -> Option<[f64; METHODS.len()]> {
    let lens = lens(0.0).ok()?;
    let pair = StereoPair { left: &lens, right: &lens, left_from_right: left_from_right(place.separation) };
    let left_from_middle = left_from_middle(place.separation);
    let middle_from_left = left_from_middle.inverse();
    let exact = see(&pair, &(left_from_middle * Point::from_mm(place.in_rig())))?;
    let mut gaussian = Gaussian(seed);
    let mut squares = [0.0; METHODS.len()];
    for _ in 0..samples {
        let pixels =
            PixelPair { left: gaussian.noisy(exact.left, sigma_px), right: gaussian.noisy(exact.right, sigma_px) };
        for (kernel, sum) in METHODS.iter().zip(&mut squares) {
            let made = kernel.triangulate(&pixels, &pair).ok()?.point;
            let error = (middle_from_left * made).mm().norm() - place.range.mm();
            *sum += error * error;
        }
    }
    Some(squares.map(|sum| (sum / f64::from(samples.max(1))).sqrt()))
}

/// Error of the depth along z of the rig in millimetres, of each of [`METHODS`] and of [`Kernel::EdgePlane`], where the
/// right match slipped downwards by `slip` along a vertical edge through the point. `None` where a method has no point.
#[must_use]
pub fn with_slip(place: &Place, slip: Length) -> Option<([f64; METHODS.len()], f64)> {
    let lens = lens(0.0).ok()?;
    let pair = StereoPair { left: &lens, right: &lens, left_from_right: left_from_right(place.separation) };
    let left_from_middle = left_from_middle(place.separation);
    let seen = |at: Vector3<f64>| see(&pair, &(left_from_middle * Point::from_mm(at)));
    let down = Vector3::new(0.0, slip.mm(), 0.0);
    let pixels = PixelPair { left: seen(place.in_rig())?.left, right: seen(place.in_rig() + down)?.right };
    let error = |kernel: &Kernel| {
        let made = kernel.triangulate(&pixels, &pair).ok()?.point;
        Some((left_from_middle.inverse() * made).mm().z - place.in_rig().z)
    };
    let edge = left_from_middle * UnitRay::<Base>::new(Vector3::y())?;
    let mut errors = [0.0; METHODS.len()];
    for (kernel, slot) in METHODS.iter().zip(&mut errors) {
        *slot = error(kernel)?;
    }
    Some((errors, error(&Kernel::EdgePlane(edge))?))
}

/// Gaussian numbers from SplitMix64 (Steele, Lea and Flood, 2014) by the Box-Muller method.
#[derive(Clone, Debug)]
pub struct Gaussian(pub u64);

impl Gaussian {
    /// Uniform from 0 to 1.
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 * (0.5f64).powi(53)
    }

    /// Of the standard normal distribution.
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    /// `pixel` with noise of standard deviation `sigma_px` in u and v.
    pub fn noisy(&mut self, pixel: Pixel, sigma_px: f64) -> Pixel {
        Pixel { u: pixel.u + sigma_px * self.normal(), v: pixel.v + sigma_px * self.normal() }
    }
}
