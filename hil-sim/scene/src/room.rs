//! A furnished living room, 4 m wide, 5 m long and 2.6 m high, with the rig in its middle 1.2 m above the floor.
//!
//! Much of it stands within half a metre to one and a half of the world's origin, on all sides and at all heights, so
//! that every vision mode sees near objects in its stereo zone. The half metre about the origin is free.

use std::f64::consts::FRAC_PI_2;

use nalgebra::Vector3;

use crate::Scene;
use crate::furnish::{Furnisher, Place};
use crate::light::Lamp;
use crate::texture::{Pattern, Rgb};

const LEFT: f64 = -2000.0;
const RIGHT: f64 = 2000.0;
const CEILING: f64 = -1400.0;
const FLOOR: f64 = 1200.0;
const BACK: f64 = -2500.0;
const FRONT: f64 = 2500.0;

const CREAM: Rgb = [0.72, 0.64, 0.50];
const SAND: Rgb = [0.46, 0.36, 0.24];
const WHITE: Rgb = [0.80, 0.78, 0.73];
const GREY: Rgb = [0.30, 0.30, 0.31];
const INK: Rgb = [0.05, 0.05, 0.07];
const RED: Rgb = [0.50, 0.07, 0.05];
const TERRACOTTA: Rgb = [0.52, 0.20, 0.10];
const OCHRE: Rgb = [0.66, 0.42, 0.10];
const TEAL: Rgb = [0.06, 0.27, 0.30];
const PALE_TEAL: Rgb = [0.34, 0.52, 0.52];
const BLUE: Rgb = [0.07, 0.14, 0.38];
const PALE_BLUE: Rgb = [0.42, 0.52, 0.68];
const MOSS: Rgb = [0.14, 0.24, 0.08];
const PLUM: Rgb = [0.28, 0.09, 0.18];

const OAK: Pattern = wood([0.58, 0.36, 0.17], [0.24, 0.12, 0.05], 0);
const WALNUT: Pattern = wood([0.30, 0.16, 0.08], [0.08, 0.04, 0.02], 0);
const PINE_POST: Pattern = wood([0.70, 0.48, 0.24], [0.40, 0.22, 0.09], 1);
const BRASS: Pattern = mottled([0.62, 0.44, 0.16], [0.26, 0.16, 0.05], 40.0);
const CARDBOARD: Pattern = mottled([0.52, 0.37, 0.21], [0.30, 0.19, 0.09], 90.0);
const CLAY: Pattern = mottled(TERRACOTTA, [0.26, 0.09, 0.05], 60.0);
const MARBLE: Pattern = mottled(WHITE, [0.22, 0.24, 0.28], 110.0);

const fn wood(light: Rgb, dark: Rgb, axis: usize) -> Pattern {
    Pattern::Wood { light, dark, axis }
}

const fn mottled(light: Rgb, dark: Rgb, cell: f64) -> Pattern {
    Pattern::Mottled { light, dark, cell }
}

const fn woven(warp: Rgb, weft: Rgb) -> Pattern {
    Pattern::Woven { warp, weft, thread: 14.0 }
}

const fn blots(ground: Rgb, cell: f64) -> Pattern {
    Pattern::Blots { ground, cell }
}

impl Scene {
    /// The furnished room. The same in every build: its random parts come from fixed seeds.
    #[must_use]
    pub fn room() -> Self {
        let walls = [
            Pattern::Bricks { light: [0.50, 0.22, 0.13], dark: [0.22, 0.08, 0.05] },
            mottled(CREAM, SAND, 260.0),
            mottled(WHITE, [0.52, 0.49, 0.43], 180.0),
            Pattern::Planks { light: [0.54, 0.33, 0.16], dark: [0.22, 0.11, 0.05], width: 130.0, length: 1100.0 },
            mottled(PALE_TEAL, [0.14, 0.30, 0.32], 240.0),
            mottled([0.66, 0.60, 0.44], [0.36, 0.34, 0.22], 200.0),
        ];
        let shell = Self::closed(Vector3::new(LEFT, CEILING, BACK), Vector3::new(RIGHT, FLOOR, FRONT), walls);
        let mut room = Furnisher::new(20);
        front_table(&mut room);
        front_near(&mut room);
        front_wall(&mut room);
        left_side(&mut room);
        right_side(&mut room);
        behind(&mut room);
        overhead(&mut room);
        shell.with(room.solids).lit(|light| {
            light.ambient = [0.43, 0.45, 0.48];
            light.from_above = 0.18;
            light.occlusion = 0.45;
            let pendant = Vector3::new(0.0, -930.0, 300.0);
            let window = Vector3::new(1850.0, -350.0, 250.0);
            light.lamps = vec![
                Lamp { position: pendant, power: [1.05, 0.95, 0.80], half_distance: 1700.0 },
                Lamp { position: window, power: [0.80, 0.90, 1.05], half_distance: 1500.0 },
            ];
        })
    }
}

