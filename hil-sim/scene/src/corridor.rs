//! Corridors for a small robot, with parcels along their walls and a target. The usual one is 1.1 m wide, 0.9 m high, 5 m long, its
//! target on the left.
//!
//! The robot starts at the world's origin, its cameras 150 mm above the floor, and looks along z.

use nalgebra::Vector3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::Scene;
use crate::furnish::{Furnisher, Place};
use crate::light::Lamp;
use crate::texture::{Pattern, Rgb};

const HALF_WIDTH: f64 = 550.0;
const CEILING: f64 = -750.0;
const FLOOR: f64 = 150.0;
const BACK: f64 = -1200.0;
const FRONT: f64 = 3800.0;

const PAPER: Rgb = [0.74, 0.70, 0.62];
const CLAY: Rgb = [0.36, 0.24, 0.15];
const TEAL: Rgb = [0.06, 0.28, 0.30];
const OCHRE: Rgb = [0.66, 0.42, 0.10];
const BLUE: Rgb = [0.08, 0.15, 0.40];

/// Parcels of the usual corridor: across, along, turned by degrees, width, height, depth.
const PARCELS: [[f64; 6]; 10] = [
    [-430.0, -520.0, 8.0, 170.0, 210.0, 200.0],
    [420.0, -260.0, -12.0, 190.0, 150.0, 260.0],
    [-440.0, 420.0, 20.0, 150.0, 280.0, 180.0],
    [430.0, 560.0, 4.0, 180.0, 330.0, 220.0],
    [-350.0, 1120.0, 0.0, 400.0, 420.0, 160.0],
    [440.0, 1380.0, 15.0, 160.0, 240.0, 170.0],
    [-420.0, 2250.0, 9.0, 210.0, 300.0, 240.0],
    [410.0, 2050.0, -18.0, 220.0, 180.0, 200.0],
    [360.0, 2900.0, 30.0, 240.0, 380.0, 240.0],
    [-250.0, 3400.0, -10.0, 300.0, 420.0, 260.0],
];

/// Where walls, parcels and the target of a corridor stand, in millimetres.
#[derive(Clone, Debug, PartialEq)]
pub struct CorridorPlan {
    /// Distance of the walls from the middle.
    pub half_width: f64,
    /// Where the corridor ends behind the robot's start, and before it.
    pub ends: [f64; 2],
    /// Centre of the target: a red globe on a stand.
    pub target: [f64; 3],
    /// Parcels: across, along, turned by degrees, width, height, depth.
    pub parcels: Vec<[f64; 6]>,
}

impl Default for CorridorPlan {
    /// The usual corridor: the target stands beside the left wall, behind a parcel as seen from the start.
    fn default() -> Self {
        Self { half_width: HALF_WIDTH, ends: [BACK, FRONT], target: [-400.0, -20.0, 1520.0], parcels: PARCELS.to_vec() }
    }
}

impl CorridorPlan {
    /// Radius of the target in millimetres.
    pub const TARGET_RADIUS: f64 = 70.0;
    /// Distance of the target's middle from the wall beside it.
    pub const TARGET_FROM_WALL: f64 = 150.0;

    /// A corridor 0.9 m to 1.5 m wide and 3.7 m to 6.2 m long, with 6 to 14 parcels, and a target beside either wall, before or behind
    /// the start; in every other one a parcel hides it from one side.
    #[must_use]
    pub fn random(seed: u64) -> Self {
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut between = |low: f64, high: f64| low + (high - low) * random.random::<f64>();
        let half_width = between(450.0, 750.0);
        let ends = [BACK, between(2500.0, 5000.0)];
        let side = between(-1.0, 1.0).signum();
        let along = between(ends[0] + 400.0, ends[1] - 900.0);
        let target = [side * (half_width - Self::TARGET_FROM_WALL), -20.0, along];
        let mut parcels = Vec::new();
        if between(0.0, 1.0) < 0.5 {
            let beside = side * (half_width - 160.0);
            parcels.push([beside, along + between(-1.0, 1.0).signum() * 400.0, 0.0, 320.0, 420.0, 160.0]);
        }
        let count = between(6.0, 15.0) as usize;
        for _ in 0..count {
            let wall = between(-1.0, 1.0).signum();
            let [width, height, depth] = [between(140.0, 220.0), between(150.0, 400.0), between(150.0, 280.0)];
            let place = [wall * (half_width - 130.0), between(ends[0] + 200.0, ends[1] - 300.0)];
            // Nothing stands in the robot's way to the target.
            if (place[1] - along).abs() > 450.0 || wall * side < 0.0 {
                parcels.push([place[0], place[1], between(-20.0, 20.0), width, height, depth]);
            }
        }
        Self { half_width, ends, target, parcels }
    }

