//! What both cameras of a pair see.

use nalgebra::{Rotation3, Vector3};
use vergence_vision::{Angle, Frame, KannalaBrandt, Length, Pixel, UnitRay};

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
    frame: &'a SharedFrame,
    left: &'a KannalaBrandt,
    right: &'a KannalaBrandt,
    /// How far off the other camera's axis may be.
    slack: Angle,
}

impl<'a> SharedField<'a> {
    /// For a pose known exactly.
    pub(crate) const fn new(frame: &'a SharedFrame, left: &'a KannalaBrandt, right: &'a KannalaBrandt) -> Self {
        Self { frame, left, right, slack: Angle::from_deg(0.0) }
    }

    /// As far as the uncertain pose of `pair` lets one tell.
    pub(crate) fn of(frame: &'a SharedFrame, pair: &ImagePair<'a>) -> Self {
        let slack = Angle::from_rad((EpipolarBand::SIGMAS * pair.pose_sigma.rad()).min(MOST_SLACK.rad()));
        Self { slack, ..Self::new(frame, pair.left_camera, pair.right_camera) }
    }

    /// Whether the left camera sees a bearing and the right camera may see it too, at infinity or at 1 m.
    pub(crate) fn seen_from_left(&self, bearing: &UnitRay<Shared>) -> bool {
        let (left_from, right_from) =
            (self.frame.shared_from_left().inverse(), self.frame.shared_from_right().inverse());
        seen_at(self.left, &(left_from * *bearing)).is_some()
            && self.parallax_ends(bearing, -1.0).any(|other| self.may_see(self.right, &(right_from * other)))
    }

    /// The same for a bearing of the right camera.
    pub(crate) fn seen_from_right(&self, bearing: &UnitRay<Shared>) -> bool {
        let (left_from, right_from) =
            (self.frame.shared_from_left().inverse(), self.frame.shared_from_right().inverse());
        seen_at(self.right, &(right_from * *bearing)).is_some()
            && self.parallax_ends(bearing, 1.0).any(|other| self.may_see(self.left, &(left_from * other)))
    }

    /// Whether `camera` sees a ray, or would if it were turned by the slack.
    fn may_see<F: Frame>(&self, camera: &KannalaBrandt, ray: &UnitRay<F>) -> bool {
        let towards_axis = || {
            let axis = ray.vector().cross(&Vector3::z()).try_normalize(f64::EPSILON)?;
            UnitRay::new(Rotation3::new(axis * self.slack.rad()) * ray.vector())
        };
        seen_at(camera, ray).is_some()
            || (self.slack.rad() > 0.0 && towards_axis().is_some_and(|ray: UnitRay<F>| seen_at(camera, &ray).is_some()))
    }

    /// The bearings, from a camera displaced by `side` baselines along x, of the point at infinity and the one at 1 m.
    fn parallax_ends(&self, bearing: &UnitRay<Shared>, side: f64) -> impl Iterator<Item = UnitRay<Shared>> {
        let offset = Vector3::x() * (side * self.frame.baseline().mm());
        [Some(*bearing), UnitRay::new(bearing.at(NEAR.mm()).mm() + offset)].into_iter().flatten()
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
            .flat_map(|a| (-b_limit..=b_limit).map(move |b| (a, b)))
            .filter(compared)
            .map(|(a, b)| [a, a, b, b])
            .reduce(|m, n| [m[0].min(n[0]), m[1].max(n[1]), m[2].min(n[2]), m[3].max(n[3])])?;
        let within = |degrees: i32, limit: i32| f64::from(degrees.clamp(-limit, limit)).to_radians();
        Some(Self {
            a_min: within(bounds[0] - 1, a_limit),
            a_max: within(bounds[1] + 1, a_limit),
            b_min: within(bounds[2] - 1, b_limit),
            b_max: within(bounds[3] + 1, b_limit),
        })
    }
}

/// Where the lens shows `ray`, unless that is in the rim or so near the sensor's border that interpolation would read
/// beyond it.
pub(crate) fn seen_at<F: Frame>(camera: &KannalaBrandt, ray: &UnitRay<F>) -> Option<Pixel> {
    camera.project(ray).ok().filter(|pixel| well_inside(camera, ray.vector().z, pixel))
}

/// Whether a pixel, whose unit ray has this z, lies inside the rim, and as far from the border as interpolation reads.
pub(crate) fn well_inside(camera: &KannalaBrandt, z: f64, pixel: &Pixel) -> bool {
    const BORDER: f64 = 1.0;
    let inside = |x: f64, n: u32| x >= BORDER && x < f64::from(n) - 1.0 - BORDER;
    let in_cone = z >= (camera.theta_max() - RIM).rad().cos();
    in_cone && inside(pixel.u, camera.size().width) && inside(pixel.v, camera.size().height)
}
