//! Rays that are followed side by side, so that the compiler makes vector instructions of each step: one number of each ray in a row.
//!
//! Every ray's numbers are those that it would have alone, in the same operations: `N` changes no bit of a result.

use nalgebra::{Matrix3, Vector3};

/// Rays that are followed at once where many are: as many as the largest vector registers hold single precision numbers.
pub const LANES: usize = 16;

/// Light that is followed in double precision, with what that costs.
pub const EXACT: u8 = 0;
/// Light that is followed in single precision where this does not show.
pub const QUICK: u8 = 1;

/// Three components of `N` vectors.
pub type Triples<const N: usize> = [[f64; N]; 3];

/// The same in single precision.
pub type Singles<const N: usize> = [[f32; N]; 3];

/// Rays in the world; those that do not count have any numbers.
#[derive(Clone, Copy, Debug)]
pub struct Packet<const N: usize> {
    /// Where they start, mm.
    pub origin: Triples<N>,
    /// Their directions, of any length.
    pub direction: Triples<N>,
    /// Which of them count.
    pub counts: [bool; N],
}

/// Sums of products.
#[inline(always)]
pub fn dots<const N: usize>(a: &Triples<N>, b: &Triples<N>) -> [f64; N] {
    let mut sums = [0.0; N];
    for i in 0..N {
        sums[i] = a[0][i] * b[0][i] + a[1][i] * b[1][i] + a[2][i] * b[2][i];
    }
    sums
}

/// `turn` applied to each vector.
#[inline(always)]
pub fn turned<const N: usize>(turn: &Matrix3<f64>, vectors: &Triples<N>) -> Triples<N> {
    let mut turned = [[0.0; N]; 3];
    for (row, turned) in turned.iter_mut().enumerate() {
        let [x, y, z] = [turn[(row, 0)], turn[(row, 1)], turn[(row, 2)]];
        for i in 0..N {
            turned[i] = x * vectors[0][i] + y * vectors[1][i] + z * vectors[2][i];
        }
    }
    turned
}

/// Each vector less `middle`.
#[inline(always)]
pub fn less<const N: usize>(vectors: &Triples<N>, middle: &Vector3<f64>) -> Triples<N> {
    let mut less = *vectors;
    for (component, middle) in less.iter_mut().zip(middle.iter()) {
        component.iter_mut().for_each(|value| *value -= middle);
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
pub fn at_ranges<const N: usize>(origin: &Triples<N>, direction: &Triples<N>, ranges: &[f64; N]) -> Triples<N> {
    let mut places = [[0.0; N]; 3];
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
