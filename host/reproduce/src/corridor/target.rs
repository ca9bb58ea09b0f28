//! The target: found by its colour in one image, and measured from near.

use image::RgbImage;
use nalgebra::Vector3;
use vergence_rig::Rig;
use vergence_scene::CorridorPlan;
use vergence_vision::{Angle, Left, Length, Pixel, Point, Right, Side, World};

use super::Station;

/// Least number of red pixels of a target.
pub const LEAST_PIXELS: usize = 40;
/// Radius in pixels around the densest place within which pixels belong to the target.
const REACH: f64 = 40.0;

/// A target seen in an image.
#[derive(Clone, Debug)]
pub struct Found {
    /// The camera that alone sees it; `None` where both do.
    pub side: Option<Side>,
    /// Its direction from the robot's front link in the horizontal plane, to the right.
    pub azimuth: Angle,
    /// Direction in the corridor, and the place of the camera there.
    ray: [Vector3<f64>; 2],
    true_azimuth: Angle,
}

/// Looks for the target in both images of a station.
pub fn find_target(station: &Station, rig: &Rig) -> Option<Found> {
    let seen = [Side::Left, Side::Right].map(|side| station.target[side.index()].map(|pixel| (side, pixel)));
    let (side, pixel) = seen.into_iter().flatten().next()?;
    let world_from_base = station.place.world_from_base();
    let world_from_left = world_from_base * station.pose.base_from_left;
    let (direction, centre) = match side {
        Side::Left => (world_from_left * rig.left_camera.unproject::<Left>(pixel).ok()?, world_from_left.origin()),
        Side::Right => {
            let world_from_right = world_from_left * station.pose.left_from_right;
            (world_from_right * rig.right_camera.unproject::<Right>(pixel).ok()?, world_from_right.origin())
        }
    };
    let direction = direction.vector();
    let heading = |way: Vector3<f64>| Angle::from_rad(way.x.atan2(way.z) - station.place.yaw.rad());
    Some(Found {
        side: (seen[0].is_none() || seen[1].is_none()).then_some(side),
        azimuth: heading(direction),
        ray: [direction, centre.mm()],
        true_azimuth: heading(truth(station).mm() - centre.mm()),
    })
}

fn truth(station: &Station) -> Point<World> {
    Point::from_mm(Vector3::from(station.plan().target))
}

/// The middle of the densest group of red pixels.
pub fn red_spot(image: &RgbImage) -> Option<Pixel> {
    let is_red = |[red, green, blue]: [u8; 3]| {
        let [red, green, blue] = [red, green, blue].map(f64::from);
        red > 70.0 && red > 2.2 * green && red > 2.2 * blue
    };
    let red: Vec<[f64; 2]> = image
        .enumerate_pixels()
        .filter(|(_, _, pixel)| is_red(pixel.0))
        .map(|(u, v, _)| [f64::from(u), f64::from(v)])
        .collect();
    let near = |[u, v]: [f64; 2]| red.iter().copied().filter(move |at| (at[0] - u).hypot(at[1] - v) < REACH);
    // Every tenth pixel is a candidate for the middle.
    let densest = red.iter().copied().step_by(10).max_by_key(|&at| near(at).count())?;
    let group: Vec<[f64; 2]> = near(densest).collect();
    if group.len() < LEAST_PIXELS {
        return None;
    }
    let mean = |axis: usize| group.iter().map(|at| at[axis]).sum::<f64>() / group.len() as f64;
    Some(Pixel { u: mean(0), v: mean(1) })
}

impl Found {
    /// For people.
    pub fn in_words(&self) -> String {
        let side =
            self.side.map_or_else(|| "both cameras see".to_owned(), |side| format!("the {side} camera alone sees"));
        format!(
            "{side} the red target at {:.1} (error {:.2}): its direction is known, its distance is not",
            self.azimuth,
            self.error()
        )
    }

    /// How far the direction points across the corridor, 0 to 1: the more, the better it tells where the target stands along it.
    pub fn across(&self) -> f64 {
        self.ray[0].x.abs()
    }

    /// Error of the direction.
    pub fn error(&self) -> Angle {
        self.azimuth - self.true_azimuth
    }

    /// Where the direction meets the plane at `distance` to the left or right of the corridor's middle: across and along it.
    pub fn beside_wall(&self, distance: Length) -> [f64; 2] {
        let [direction, from] = self.ray;
        let x = distance.mm().copysign(direction.x);
        let reach = (x - from.x) / direction.x;
        [x, from.z + reach * direction.z]
    }
}

/// The target measured from near.
#[derive(Clone, Copy, Debug)]
pub struct Inspected {
    /// Median range of its points.
    pub range_mm: Option<f64>,
    /// The true median range of the same pixels.
    pub true_range_mm: Option<f64>,
    /// Number of points on it.
    pub points: usize,
}

/// The points of a station that lie on the target.
pub fn inspect(station: &Station, rig: &Rig) -> Inspected {
    let on_target = |pixel: Pixel| {
        let ray = rig.left_camera.unproject::<Left>(pixel).ok().map(|ray| station.world_from_left * ray);
        // The pixels of the target are those whose true ray meets its globe.
        ray.is_some_and(|ray| {
            let to_middle = truth(station).mm() - station.world_from_left.origin().mm();
            let along = to_middle.dot(&ray.vector());
            along > 0.0 && (to_middle.norm_squared() - along * along).sqrt() < 0.9 * CorridorPlan::TARGET_RADIUS
        })
    };
    let points = || station.cloud.points.iter().filter(|found| on_target(found.point.pixels.left));
    let measured = points().map(|found| found.point.point.mm().norm()).collect();
    let truth = points().filter_map(|found| station.true_range(found.point.pixels.left)).map(Length::mm).collect();
    Inspected { range_mm: median(measured), true_range_mm: median(truth), points: points().count() }
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

impl Inspected {
    /// For people.
    pub fn in_words(&self) -> String {
        match (self.range_mm, self.error_mm()) {
            (Some(range), Some(error)) => {
                format!("{} points on the target: median range {range:.1} mm, error {error:+.2} mm", self.points)
            }
            _ => "no point on the target".to_owned(),
        }
    }

    /// Error of the median range in millimetres.
    pub fn error_mm(&self) -> Option<f64> {
        Some(self.range_mm? - self.true_range_mm?)
    }
}