fn front_table(room: &mut Furnisher) {
    let table = Place::new(60.0, 1080.0, -7.0);
    let top = room.table(table, [1350.0, 720.0, 700.0], OAK);
    room.globe(table.on(top, -330.0, 60.0), 125.0, blots(PALE_BLUE, 90.0));
    room.books_lying(table.on(top, 40.0, -170.0), 6);
    room.can(table.on(top, 260.0, -190.0), 42.0, 98.0, blots(WHITE, 40.0));
    room.vase(table.on(top, 130.0, 140.0), 62.0, 210.0, mottled(TEAL, PALE_BLUE, 50.0));
    room.leaves(table.on(top - 190.0, 130.0, 140.0), 14, 190.0);
    room.ball(table.on(top, -120.0, -210.0), 58.0, blots(OCHRE, 55.0));
    room.ball(table.on(top, 430.0, -60.0), 78.0, blots(RED, 70.0));
    room.block(table.on(top, 480.0, 190.0).turned(25.0), [190.0, 240.0, 150.0], blots(CREAM, 95.0));
    room.table_lamp(table.on(top, -540.0, 150.0), woven(CREAM, OCHRE));
    room.block(table.on(top, -500.0, -190.0).turned(14.0), [210.0, 60.0, 150.0], wood(RED, PLUM, 0));
    room.flat_on(table.on(top, 250.0, 40.0), [420.0, 300.0], 12.0, woven(BLUE, WHITE));
}

fn front_near(room: &mut Furnisher) {
    room.rug(
        Place::new(0.0, 500.0, 4.0).at(FLOOR),
        [1900.0, 1500.0],
        Pattern::Woven { warp: RED, weft: CREAM, thread: 20.0 },
    );
    // A sheet of music on its stand.
    let stand = Place::new(-470.0, 640.0, -30.0).at(FLOOR);
    room.can(stand, 14.0, 1010.0, BRASS);
    room.can(stand, 130.0, 16.0, BRASS);
    room.tilted_sheet(stand.raised(1150.0), [340.0, 290.0], -14.0, blots(WHITE, 75.0));
    room.plant(Place::new(600.0, 690.0, 0.0).at(FLOOR), 150.0, 640.0, 48);
    // Things hung from the ceiling by threads.
    for (x, y, z, radius, pattern) in [
        (-130.0, 130.0, 700.0, 52.0, blots(TEAL, 60.0)),
        (110.0, -150.0, 780.0, 64.0, blots(CREAM, 66.0)),
        (330.0, 60.0, 720.0, 45.0, mottled(OCHRE, PLUM, 36.0)),
        (-330.0, -240.0, 860.0, 70.0, woven(PLUM, CREAM)),
        (-700.0, -120.0, 960.0, 80.0, blots(BLUE, 80.0)),
        (20.0, -420.0, 900.0, 58.0, MARBLE),
    ] {
        room.hung_ball([x, y, z], radius, CEILING, pattern);
    }
    let stool = Place::new(-260.0, 760.0, 0.0).at(FLOOR);
    let seat = room.stool(stool, 150.0, 520.0, WALNUT);
    room.books_lying(stool.raised(seat).turned(40.0), 4);
    room.ball(stool.raised(seat + 130.0), 60.0, blots(MOSS, 50.0));
    room.block(Place::new(420.0, 520.0, 33.0).at(FLOOR), [280.0, 260.0, 280.0], CARDBOARD);
    room.block(Place::new(410.0, 530.0, 12.0).at(FLOOR - 260.0), [200.0, 180.0, 210.0], blots(SAND, 90.0));
    room.ball(Place::new(130.0, 480.0, 0.0).at(FLOOR), 115.0, blots(WHITE, 100.0));
}

