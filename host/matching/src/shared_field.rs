//! The field of view that both cameras of a pair share.

use nalgebra::{Rotation3, Vector3};
use rayon::prelude::*;
use vergence_vision::{Angle, Frame, KannalaBrandt, Left, Length, Pixel, Right, Transform, UnitRay};

use crate::epipolar_band::EpipolarBand;
use crate::grid::{Extent, direction};
use crate::{Grid, ImagePair, Shared, SharedFrame};

/// Largest |a|: within 15° of the baseline disparity says little about range.
const A_LIMIT: Angle = Angle::from_deg(75.0);
/// Largest |b|: a field of 196° ends there for parallel axes.
const B_LIMIT: Angle = Angle::from_deg(105.0);
/// Width of the outermost ring of the field, which is vignetted and least well calibrated, and left out.
const RIM: Angle = Angle::from_deg(1.5);
/// A direction is compared if the other camera sees it at infinity or at so many baselines: 1 m for the bench's 145 mm.
const NEAR_BASELINES: f64 = 1000.0 / 145.0;
/// Degrees between the directions of a field that are tried first.
const STRIDE: usize = 5;
/// Largest widening of the field for an uncertain pose.
const MOST_SLACK: Angle = Angle::from_deg(10.0);

/// The range at which a direction is compared besides infinity, for cameras that are `baseline` apart.
pub(crate) fn near(baseline: Length) -> Length {
    Length::from_mm(NEAR_BASELINES * baseline.mm())
}

/// The directions of each view that are compared.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SharedField<'a> {
    left: Field<'a, Left>,
    right: Field<'a, Right>,
    baseline: Length,
}

impl<'a> SharedField<'a> {
    /// The shared field for a pose known exactly.
    pub(crate) fn new(frame: &SharedFrame, left: &'a KannalaBrandt, right: &'a KannalaBrandt) -> Self {
        Self {
            left: Field::new(left, frame.shared_from_left()),
            right: Field::new(right, frame.shared_from_right()),
            baseline: frame.baseline(),
        }
    }

    /// The shared field of `pair`, widened for the uncertainty of its pose.
    pub(crate) fn of(frame: &SharedFrame, pair: &ImagePair<'a>) -> Self {
        let slack = Angle::from_rad((EpipolarBand::SIGMAS * pair.pose_sigma.rad()).min(MOST_SLACK.rad()));
        let Self { left, right, baseline } = Self::new(frame, pair.left_camera, pair.right_camera);
        Self { left: Field { slack, ..left }, right: Field { slack, ..right }, baseline }
    }

    /// Whether the left camera sees a bearing and the right camera may see it at infinity or near.
    pub(crate) fn seen_from_left(&self, bearing: &UnitRay<Shared>) -> bool {
        self.left.sees(bearing) && self.parallax_ends(bearing, -1.0).any(|other| self.right.may_see(&other))
    }

    /// Whether the right camera sees a bearing and the left camera may see it at infinity or near.
    pub(crate) fn seen_from_right(&self, bearing: &UnitRay<Shared>) -> bool {
        self.right.sees(bearing) && self.parallax_ends(bearing, 1.0).any(|other| self.left.may_see(&other))
    }

    /// Finds the bounds of the field to one degree, and widens them by one degree.
    ///
    /// It tries some directions first, and then those beyond the bounds found so far, line by line: each takes time.
    pub(crate) fn extent(&self) -> Option<Extent> {
        let [a_limit, b_limit] = [A_LIMIT, B_LIMIT].map(|limit| limit.deg() as i32);
        let is_compared = |a: i32, b: i32| {
            let d = direction(f64::from(a).to_radians(), f64::from(b).to_radians());
            UnitRay::new(d).is_some_and(|bearing| self.seen_from_left(&bearing) || self.seen_from_right(&bearing))
        };
        let among = |stride: usize| {
            let all = move |limit: i32| (-limit..=limit).step_by(stride);
            let found: Vec<_> = all(a_limit).flat_map(|a| all(b_limit).map(move |b| [a, b])).collect();
            let found = found.into_par_iter().filter(|[a, b]| is_compared(*a, *b)).map(|[a, b]| [a, a, b, b]);
            found.reduce_with(|m, n| [m[0].min(n[0]), m[1].max(n[1]), m[2].min(n[2]), m[3].max(n[3])])
        };
        let mut bounds = among(STRIDE).or_else(|| among(1))?;
        let shows_a = |a: i32| (-b_limit..=b_limit).any(|b| is_compared(a, b));
        let shows_b = |b: i32| (-a_limit..=a_limit).any(|a| is_compared(a, b));
        for (i, bound) in bounds.iter_mut().enumerate() {
            let beyond = if i % 2 == 0 { -1 } else { 1 };
            let (limit, shows): (i32, &dyn Fn(i32) -> bool) =
                if i < 2 { (a_limit, &shows_a) } else { (b_limit, &shows_b) };
            while (*bound + beyond).abs() <= limit && shows(*bound + beyond) {
                *bound += beyond;
            }
        }
        let within = |degrees: i32, limit: i32| f64::from(degrees.clamp(-limit, limit)).to_radians();
        Some(Extent {
            a_min: within(bounds[0] - 1, a_limit),
            a_max: within(bounds[1] + 1, a_limit),
            b_min: within(bounds[2] - 1, b_limit),
            b_max: within(bounds[3] + 1, b_limit),
        })
    }

