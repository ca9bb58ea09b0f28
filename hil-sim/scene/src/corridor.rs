//! A corridor for a small robot: 1.1 m wide, 0.9 m high, 5 m long, with parcels along its walls and a target on the left.
//!
//! The robot starts at the world's origin, its cameras 150 mm above the floor, and looks along z.

use nalgebra::Vector3;

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

/// Parcels: across, along, turned by degrees, width, height, depth.
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

impl Scene {
    /// Centre of the target in the corridor, in millimetres: a red globe on a stand beside the left wall,
    /// behind a parcel as seen from the start.
    pub const CORRIDOR_TARGET: [f64; 3] = [-400.0, -20.0, 1520.0];
    /// Radius of the target in millimetres.
    pub const CORRIDOR_TARGET_RADIUS: f64 = 70.0;
    /// Distance of the corridor's walls from its middle, in millimetres.
    pub const CORRIDOR_HALF_WIDTH: f64 = HALF_WIDTH;

    /// The corridor. The same in every build: its random parts come from fixed seeds.
    #[must_use]
    pub fn corridor() -> Self {
        let walls = [
            Pattern::Bricks { light: [0.52, 0.24, 0.15], dark: [0.24, 0.10, 0.06] },
            Pattern::Woven { warp: [0.10, 0.24, 0.30], weft: PAPER, thread: 26.0 },
            Pattern::Mottled { light: PAPER, dark: [0.42, 0.40, 0.34], cell: 180.0 },
            Pattern::Planks { light: [0.56, 0.36, 0.18], dark: [0.24, 0.13, 0.06], width: 90.0, length: 800.0 },
            Pattern::Mottled { light: [0.62, 0.66, 0.60], dark: [0.10, 0.16, 0.16], cell: 120.0 },
            Pattern::Mottled { light: PAPER, dark: TEAL, cell: 160.0 },
        ];
        let corners = [Vector3::new(-HALF_WIDTH, CEILING, BACK), Vector3::new(HALF_WIDTH, FLOOR, FRONT)];
        let shell = Self::closed(corners[0], corners[1], walls);
        let mut corridor = Furnisher::new(31);
        for (number, [x, z, yaw, width, height, depth]) in PARCELS.into_iter().enumerate() {
            let ground = [CLAY, TEAL, OCHRE, BLUE][number % 4];
            let place = Place::new(x, z, yaw).at(FLOOR);
            corridor.block(place, [width, height, depth], Pattern::Woven { warp: ground, weft: PAPER, thread: 15.0 });
        }
        let [x, y, z] = Self::CORRIDOR_TARGET;
        let stand = Place::new(x, z, 0.0).at(FLOOR);
        let red = Pattern::Blots { ground: [0.66, 0.05, 0.04], cell: 34.0 };
        corridor.can(
            stand,
            30.0,
            FLOOR - y - Self::CORRIDOR_TARGET_RADIUS,
            Pattern::Mottled { light: PAPER, dark: TEAL, cell: 40.0 },
        );
        corridor.ball(stand.raised(FLOOR - y - Self::CORRIDOR_TARGET_RADIUS), Self::CORRIDOR_TARGET_RADIUS, red);
        shell.with(corridor.solids).lit(|light| {
            light.ambient = [0.42, 0.43, 0.44];
            light.from_above = 0.15;
            light.occlusion = 0.4;
            let lamp = |z: f64| Lamp {
                position: Vector3::new(0.0, CEILING + 60.0, z),
                power: [0.7, 0.68, 0.62],
                half_distance: 1100.0,
            };
            light.lamps = vec![lamp(-200.0), lamp(1300.0), lamp(2800.0)];
        })
    }
}