fn front_wall(room: &mut Furnisher) {
    room.bookcase(Place::new(-1150.0, 2310.0, 0.0).at(FLOOR), [1100.0, 2050.0, 320.0], WALNUT);
    let cabinet = Place::new(900.0, 2240.0, 0.0).at(FLOOR);
    room.cabinet(cabinet, [1300.0, 860.0, 420.0], OAK);
    room.globe(cabinet.shifted(-450.0, 0.0).raised(860.0), 140.0, blots(CREAM, 110.0));
    room.vase(cabinet.shifted(-80.0, 20.0).raised(860.0), 80.0, 300.0, CLAY);
    room.leaves(cabinet.shifted(-80.0, 20.0).raised(1120.0), 16, 240.0);
    room.block(cabinet.shifted(330.0, 30.0).raised(860.0).turned(-12.0), [330.0, 250.0, 190.0], blots(TEAL, 120.0));
    room.ball(cabinet.shifted(540.0, -40.0).raised(860.0), 90.0, woven(OCHRE, INK));
    room.picture(Place::new(120.0, 2490.0, 0.0).at(-150.0), [820.0, 620.0], blots(CREAM, 210.0));
    room.picture(Place::new(1000.0, 2490.0, 0.0).at(-280.0), [560.0, 760.0], blots(PALE_BLUE, 170.0));
    room.picture(Place::new(1620.0, 2490.0, 0.0).at(-120.0), [380.0, 380.0], blots(OCHRE, 120.0));
}

fn left_side(room: &mut Furnisher) {
    room.bookcase(Place::new(-1830.0, 250.0, -90.0).at(FLOOR), [1500.0, 2100.0, 300.0], OAK);
    room.armchair(Place::new(-1120.0, 620.0, -60.0).at(FLOOR), woven(TEAL, SAND));
    let side = Place::new(-760.0, -150.0, -82.0);
    let top = room.table(side, [520.0, 620.0, 420.0], WALNUT);
    room.books_lying(side.on(top, -90.0, 20.0), 7);
    room.ball(side.on(top, 130.0, -60.0), 85.0, blots(OCHRE, 75.0));
    room.table_lamp(side.on(top, 150.0, 110.0), woven(WHITE, RED));
    room.hung_ball([-620.0, -60.0, 160.0], 60.0, CEILING, blots(RED, 60.0));
    room.hung_ball([-860.0, 60.0, 330.0], 75.0, CEILING, MARBLE);
    room.stack(
        Place::new(-980.0, -720.0, 20.0).at(FLOOR),
        &[[460.0, 420.0, 430.0], [400.0, 380.0, 370.0], [330.0, 300.0, 300.0]],
    );
    room.plant(Place::new(-1650.0, 1330.0, 0.0).at(FLOOR), 170.0, 900.0, 56);
    room.picture(Place::new(-1990.0, -900.0, -90.0).at(-150.0), [700.0, 560.0], blots(WHITE, 180.0));
    room.picture(Place::new(-1990.0, -1750.0, -90.0).at(-50.0), [560.0, 800.0], blots(TEAL, 190.0));
    room.ball(Place::new(-600.0, 350.0, 0.0).at(FLOOR), 140.0, blots(BLUE, 120.0));
}