    /// Whether a place, across and along, is inside the walls and in no parcel.
    #[must_use]
    pub fn is_free(&self, [x, z]: [f64; 2]) -> bool {
        let in_parcel = |&[across, along, yaw, width, _, depth]: &[f64; 6]| {
            let (sine, cosine) = yaw.to_radians().sin_cos();
            let [dx, dz] = [x - across, z - along];
            let own = [cosine * dx - sine * dz, sine * dx + cosine * dz];
            own[0].abs() < width / 2.0 && own[1].abs() < depth / 2.0
        };
        x.abs() < self.half_width && (self.ends[0]..self.ends[1]).contains(&z) && !self.parcels.iter().any(in_parcel)
    }
}

impl Scene {
    /// The usual corridor. The same in every build: its random parts come from fixed seeds.
    #[must_use]
    pub fn corridor() -> Self {
        Self::of_corridor(&CorridorPlan::default())
    }

    /// The corridor of `plan`.
    #[must_use]
    pub fn of_corridor(plan: &CorridorPlan) -> Self {
        let walls = [
            Pattern::Bricks { light: [0.52, 0.24, 0.15], dark: [0.24, 0.10, 0.06] },
            Pattern::Woven { warp: [0.10, 0.24, 0.30], weft: PAPER, thread: 26.0 },
            Pattern::Mottled { light: PAPER, dark: [0.42, 0.40, 0.34], cell: 180.0 },
            Pattern::Planks { light: [0.56, 0.36, 0.18], dark: [0.24, 0.13, 0.06], width: 90.0, length: 800.0 },
            Pattern::Mottled { light: [0.62, 0.66, 0.60], dark: [0.10, 0.16, 0.16], cell: 120.0 },
            Pattern::Mottled { light: PAPER, dark: TEAL, cell: 160.0 },
        ];
        let [back, front] = plan.ends;
        let corners = [Vector3::new(-plan.half_width, CEILING, back), Vector3::new(plan.half_width, FLOOR, front)];
        let shell = Self::closed(corners[0], corners[1], walls);
        let mut corridor = Furnisher::new(31);
        for (number, &[x, z, yaw, width, height, depth]) in plan.parcels.iter().enumerate() {
            let ground = [CLAY, TEAL, OCHRE, BLUE][number % 4];
            let place = Place::new(x, z, yaw).at(FLOOR);
            corridor.block(place, [width, height, depth], Pattern::Woven { warp: ground, weft: PAPER, thread: 15.0 });
        }
        let [x, y, z] = plan.target;
        let (stand, radius) = (Place::new(x, z, 0.0).at(FLOOR), CorridorPlan::TARGET_RADIUS);
        let red = Pattern::Blots { ground: [0.66, 0.05, 0.04], cell: 34.0 };
        let leg = Pattern::Mottled { light: PAPER, dark: TEAL, cell: 40.0 };
        corridor.can(stand, 30.0, FLOOR - y - radius, leg);
        corridor.ball(stand.raised(FLOOR - y - radius), radius, red);
        shell.with(corridor.solids).lit(|light| {
            light.ambient = [0.42, 0.43, 0.44];
            light.from_above = 0.15;
            light.occlusion = 0.4;
            let lamp = |z: f64| Lamp {
                position: Vector3::new(0.0, CEILING + 60.0, z),
                power: [0.7, 0.68, 0.62],
                half_distance: 1100.0,
            };
            // One every 1.5 m.
            let count = ((front - back) / 1500.0).floor() as u32;
            light.lamps = (0..count).map(|number| lamp(back + 1000.0 + 1500.0 * f64::from(number))).collect();
        })
    }
}
