//! Rays that are followed side by side, so that the compiler makes vector instructions of each step: one number of each ray in a row.
//!
//! Every ray's numbers are those that it would have alone, in the same operations: `N` changes no bit of a result.

use nalgebra::{Matrix3, Vector3};

use crate::real::Real;

/// Rays that are followed at once where many are: as many as the largest vector registers hold single precision numbers.
pub const LANES: usize = 16;

/// The same for images in real time: those of a square of pixels. The compiler unrolls loops over so few as [`LANES`], and then does not always
/// find the largest registers; and what is done once for all rays side by side counts less.
pub const QUICK_LANES: usize = 64;

/// Three components of `N` vectors.
pub type Triples<const N: usize> = [[f64; N]; 3];

/// The same in single precision.
pub type Singles<const N: usize> = [[f32; N]; 3];

/// Rays in the world; those that do not count have any numbers.
#[derive(Clone, Copy, Debug)]
pub struct Packet<T, const N: usize> {
    /// Where they start, mm.
    pub origin: [[T; N]; 3],
    /// Their directions, of any length.
    pub direction: [[T; N]; 3],
    /// Which of them count.
    pub counts: [bool; N],
}

/// Sums of products.
#[inline(always)]
pub fn dots<T: Real, const N: usize>(a: &[[T; N]; 3], b: &[[T; N]; 3]) -> [T; N] {
    let mut sums = [T::of(0.0); N];
    for i in 0..N {
        sums[i] = a[0][i] * b[0][i] + a[1][i] * b[1][i] + a[2][i] * b[2][i];
    }
    sums
}

/// `turn` applied to each vector.
#[inline(always)]
pub fn turned<T: Real, const N: usize>(turn: &Matrix3<f64>, vectors: &[[T; N]; 3]) -> [[T; N]; 3] {
    let mut turned = *vectors;
    for (row, turned) in turned.iter_mut().enumerate() {
        let [x, y, z] = [T::of(turn[(row, 0)]), T::of(turn[(row, 1)]), T::of(turn[(row, 2)])];
        for i in 0..N {
            turned[i] = x * vectors[0][i] + y * vectors[1][i] + z * vectors[2][i];
        }
    }
    turned
}

/// Each vector less `middle`.
#[inline(always)]
pub fn less<T: Real, const N: usize>(vectors: &[[T; N]; 3], middle: &Vector3<f64>) -> [[T; N]; 3] {
    let mut less = *vectors;
    for (component, middle) in less.iter_mut().zip(middle.iter()) {
        component.iter_mut().for_each(|value| *value = *value - T::of(*middle));
    }
    less
}

/// Vectors rounded to single precision.
#[inline(always)]
pub fn singles<const N: usize>(vectors: &Triples<N>) -> Singles<N> {
    let mut singles = [[0.0; N]; 3];
    for axis in 0..3 {
        for i in 0..N {
            singles[axis][i] = vectors[axis][i] as f32;
        }
    }
    singles
}

/// The places on rays at their `ranges`.
#[inline(always)]
pub fn at_ranges<T: Real, const N: usize>(
    origin: &[[T; N]; 3],
    direction: &[[T; N]; 3],
    ranges: &[T; N],
) -> [[T; N]; 3] {
    let mut places = *origin;
    for axis in 0..3 {
        for i in 0..N {
            places[axis][i] = origin[axis][i] + direction[axis][i] * ranges[i];
        }
    }
    places
}

/// The vector of one ray.
#[inline(always)]
pub const fn one_of<const N: usize>(vectors: &Triples<N>, ray: usize) -> Vector3<f64> {
    Vector3::new(vectors[0][ray], vectors[1][ray], vectors[2][ray])
}

/// A vector as that of a single ray.
pub const fn alone(vector: &Vector3<f64>) -> Triples<1> {
    let [[x, y, z]] = vector.data.0;
    [[x], [y], [z]]
}

/// The value of the first of the rays that are `left`, and all of these that have it, which are left no longer. `None` where none is left.
///
/// No closure is called for each value: only what is inlined gets the instructions of its caller.
#[inline(always)]
pub fn next_value<T: PartialEq + Copy, const N: usize>(
    left: &mut [bool; N],
    values: &[T; N],
) -> Option<(T, [bool; N])> {
    let first = left.iter().position(|left| *left)?;
    let value = values[first];
    let mut members = [false; N];
    for i in 0..N {
        members[i] = left[i] & (values[i] == value);
        left[i] &= !members[i];
    }
    Some((value, members))
}

/// The largest of the values of `members`; `least` where there are none.
#[inline(always)]
pub fn largest<T: PartialOrd + Copy, const N: usize>(values: &[T; N], members: &[bool; N], least: T) -> T {
    let mut largest = [least; N];
    for i in 0..N {
        largest[i] = if members[i] { values[i] } else { least };
    }
    // By halves: a vector instruction each.
    let mut half = N / 2;
    while half > 0 {
        for i in 0..half {
            largest[i] = if largest[i + half] > largest[i] { largest[i + half] } else { largest[i] };
        }
        half /= 2;
    }
    largest[0]
}

/// Whether any of the values is above `least`.
#[inline(always)]
pub fn any_above<const N: usize>(values: &[f32; N], least: f32) -> bool {
    let mut above = 0;
    for value in values {
        above |= u32::from(*value > least);
    }
    above != 0
}
