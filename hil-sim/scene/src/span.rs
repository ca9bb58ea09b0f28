//! Where rays enter and leave solids, in single precision: enough for images in real time, and sixteen such numbers fill a vector register.

use nalgebra::Vector3;

use crate::packet::Singles;
use crate::scene::Solid;
use crate::shape::Shape;

/// In place of a smaller component of a direction, by which nothing can be divided.
const TINY: f32 = 1e-9;

/// Where rays are inside a solid, in units of their directions' length: nowhere unless `enter` is at most `leave`.
#[derive(Clone, Copy, Debug)]
pub struct Spans<const N: usize> {
    pub enter: [f32; N],
    pub leave: [f32; N],
}

/// A solid, for rays that start near one place.
#[derive(Clone, Debug, PartialEq)]
pub struct SolidFrom {
    shape: Shape,
    /// Rows of the turn from the world to the frame of the shape.
    turn: [[f32; 3]; 3],
    /// The place in the frame of the shape, mm.
    place: [f32; 3],
}

impl SolidFrom {
    /// `solid` as met from `place` in the world, mm.
    pub fn new(solid: &Solid, place: &Vector3<f64>) -> Self {
        let turn = &solid.shape_from_world;
        let own = turn * (place - solid.centre);
        Self {
            shape: solid.shape,
            turn: [0, 1, 2].map(|row| [0, 1, 2].map(|column| turn[(row, column)] as f32)),
            place: [own.x as f32, own.y as f32, own.z as f32],
        }
    }

    /// Where rays are inside the solid, which start `offsets` from the place and have these directions, both in the world.
    #[inline(always)]
    pub fn spans<const N: usize>(&self, offsets: &Singles<N>, directions: &Singles<N>) -> Spans<N> {
        let mut origins = self.turned(offsets);
        for (component, place) in origins.iter_mut().zip(self.place) {
            component.iter_mut().for_each(|value| *value += place);
        }
        spans(&self.shape, &origins, &self.turned(directions))
    }

    /// The same for rays that start at the place itself.
    #[inline(always)]
    pub fn spans_from_place<const N: usize>(&self, directions: &Singles<N>) -> Spans<N> {
        spans(&self.shape, &[[self.place[0]; N], [self.place[1]; N], [self.place[2]; N]], &self.turned(directions))
    }

    #[inline(always)]
    fn turned<const N: usize>(&self, vectors: &Singles<N>) -> Singles<N> {
        let mut turned = [[0.0; N]; 3];
        for (turned, [x, y, z]) in turned.iter_mut().zip(&self.turn) {
            for i in 0..N {
                turned[i] = x * vectors[0][i] + y * vectors[1][i] + z * vectors[2][i];
            }
        }
        turned
    }
}

/// For rays in the frame of the shape: each shape is convex.
#[inline(always)]
fn spans<const N: usize>(shape: &Shape, origin: &Singles<N>, direction: &Singles<N>) -> Spans<N> {
    match *shape {
        Shape::Rectangle { half } => {
            let half = half.map(|half| half as f32);
            plane(origin, direction, |x, y| (x.abs() <= half[0]) & (y.abs() <= half[1]))
        }
        Shape::Ellipse { half } => {
            let inverse = half.map(|half| half.recip() as f32);
            plane(origin, direction, |x, y| (x * inverse[0]).powi(2) + (y * inverse[1]).powi(2) <= 1.0)
        }
        Shape::Block { half } => {
            let mut spans = Spans { enter: [f32::NEG_INFINITY; N], leave: [f32::INFINITY; N] };
            for axis in 0..3 {
                spans = spans.within_slab(&origin[axis], &direction[axis], half[axis] as f32);
            }
            spans
        }
        Shape::Sphere { radius } => round(origin, direction, radius as f32),
        Shape::Cylinder { radius, half_height } => {
            let [[ox, oy, oz], [dx, dy, dz]] = [origin, direction];
            let still = [0.0; N];
            round(&[*ox, still, *oz], &[*dx, still, *dz], radius as f32).within_slab(oy, dy, half_height as f32)
        }
    }
}

#[inline(always)]
fn plane<const N: usize>(o: &Singles<N>, d: &Singles<N>, inside: impl Fn(f32, f32) -> bool) -> Spans<N> {
    let mut spans = Spans { enter: [f32::INFINITY; N], leave: [f32::NEG_INFINITY; N] };
    for i in 0..N {
        // Infinite or not a number where the ray is along the plane: then it is not inside.
        let range = -o[2][i] / d[2][i];
        let met = inside(o[0][i] + range * d[0][i], o[1][i] + range * d[1][i]);
        spans.enter[i] = if met { range } else { f32::INFINITY };
        spans.leave[i] = if met { range } else { f32::NEG_INFINITY };
    }
    spans
}

/// Of a sphere about the origin. The distance of the line from the origin is of a cross product, which loses less than the usual
/// discriminant does.
#[inline(always)]
fn round<const N: usize>(o: &Singles<N>, d: &Singles<N>, radius: f32) -> Spans<N> {
    let mut spans = Spans { enter: [0.0; N], leave: [0.0; N] };
    for i in 0..N {
        let ([ox, oy, oz], [dx, dy, dz]) = ([o[0][i], o[1][i], o[2][i]], [d[0][i], d[1][i], d[2][i]]);
        let dx = if dx.abs() < TINY { TINY } else { dx };
        let [x, y, z] = [oy * dz - oz * dy, oz * dx - ox * dz, ox * dy - oy * dx];
        let length = dx * dx + dy * dy + dz * dz;
        let inverse = 1.0 / length;
        let nearest = -(ox * dx + oy * dy + oz * dz) * inverse;
        // Of a negative number the root is none, and fails every comparison.
        let reach = (radius * radius * length - (x * x + y * y + z * z)).sqrt() * inverse;
        (spans.enter[i], spans.leave[i]) = (nearest - reach, nearest + reach);
    }
    spans
}

impl<const N: usize> Spans<N> {
    /// The parts that are also within `half` of 0 along an axis: not numbers remain so.
    #[inline(always)]
    fn within_slab(mut self, o: &[f32; N], d: &[f32; N], half: f32) -> Self {
        for i in 0..N {
            let inverse = 1.0 / if d[i].abs() < TINY { TINY } else { d[i] };
            let (middle, reach) = (-o[i] * inverse, (half * inverse).abs());
            let (near, far) = (middle - reach, middle + reach);
            self.enter[i] = if near > self.enter[i] { near } else { self.enter[i] };
            self.leave[i] = if far < self.leave[i] { far } else { self.leave[i] };
        }
        self
    }
}
