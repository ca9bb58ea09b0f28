//! Whether the matches of a live cloud are right, by the room in which the cameras are simulated.

#![allow(dead_code, reason = "each test file uses its own part")]

use std::sync::Arc;

use serde_json::Value;
use vergence_rig::{Rig, RigPose};
use vergence_sim::{Room, RoomCamera};
use vergence_vision::{Left, Length, Pixel, Side};

/// Largest distance of a right match from the truth, in pixels.
const RIGHT_PX: f64 = 2.5;
/// At the edge of an object a keypoint belongs to the object or to its background: the truth is the nearest surface at this distance around the
/// keypoint, in pixels.
const AROUND_PX: f64 = 0.8;
/// Bytes of a point's place and colour, and of its details: see `cloud_message` of the panel.
const PLACE: usize = 16;
const DETAILS: usize = 13 * 4;

/// The simulated bench with ideal lenses.
pub struct Judge {
    rig: Rig,
    left: RoomCamera,
}

impl Judge {
    /// Of the cameras of `rig`.
    pub fn new(rig: Rig) -> Self {
        let left = RoomCamera { side: Side::Left, lens: rig.left_camera, room: Arc::new(Room::with_rig()), seed: 1 };
        Self { rig, left }
    }

    /// How many matches of a cloud that the panel sends are wrong, how many would be if each had the partner of the next, and how many there are.
    pub fn wrong(&self, header: &Value, payload: &[u8]) -> [u64; 3] {
        let axes = header["axes"].as_array().expect("axes");
        let count = header["count"].as_u64().expect("a count");
        let details = payload[PLACE * count as usize..].chunks(DETAILS);
        let pixels: Vec<[Pixel; 2]> = details
            .map(|detail| {
                let number = |at: usize| {
                    f64::from(f32::from_le_bytes(detail[4 * at..4 * at + 4].try_into().expect("four bytes")))
                };
                [Pixel { u: number(6), v: number(7) }, Pixel { u: number(8), v: number(9) }]
            })
            .collect();
        self.wrong_of([0, 1].map(|axis: usize| axes[axis].as_f64().expect("a position")), &pixels)
    }

    /// The same of a line of `vergence run --json` with `--also json`.
    pub fn wrong_in_line(&self, line: &Value) -> [u64; 3] {
        let number = |value: &Value| value.as_f64().expect("a number");
        let rows = line["cloud"]["rows"].as_array().expect("rows").iter();
        let pixel = |row: &Value, at: usize| Pixel { u: number(&row[at]), v: number(&row[at + 1]) };
        let pixels: Vec<[Pixel; 2]> = rows.map(|row| [pixel(row, 6), pixel(row, 8)]).collect();
        self.wrong_of(["baseline_mm", "separation_deg"].map(|axis| number(&line["axes"][axis])), &pixels)
    }

    /// Of the baseline in mm and the separation in degrees: the encoders tell the pose to a fraction of a pixel.
    fn wrong_of(&self, [baseline, separation]: [f64; 2], pixels: &[[Pixel; 2]]) -> [u64; 3] {
        let pose = self.rig.pose_at_values(&[baseline, separation.to_radians()]);
        let wrong = pixels.iter().filter(|pair| !self.is_right(&pose, **pair)).count() as u64;
        let others = pixels.iter().cycle().skip(1);
        let swapped = pixels.iter().zip(others).filter(|(one, other)| !self.is_right(&pose, [one[0], other[1]]));
        [wrong, swapped.count() as u64, pixels.len() as u64]
    }

    /// Whether both pixels show the same place.
    fn is_right(&self, pose: &RigPose, [left, right]: [Pixel; 2]) -> bool {
        let shown = |range: Length| {
            let ray = self.rig.left_camera.unproject::<Left>(left).ok()?;
            self.rig.right_camera.project_point(&(pose.left_from_right.inverse() * ray.at(range.mm()))).ok()
        };
        [(0.0, 0.0), (AROUND_PX, 0.0), (-AROUND_PX, 0.0), (0.0, AROUND_PX), (0.0, -AROUND_PX)].into_iter().any(
            |(du, dv)| {
                let shown = self.left.true_range(pose, Pixel { u: left.u + du, v: left.v + dv }).and_then(shown);
                shown.is_some_and(|shown| (shown.u - right.u).hypot(shown.v - right.v) <= RIGHT_PX)
            },
        )
    }
}
