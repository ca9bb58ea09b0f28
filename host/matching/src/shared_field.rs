//! What both cameras of a pair see.

use nalgebra::{Rotation3, Vector3};
use rayon::prelude::*;
use vergence_vision::{Angle, Frame, KannalaBrandt, Left, Length, Pixel, Right, Transform, UnitRay};

use crate::epipolar_band::EpipolarBand;
use crate::view::direction;
use crate::{ImagePair, Shared, SharedFrame};

/// Largest |a|: nearer the baseline than 15° disparity says little about range.
const A_LIMIT: Angle = Angle::from_deg(75.0);
/// Largest |b|: a field of 196° ends there for parallel axes.
const B_LIMIT: Angle = Angle::from_deg(105.0);
/// The outermost ring of the lens, vignetted and least well calibrated.
const RIM: Angle = Angle::from_deg(1.5);
/// Besides infinity, the range at which the other camera must see a direction for it to be compared.
pub(crate) const NEAR: Length = Length::from_mm(1000.0);
/// A field widened for an uncertain pose is widened by no more than this.
const MOST_SLACK: Angle = Angle::from_deg(10.0);

/// Which directions of each view are worth comparing.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SharedField<'a> {
    left: Field<'a, Left>,
    right: Field<'a, Right>,
    baseline: Length,
}

impl<'a> SharedField<'a> {
    /// For a pose known exactly.
    pub(crate) fn new(frame: &SharedFrame, left: &'a KannalaBrandt, right: &'a KannalaBrandt) -> Self {
        Self {
            left: Field::new(left, frame.shared_from_left()),
            right: Field::new(right, frame.shared_from_right()),
            baseline: frame.baseline(),
        }
    }

    /// As far as the uncertain pose of `pair` lets one tell.
    pub(crate) fn of(frame: &SharedFrame, pair: &ImagePair<'a>) -> Self {
        let slack = Angle::from_rad((EpipolarBand::SIGMAS * pair.pose_sigma.rad()).min(MOST_SLACK.rad()));
        let Self { left, right, baseline } = Self::new(frame, pair.left_camera, pair.right_camera);
        Self { left: Field { slack, ..left }, right: Field { slack, ..right }, baseline }
    }

    /// Whether the left camera sees a bearing and the right camera may see it too, at infinity or at 1 m.
    pub(crate) fn seen_from_left(&self, bearing: &UnitRay<Shared>) -> bool {
        self.left.sees(bearing) && self.parallax_ends(bearing, -1.0).any(|other| self.right.may_see(&other))
    }

    /// The same for a bearing of the right camera.
    pub(crate) fn seen_from_right(&self, bearing: &UnitRay<Shared>) -> bool {
        self.right.sees(bearing) && self.parallax_ends(bearing, 1.0).any(|other| self.left.may_see(&other))
    }

    /// The bearings, from a camera displaced by `side` baselines along x, of the point at infinity and the one at 1 m.
    fn parallax_ends(&self, bearing: &UnitRay<Shared>, side: f64) -> impl Iterator<Item = UnitRay<Shared>> {
        let offset = Vector3::x() * (side * self.baseline.mm());
        [Some(*bearing), UnitRay::new(bearing.at(NEAR.mm()).mm() + offset)].into_iter().flatten()
    }
}

/// What one camera sees of the shared directions.
#[derive(Clone, Copy, Debug)]
struct Field<'a, F: Frame> {
    camera: &'a KannalaBrandt,
    from_shared: Transform<F, Shared>,
    inside: Inside,
    /// How far off the camera's axis may be.
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

    /// Whether it sees a bearing, or would if it were turned by the slack.
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

/// Ranges of a and b, in radians.
pub(crate) struct Extent {
    pub a_min: f64,
    pub a_max: f64,
    pub b_min: f64,
    pub b_max: f64,
}

impl Extent {
    /// The bounds of what the cameras share, found on a grid of one degree and widened by that degree.
    pub(crate) fn of(field: &SharedField<'_>) -> Option<Self> {
        let (a_limit, b_limit) = (A_LIMIT.deg() as i32, B_LIMIT.deg() as i32);
        let compared = |&(a, b): &(i32, i32)| {
            let d = direction(f64::from(a).to_radians(), f64::from(b).to_radians());
            UnitRay::new(d).is_some_and(|bearing| field.seen_from_left(&bearing) || field.seen_from_right(&bearing))
        };
        let bounds = (-a_limit..=a_limit)
            .into_par_iter()
            .flat_map_iter(|a| (-b_limit..=b_limit).map(move |b| (a, b)))
            .filter(compared)
            .map(|(a, b)| [a, a, b, b])
            .reduce_with(|m, n| [m[0].min(n[0]), m[1].max(n[1]), m[2].min(n[2]), m[3].max(n[3])])?;
        let within = |degrees: i32, limit: i32| f64::from(degrees.clamp(-limit, limit)).to_radians();
        Some(Self {
            a_min: within(bounds[0] - 1, a_limit),
            a_max: within(bounds[1] + 1, a_limit),
            b_min: within(bounds[2] - 1, b_limit),
            b_max: within(bounds[3] + 1, b_limit),
        })
    }
}

/// What of an image is looked at: not the rim, nor what is so near the sensor's border that interpolation would read beyond it.
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

    /// Whether a pixel is, whose unit ray has this z.
    pub(crate) fn contains(&self, z: f64, pixel: &Pixel) -> bool {
        let within = |x: f64, most: f64| x >= Self::BORDER && x < most;
        z >= self.least_z && within(pixel.u, self.most_u) && within(pixel.v, self.most_v)
    }
}
