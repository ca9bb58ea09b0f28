//! Pieces of furniture, put together from shapes.

use nalgebra::{UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

use crate::scene::{Material, Solid};
use crate::shape::Shape;
use crate::texture::{Pattern, Rgb, pigment};

/// Gap left between surfaces that would coincide, mm.
const GAP: f64 = 1.0;

/// A spot in the room, and which way a piece there is turned about the vertical. A piece's own x is its width from
/// left to right as one faces it, its front is towards its own -z.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    position: Vector3<f64>,
    yaw: f64,
}

/// Collects the solids of a room. Each gets another seed, so that no two look the same.
pub struct Furnisher {
    /// The solids so far.
    pub solids: Vec<Solid>,
    random: Pcg64Mcg,
}

impl Place {
    /// A spot at `x`, `z` mm, turned by `yaw_deg`: 0 faces an observer at smaller z.
    pub fn new(x: f64, z: f64, yaw_deg: f64) -> Self {
        Self { position: Vector3::new(x, 0.0, z), yaw: yaw_deg.to_radians() }
    }

    /// Moves this spot to the height `y` (down).
    pub fn at(mut self, y: f64) -> Self {
        self.position.y = y;
        self
    }

    /// The spot raised by `height`.
    pub fn raised(mut self, height: f64) -> Self {
        self.position.y -= height;
        self
    }

    /// The spot moved along the piece's own axes.
    pub fn shifted(mut self, x: f64, z: f64) -> Self {
        self.position += self.rotation() * Vector3::new(x, 0.0, z);
        self
    }

    /// The spot on the surface at height `y`, moved along the piece's own axes.
    pub fn on(self, y: f64, x: f64, z: f64) -> Self {
        self.at(y).shifted(x, z)
    }

    /// The spot turned further.
    pub fn turned(mut self, yaw_deg: f64) -> Self {
        self.yaw += yaw_deg.to_radians();
        self
    }

    fn rotation(&self) -> UnitQuaternion<f64> {
        UnitQuaternion::from_axis_angle(&Vector3::y_axis(), self.yaw)
    }
}

impl Furnisher {
    /// An empty collection; `seed` decides everything random.
    pub fn new(seed: u64) -> Self {
        Self { solids: Vec::new(), random: Pcg64Mcg::seed_from_u64(seed) }
    }

    fn put(&mut self, shape: Shape, centre: Vector3<f64>, rotation: UnitQuaternion<f64>, pattern: Pattern) {
        let material = Material { pattern, seed: self.random.random(), glow: None };
        self.solids.push(Solid::new(shape, centre, rotation, material));
    }

    fn shine(
        &mut self,
        shape: Shape,
        centre: Vector3<f64>,
        rotation: UnitQuaternion<f64>,
        pattern: Pattern,
        glow: f32,
    ) {
        let material = Material { pattern, seed: self.random.random(), glow: Some(glow) };
        self.solids.push(Solid::new(shape, centre, rotation, material));
    }

    fn vary(&mut self, low: f64, high: f64) -> f64 {
        self.random.random_range(low..high)
    }

    fn any_ink(&mut self) -> Rgb {
        pigment(self.random.random())
    }

    /// A box of [width, height, depth] standing on `place`.
    pub fn block(&mut self, place: Place, size: [f64; 3], pattern: Pattern) {
        let half = Vector3::from(size) * 0.5;
        self.put(Shape::Block { half }, place.raised(half.y).position, place.rotation(), pattern);
    }

    /// A ball lying on `place`.
    pub fn ball(&mut self, place: Place, radius: f64, pattern: Pattern) {
        self.put(Shape::Sphere { radius }, place.raised(radius).position, place.rotation(), pattern);
    }

    /// A cylinder standing on `place`.
    pub fn can(&mut self, place: Place, radius: f64, height: f64, pattern: Pattern) {
        let half_height = 0.5 * height;
        let shape = Shape::Cylinder { radius, half_height };
        self.put(shape, place.raised(half_height).position, place.rotation(), pattern);
    }