    /// The bearings of the points at infinity and near, from a camera displaced by `side` baselines along x.
    fn parallax_ends(&self, bearing: &UnitRay<Shared>, side: f64) -> impl Iterator<Item = UnitRay<Shared>> {
        let offset = Vector3::x() * (side * self.baseline.mm());
        [Some(*bearing), UnitRay::new(bearing.at(near(self.baseline).mm()).mm() + offset)].into_iter().flatten()
    }
}

impl Grid {
    /// Makes the grid over the field that both cameras share (at infinity or 6.9 baselines), within ±75° of a and ±105° of b.
    ///
    /// Its density is that of the denser lens at its axis times `oversampling`, or less where a side would exceed 4096
    /// pixels. `None` where the fields do not overlap or `oversampling` is not positive.
    #[must_use]
    pub fn covering(
        frame: &SharedFrame,
        left: &KannalaBrandt,
        right: &KannalaBrandt,
        oversampling: f64,
    ) -> Option<Self> {
        let field = SharedField::new(frame, left, right);
        Self::over(&field.extent()?, left.k()[0].max(right.k()[0]) * oversampling)
    }
}

/// The field of view of one camera in the shared axes.
#[derive(Clone, Copy, Debug)]
struct Field<'a, F: Frame> {
    camera: &'a KannalaBrandt,
    from_shared: Transform<F, Shared>,
    inside: Inside,
    /// Possible error of the direction of the camera's axis.
    slack: Angle,
}

impl<'a, F: Frame> Field<'a, F> {
    fn new(camera: &'a KannalaBrandt, shared_from_camera: Transform<Shared, F>) -> Self {
        let from_shared = shared_from_camera.inverse();
        Self { camera, from_shared, inside: Inside::of(camera), slack: Angle::from_deg(0.0) }
    }

    fn sees(&self, bearing: &UnitRay<Shared>) -> bool {
        self.shows(&(self.from_shared * *bearing))
    }

    /// Whether the camera sees a bearing, or would see it when turned by the slack.
    fn may_see(&self, bearing: &UnitRay<Shared>) -> bool {
        let ray = self.from_shared * *bearing;
        let towards_axis = || {
            let axis = ray.vector().cross(&Vector3::z()).try_normalize(f64::EPSILON)?;
            UnitRay::new(Rotation3::new(axis * self.slack.rad()) * ray.vector())
        };
        self.shows(&ray) || (self.slack.rad() > 0.0 && towards_axis().is_some_and(|ray| self.shows(&ray)))
    }

    fn shows(&self, ray: &UnitRay<F>) -> bool {
        self.camera.project(ray).is_ok_and(|pixel| self.inside.contains(ray.vector().z, &pixel))
    }
}

/// The part of an image that is used: without the rim of the field, and without the sensor's border, where
/// interpolation would read beyond it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Inside {
    least_z: f64,
    most_u: f64,
    most_v: f64,
}

impl Inside {
    const BORDER: f64 = 1.0;

    pub(crate) fn of(camera: &KannalaBrandt) -> Self {
        let most = |count: u32| f64::from(count) - 1.0 - Self::BORDER;
        let size = camera.size();
        Self { least_z: (camera.theta_max() - RIM).rad().cos(), most_u: most(size.width), most_v: most(size.height) }
    }

    /// Whether `pixel`, whose unit ray has this `z`, is in the part that is used.
    #[inline(always)]
    pub(crate) fn contains(&self, z: f64, pixel: &Pixel) -> bool {
        let within = |x: f64, most: f64| (x >= Self::BORDER) & (x < most);
        (z >= self.least_z) & within(pixel.u, self.most_u) & within(pixel.v, self.most_v)
    }
}