fn right_side(room: &mut Furnisher) {
    let cabinet = Place::new(1000.0, -60.0, 84.0).at(FLOOR);
    room.cabinet(cabinet, [900.0, 980.0, 400.0], wood(PALE_TEAL, TEAL, 1));
    let top = cabinet.raised(980.0);
    room.vase(top.shifted(-260.0, 0.0), 75.0, 260.0, CLAY);
    room.leaves(top.shifted(-260.0, 0.0).raised(240.0), 18, 230.0);
    room.block(top.shifted(40.0, 20.0).turned(18.0), [220.0, 260.0, 160.0], blots(RED, 100.0));
    room.ball(top.shifted(250.0, -50.0), 95.0, blots(CREAM, 85.0));
    room.ball(top.shifted(370.0, 90.0), 60.0, woven(BLUE, OCHRE));
    room.can(top.shifted(-60.0, -130.0), 45.0, 110.0, blots(PALE_BLUE, 45.0));
    room.window(Place::new(1990.0, 300.0, 90.0).at(100.0), [1500.0, 1200.0]);
    room.curtain(Place::new(1930.0, 1230.0, 90.0).at(FLOOR - 120.0), 7, 2150.0, woven(OCHRE, RED));
    room.curtain(Place::new(1930.0, -640.0, 90.0).at(FLOOR - 120.0), 7, 2150.0, woven(OCHRE, RED));
    room.stack(
        Place::new(1180.0, 820.0, 35.0).at(FLOOR),
        &[[480.0, 400.0, 430.0], [380.0, 330.0, 360.0], [300.0, 280.0, 260.0]],
    );
    room.hung_ball([640.0, -110.0, 120.0], 62.0, CEILING, blots(MOSS, 60.0));
    room.hung_ball([760.0, -300.0, 420.0], 80.0, CEILING, blots(CREAM, 75.0));
    let stool = Place::new(690.0, -560.0, 0.0).at(FLOOR);
    let seat = room.stool(stool, 170.0, 640.0, OAK);
    room.globe(stool.raised(seat), 130.0, blots(TEAL, 100.0));
    room.picture(Place::new(1990.0, -1600.0, 90.0).at(-150.0), [900.0, 700.0], blots(CREAM, 200.0));
    room.picture(Place::new(1990.0, 1950.0, 90.0).at(-120.0), [520.0, 700.0], blots(PALE_TEAL, 170.0));
}

fn behind(room: &mut Furnisher) {
    room.sofa(Place::new(450.0, -1750.0, 176.0).at(FLOOR), woven(PLUM, GREY), blots(CREAM, 110.0));
    let table = Place::new(-80.0, -860.0, 188.0);
    let top = room.table(table, [900.0, 560.0, 480.0], OAK);
    room.books_lying(table.on(top, 260.0, 20.0), 9);
    room.vase(table.on(top, -20.0, 30.0), 70.0, 340.0, MARBLE);
    room.leaves(table.on(top - 320.0, -20.0, 30.0), 20, 260.0);
    room.ball(table.on(top, -280.0, -60.0), 110.0, blots(WHITE, 90.0));
    room.block(table.on(top, -330.0, 130.0).turned(8.0), [180.0, 330.0, 140.0], blots(OCHRE, 100.0));
    room.floor_lamp(Place::new(-560.0, -1250.0, 0.0).at(FLOOR), 1500.0, woven(CREAM, SAND));
    room.door(Place::new(-1250.0, -2480.0, 180.0).at(FLOOR), [900.0, 2050.0], wood(WHITE, SAND, 1));
    room.picture(Place::new(600.0, -2490.0, 180.0).at(-250.0), [1100.0, 700.0], blots(CREAM, 230.0));
    room.picture(Place::new(-350.0, -2490.0, 180.0).at(-100.0), [420.0, 560.0], blots(RED, 140.0));
    room.picture(Place::new(1600.0, -2490.0, 180.0).at(-100.0), [420.0, 560.0], blots(MOSS, 140.0));
    room.hung_ball([-180.0, -80.0, -650.0], 58.0, CEILING, blots(BLUE, 58.0));
    room.hung_ball([270.0, 40.0, -720.0], 72.0, CEILING, woven(OCHRE, TEAL));
    room.plant(Place::new(1500.0, -1150.0, 0.0).at(FLOOR), 160.0, 820.0, 52);
    room.stool(Place::new(-1500.0, -1500.0, 0.0).at(FLOOR), 190.0, 480.0, WALNUT);
}

fn overhead(room: &mut Furnisher) {
    for z in [-1700.0, -500.0, 700.0, 1900.0] {
        room.beam(Vector3::new(0.0, CEILING, z), [RIGHT - LEFT, 130.0, 140.0], WALNUT);
    }
    room.pendant(Vector3::new(0.0, -930.0, 300.0), 120.0, CEILING, mottled([1.0, 0.94, 0.80], CREAM, 70.0));
    let skirting = [
        (Vector3::new(LEFT, FLOOR, 0.0), FRONT - BACK, FRAC_PI_2),
        (Vector3::new(RIGHT, FLOOR, 0.0), FRONT - BACK, FRAC_PI_2),
        (Vector3::new(0.0, FLOOR, BACK), RIGHT - LEFT, 0.0),
        (Vector3::new(0.0, FLOOR, FRONT), RIGHT - LEFT, 0.0),
    ];
    for (middle, length, yaw) in skirting {
        room.skirting(middle, length, yaw, PINE_POST);
    }
}