    /// A cloth of [width, depth] lying on `place`.
    pub fn flat_on(&mut self, place: Place, [width, depth]: [f64; 2], yaw_deg: f64, pattern: Pattern) {
        self.block(place.turned(yaw_deg), [width, 4.0, depth], pattern);
    }

    /// A rug of [width, depth] lying on `place`.
    pub fn rug(&mut self, place: Place, [width, depth]: [f64; 2], pattern: Pattern) {
        self.block(place, [width, 12.0, depth], pattern);
    }

    /// A sheet of [width, height] about `place`, leaning back by `pitch_deg`.
    pub fn tilted_sheet(&mut self, place: Place, [width, height]: [f64; 2], pitch_deg: f64, pattern: Pattern) {
        let lean = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), pitch_deg.to_radians());
        let half = Vector3::new(0.5 * width, 0.5 * height, 3.0);
        self.put(Shape::Block { half }, place.position, place.rotation() * lean, pattern);
    }

    /// A table of [width, height, depth] on the floor, y = 1200 mm. Returns the y of its top.
    pub fn table(&mut self, place: Place, [width, height, depth]: [f64; 3], pattern: Pattern) -> f64 {
        const FLOOR: f64 = 1200.0;
        const THICKNESS: f64 = 36.0;
        const LEG: f64 = 52.0;
        let legs = if let Pattern::Wood { light, dark, .. } = pattern {
            Pattern::Wood { light, dark, axis: 1 }
        } else {
            pattern
        };
        let place = place.at(FLOOR);
        let (x, z) = (0.5 * width - LEG, 0.5 * depth - LEG);
        for (x, z) in [(-x, -z), (x, -z), (-x, z), (x, z)] {
            self.block(place.shifted(x, z), [LEG, height - THICKNESS, LEG], legs);
        }
        self.block(place.raised(height - THICKNESS), [width, THICKNESS, depth], pattern);
        FLOOR - height
    }

    /// A round stool. Returns its height.
    pub fn stool(&mut self, place: Place, radius: f64, height: f64, pattern: Pattern) -> f64 {
        const SEAT: f64 = 40.0;
        for leg in 0..3 {
            let foot = place.turned(120.0 * f64::from(leg)).shifted(0.0, 0.65 * radius);
            self.can(foot, 20.0, height - SEAT, pattern);
        }
        self.can(place.raised(height - SEAT), radius, SEAT, pattern);
        height
    }

    /// A ball on a turned foot.
    pub fn globe(&mut self, place: Place, radius: f64, pattern: Pattern) {
        let foot = Pattern::Wood { light: [0.30, 0.16, 0.08], dark: [0.08, 0.04, 0.02], axis: 1 };
        self.can(place, 0.6 * radius, 22.0, foot);
        self.can(place.raised(22.0), 16.0, 60.0, foot);
        self.ball(place.raised(60.0), radius, pattern);
    }

    /// A jar with a belly and a neck.
    pub fn vase(&mut self, place: Place, radius: f64, height: f64, pattern: Pattern) {
        self.can(place, 0.62 * radius, 0.9 * height, pattern);
        self.ball(place.raised(0.08 * height), radius, pattern);
        self.can(place.raised(0.88 * height), 0.72 * radius, 0.12 * height, pattern);
    }

    /// A bunch of `count` leaves, growing from `place` to a height and width of about `reach`.
    pub fn leaves(&mut self, place: Place, count: u32, reach: f64) {
        const GOLDEN_ANGLE_DEG: f64 = 137.508;
        for i in 0..count {
            let part = (f64::from(i) + 0.5) / f64::from(count);
            let stalk = place.turned(GOLDEN_ANGLE_DEG * f64::from(i) + self.vary(-15.0, 15.0));
            let length = reach * self.vary(0.35, 0.55);
            let outwards = reach * self.vary(0.30, 0.62) * (1.15 - part);
            let middle = stalk.shifted(0.0, -outwards).raised(reach * (0.15 + 0.85 * part));
            let lean = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), self.vary(0.2, 1.25));
            let green = self.vary(0.7, 1.3) as f32;
            let pattern = Pattern::Leaf { light: [0.20 * green, 0.40, 0.10], dark: [0.04, 0.13 * green, 0.03] };
            let shape = Shape::Ellipse { half: [0.26 * length, 0.5 * length] };
            self.put(shape, middle.position, stalk.rotation() * lean, pattern);
        }
    }

    /// A plant in a pot.
    pub fn plant(&mut self, place: Place, radius: f64, height: f64, count: u32) {
        let clay = Pattern::Mottled { light: [0.56, 0.24, 0.13], dark: [0.26, 0.09, 0.05], cell: 60.0 };
        let bark = Pattern::Mottled { light: [0.24, 0.17, 0.10], dark: [0.07, 0.05, 0.03], cell: 40.0 };
        self.can(place, 0.85 * radius, 1.5 * radius, clay);
        self.can(place.raised(1.5 * radius), radius, 0.35 * radius, clay);
        self.can(place.raised(1.8 * radius), 18.0, 0.9 * height, bark);
        self.leaves(place.raised(1.7 * radius), count, height);
    }

    /// A lying pile of `count` books.
    pub fn books_lying(&mut self, place: Place, count: u32) {
        let mut pile = place;
        for _ in 0..count {
            let thickness = self.vary(20.0, 46.0);
            let size = [self.vary(190.0, 260.0), thickness, self.vary(130.0, 180.0)];
            let pattern = Pattern::Book { cloth: self.any_ink(), ink: self.any_ink() };
            let yaw = self.vary(-16.0, 16.0);
            self.block(pile.turned(yaw), size, pattern);
            pile = pile.raised(thickness);
        }
    }

    /// Boxes on top of each other, largest first.
    pub fn stack(&mut self, place: Place, sizes: &[[f64; 3]]) {
        let mut pile = place;
        for &size in sizes {
            let ground = self.any_ink().map(|c| 0.35 + 0.5 * c);
            let yaw = self.vary(-20.0, 20.0);
            self.block(pile.turned(yaw), size, Pattern::Blots { ground, cell: 0.4 * size[0] });
            pile = pile.raised(size[1]);
        }
    }

    /// A bookcase of [width, height, depth] full of standing books.
    pub fn bookcase(&mut self, place: Place, [width, height, depth]: [f64; 3], pattern: Pattern) {
        const BOARD: f64 = 26.0;
        const SHELF: f64 = 335.0;
        self.block(place.shifted(0.0, 0.5 * depth - 8.0), [width, height, 16.0], pattern);
        for side in [-0.5, 0.5] {
            self.block(place.shifted(side * (width - BOARD), 0.0), [BOARD, height, depth], pattern);
        }
        let inner = width - 2.0 * BOARD;
        let shelves = ((height - BOARD) / SHELF) as u32;
        for shelf in 0..=shelves {
            let level = place.raised(f64::from(shelf) * (height - BOARD) / f64::from(shelves));
            self.block(level, [inner, BOARD, depth - 2.0 * GAP], pattern);
            if shelf < shelves {
                self.books_standing(level.raised(BOARD), inner, SHELF - 2.0 * BOARD, depth);
            }
        }
    }

    fn books_standing(&mut self, place: Place, width: f64, height: f64, depth: f64) {
        let mut x = -0.5 * width + GAP;
        loop {
            let thickness = self.vary(22.0, 62.0);
            if x + thickness > 0.5 * width {
                break;
            }
            // Now and then there is a gap instead.
            if self.vary(0.0, 1.0) < 0.93 {
                let size = [thickness - GAP, height * self.vary(0.62, 0.98), depth * self.vary(0.5, 0.7)];
                let set_back = 0.5 * depth - 20.0 - 0.5 * size[2];
                let pattern = Pattern::Book { cloth: self.any_ink(), ink: self.any_ink() };
                self.block(place.shifted(x + 0.5 * thickness, set_back), size, pattern);
            }
            x += thickness;
        }
    }

    /// A cabinet of [width, height, depth] with two doors.
    pub fn cabinet(&mut self, place: Place, [width, height, depth]: [f64; 3], pattern: Pattern) {
        let brass = Pattern::Mottled { light: [0.70, 0.52, 0.20], dark: [0.30, 0.20, 0.06], cell: 30.0 };
        self.block(place, [width, height - 30.0, depth], pattern);
        self.block(place.raised(height - 30.0), [width + 40.0, 30.0, depth + 40.0], pattern);
        for side in [-1.0, 1.0] {
            let front = place.shifted(side * 0.25 * width, -0.5 * depth);
            self.block(front.raised(50.0), [0.44 * width, height - 130.0, 24.0], pattern);
            self.ball(front.shifted(-side * 0.18 * width, -24.0).raised(0.55 * height), 18.0, brass);
        }
    }

    /// A framed picture of [width, height], its middle at `place`, which is on a wall.
    pub fn picture(&mut self, place: Place, [width, height]: [f64; 2], pattern: Pattern) {
        const MARGIN: f64 = 36.0;
        let frame = Pattern::Wood { light: [0.28, 0.17, 0.08], dark: [0.07, 0.04, 0.02], axis: 0 };
        let lowest = place.raised(-0.5 * height);
        self.block(lowest.raised(-MARGIN), [width + 2.0 * MARGIN, height + 2.0 * MARGIN, 20.0], frame);
        self.block(lowest.shifted(0.0, -6.0), [width, height, 20.0], pattern);
    }

    /// A window onto a garden, of [width, height], its middle at `place`.
    pub fn window(&mut self, place: Place, [width, height]: [f64; 2]) {
        const BAR: f64 = 60.0;
        const BRIGHTNESS: f32 = 1.1;
        let paint = Pattern::Wood { light: [0.80, 0.79, 0.76], dark: [0.55, 0.53, 0.50], axis: 1 };
        let half = [0.5 * width, 0.5 * height];
        let pane = Shape::Rectangle { half };
        self.shine(pane, place.shifted(0.0, -4.0).position, place.rotation(), Pattern::Garden { height }, BRIGHTNESS);
        let lowest = place.raised(-half[1]);
        for side in [-half[0], 0.0, half[0]] {
            self.block(lowest.shifted(side, -10.0), [BAR, height, 40.0], paint);
        }
        for up in [0.0, 0.6 * height, height] {
            self.block(lowest.raised(up - 0.5 * BAR), [width + BAR, BAR, 44.0], paint);
        }
    }

    /// A curtain of `folds` folds and `height` mm.
    pub fn curtain(&mut self, place: Place, folds: u32, height: f64, pattern: Pattern) {
        const FOLD: f64 = 36.0;
        for i in 0..folds {
            let x = (f64::from(i) - 0.5 * f64::from(folds)) * 1.6 * FOLD;
            let z = if i % 2 == 0 { -12.0 } else { 12.0 };
            self.can(place.shifted(x, z), FOLD, height, pattern);
        }
    }

    /// A panelled door of [width, height].
    pub fn door(&mut self, place: Place, [width, height]: [f64; 2], pattern: Pattern) {
        let brass = Pattern::Mottled { light: [0.70, 0.52, 0.20], dark: [0.30, 0.20, 0.06], cell: 30.0 };
        self.block(place, [width + 160.0, height + 80.0, 16.0], pattern);
        self.block(place.shifted(0.0, -10.0), [width, height, 24.0], pattern);
        for (x, up, tall) in [(-0.24, 0.08, 0.34), (0.24, 0.08, 0.34), (-0.24, 0.5, 0.42), (0.24, 0.5, 0.42)] {
            self.block(
                place.shifted(x * width, -24.0).raised(up * height),
                [0.36 * width, tall * height, 20.0],
                pattern,
            );
        }
        self.ball(place.shifted(0.42 * width, -50.0).raised(0.46 * height), 30.0, brass);
    }

    /// An upholstered chair with arms.
    pub fn armchair(&mut self, place: Place, cloth: Pattern) {
        self.block(place.raised(60.0), [520.0, 340.0, 620.0], cloth);
        self.block(place.shifted(0.0, 250.0).raised(60.0), [680.0, 800.0, 160.0], cloth);
        for side in [-330.0, 330.0] {
            self.block(place.shifted(side, -20.0), [130.0, 560.0, 640.0], cloth);
        }
        let cushion = Pattern::Blots { ground: [0.66, 0.42, 0.10], cell: 110.0 };
        self.tilted_sheet(place.shifted(0.0, 120.0).raised(590.0), [380.0, 340.0], 15.0, cushion);
    }

    /// A sofa with cushions.
    pub fn sofa(&mut self, place: Place, cloth: Pattern, cushions: Pattern) {
        self.block(place.raised(70.0), [1700.0, 340.0, 800.0], cloth);
        self.block(place.shifted(0.0, 330.0).raised(70.0), [1900.0, 760.0, 180.0], cloth);
        for side in [-900.0, 900.0] {
            self.block(place.shifted(side, 0.0), [160.0, 580.0, 820.0], cloth);
        }
        for (x, yaw) in [(-600.0, 12.0), (40.0, -8.0), (570.0, -15.0)] {
            let cushion = place.shifted(x, 180.0).raised(600.0).turned(yaw);
            self.tilted_sheet(cushion, [400.0, 380.0], 18.0, cushions);
        }
    }

    /// A small lamp with a drum shade, which is not lit.
    pub fn table_lamp(&mut self, place: Place, shade: Pattern) {
        let foot = Pattern::Mottled { light: [0.16, 0.30, 0.34], dark: [0.03, 0.08, 0.10], cell: 50.0 };
        self.can(place, 70.0, 24.0, foot);
        self.can(place.raised(24.0), 15.0, 240.0, foot);
        self.can(place.raised(230.0), 125.0, 180.0, shade);
    }

    /// A tall lamp with a drum shade.
    pub fn floor_lamp(&mut self, place: Place, height: f64, shade: Pattern) {
        let foot = Pattern::Mottled { light: [0.25, 0.24, 0.22], dark: [0.05, 0.05, 0.05], cell: 40.0 };
        self.can(place, 150.0, 30.0, foot);
        self.can(place.raised(30.0), 18.0, height - 200.0, foot);
        self.can(place.raised(height - 240.0), 200.0, 240.0, shade);
    }

    /// A ball about [x, y, z] on a thread from the ceiling at y = `ceiling`.
    pub fn hung_ball(&mut self, [x, y, z]: [f64; 3], radius: f64, ceiling: f64, pattern: Pattern) {
        const THREAD: f64 = 4.0;
        let thread = Pattern::Mottled { light: [0.20, 0.18, 0.16], dark: [0.06, 0.06, 0.05], cell: 20.0 };
        let place = Place::new(x, z, 0.0).at(y + radius);
        self.ball(place, radius, pattern);
        self.can(place.raised(2.0 * radius), THREAD, y - radius - ceiling, thread);
    }

    /// A shining globe of `radius` about `centre` on a cord from the ceiling at y = `ceiling`.
    pub fn pendant(&mut self, centre: Vector3<f64>, radius: f64, ceiling: f64, pattern: Pattern) {
        const CORD: f64 = 8.0;
        const BRIGHTNESS: f32 = 1.0;
        self.shine(Shape::Sphere { radius }, centre, UnitQuaternion::identity(), pattern, BRIGHTNESS);
        let cord = Pattern::Mottled { light: [0.12, 0.11, 0.10], dark: [0.03, 0.03, 0.03], cell: 20.0 };
        let place = Place::new(centre.x, centre.z, 0.0).at(centre.y - radius);
        self.can(place, CORD, centre.y - radius - ceiling, cord);
    }

    /// A beam of [width, height, depth] under the ceiling, the middle of its upper side at `top`.
    pub fn beam(&mut self, top: Vector3<f64>, size: [f64; 3], pattern: Pattern) {
        self.block(Place::new(top.x, top.z, 0.0).at(top.y + size[1]), size, pattern);
    }

    /// A skirting board along the foot of a wall.
    pub fn skirting(&mut self, middle: Vector3<f64>, length: f64, yaw: f64, pattern: Pattern) {
        self.block(Place::new(middle.x, middle.z, yaw.to_degrees()).at(middle.y), [length, 90.0, 32.0], pattern);
    }
}
