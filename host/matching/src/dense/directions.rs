//! The directions of a row of the left image's pixels in the shared axes.
//!
//! They change smoothly along a row: exact at knots, interpolated between them.

use nalgebra::{Matrix3, Vector3};
use vergence_vision::BatchLens;

use crate::knots::{KNOT, interpolate};

/// Largest difference of an angle between four knots, in radians: where it is larger, as beside the baseline's direction and where b passes
/// 180 degrees, nothing is interpolated.
const SMOOTH: f64 = 0.2;

/// A direction (sin a, cos a sin b, cos a cos b).
#[derive(Clone, Copy, Debug)]
pub(super) struct Direction {
    /// In radians; NaN where the lens shows nothing.
    pub a: f64,
    pub b: f64,
    /// Sine and cosine of each.
    pub of_a: [f64; 2],
    pub of_b: [f64; 2],
}

impl Direction {
    /// The direction of a vector.
    pub(super) fn of(vector: Vector3<f64>) -> Self {
        let [x, y, z]: [f64; 3] = vector.into();
        let across = (y * y + z * z).sqrt();
        let length = (x * x + across * across).sqrt();
        Self {
            a: x.atan2(across),
            b: y.atan2(z),
            of_a: [x / length, across / length],
            of_b: if across > 0.0 { [y / across, z / across] } else { [0.0, 1.0] },
        }
    }

    /// The direction at the angles a and b in radians.
    #[cfg(test)]
    pub(super) fn at([a, b]: [f64; 2]) -> Self {
        Self { a, b, of_a: a.sin_cos().into(), of_b: b.sin_cos().into() }
    }

    const fn to_array(self) -> [f64; 6] {
        [self.a, self.b, self.of_a[0], self.of_a[1], self.of_b[0], self.of_b[1]]
    }

    const fn from_array([a, b, sin_a, cos_a, sin_b, cos_b]: [f64; 6]) -> Self {
        Self { a, b, of_a: [sin_a, cos_a], of_b: [sin_b, cos_b] }
    }
}

/// The directions of one row, and what finds them.
#[derive(Default)]
pub(super) struct RowOfDirections {
    pixels: Vec<[f64; 2]>,
    rays: Vec<[f64; 3]>,
    knots: Vec<[f64; 6]>,
    found: Vec<[f64; 6]>,
}

impl RowOfDirections {
    /// The directions of the pixels of row `v`, for the rotation from the lens to the shared axes.
    pub(super) fn of(
        &mut self,
        (lens, turn): (&BatchLens, &Matrix3<f64>),
        width: usize,
        v: usize,
    ) -> impl Iterator<Item = Direction> + '_ {
        let knots = (0..width.div_ceil(KNOT) + 3).map(|knot| (knot * KNOT) as f64 - KNOT as f64);
        self.find((lens, turn), knots, v);
        std::mem::swap(&mut self.knots, &mut self.found);
        let mut row = Vec::with_capacity(width);
        for knot in 0..width.div_ceil(KNOT) {
            let columns = knot * KNOT..((knot + 1) * KNOT).min(width);
            let knots = &self.knots[knot..knot + 4];
            if is_smooth(knots) {
                let mut found = [[0.0; 6]; KNOT];
                interpolate(knots, &mut found);
                row.extend_from_slice(&found[..columns.len()]);
            } else {
                self.find((lens, turn), columns.map(|u| u as f64), v);
                row.append(&mut self.found);
            }
        }
        row.into_iter().map(Direction::from_array)
    }

    /// The directions of some pixels of row `v`, without interpolation.
    fn find(&mut self, (lens, turn): (&BatchLens, &Matrix3<f64>), columns: impl Iterator<Item = f64>, v: usize) {
        let Self { pixels, rays, found, .. } = self;
        pixels.clear();
        rays.clear();
        found.clear();
        pixels.extend(columns.map(|u| [u, v as f64]));
        lens.unproject_into(pixels, rays);
        found.extend(rays.iter().map(|ray| Direction::of(turn * Vector3::from(*ray)).to_array()));
    }
}

/// Whether values between four knots can be interpolated: angles are no numbers beyond the field.
fn is_smooth(knots: &[[f64; 6]]) -> bool {
    let spread = |angle: usize| {
        let [least, most] = [f64::min, f64::max].map(|choose| knots.iter().map(|knot| knot[angle]).reduce(choose));
        most.zip(least).map_or(f64::INFINITY, |(most, least)| most - least)
    };
    knots.iter().all(|knot| knot[0].is_finite()) && spread(0) < SMOOTH && spread(1) < SMOOTH
}

#[cfg(test)]
mod tests {
    use vergence_vision::{Angle, ImageSize, KannalaBrandt, Pixel};

    use super::*;

    /// Each pixel of a lens beyond 180 degrees, turned so far that b passes 180 degrees in its image and the baseline's direction lies in it.
    #[test]
    fn interpolated_directions_are_those_of_the_lens() {
        let size = ImageSize { width: 643, height: 640 };
        let k = [183.0, 1.8, -0.8, 0.2, 0.0];
        let lens =
            KannalaBrandt::new(k, 1.0, Pixel { u: 320.0, v: 319.5 }, Angle::from_deg(98.0), size).expect("a lens");
        let turn = nalgebra::Rotation3::from_euler_angles(0.1, -1.0, 0.05).into_inner();
        let (batch, mut row) = (BatchLens::new(&lens), RowOfDirections::default());
        let (mut inside, mut farthest) = (0, 0.0_f64);
        for v in 0..size.height as usize {
            for (u, found) in row.of((&batch, &turn), size.width as usize, v).enumerate() {
                let pixel = Pixel { u: u as f64, v: v as f64 };
                let Ok(ray) = lens.unproject::<vergence_vision::Left>(pixel) else {
                    assert!(found.a.is_nan(), "{u} {v}");
                    continue;
                };
                let exact = Direction::of(turn * ray.vector());
                inside += 1;
                if exact.a.abs() < 75_f64.to_radians() {
                    let off =
                        exact.to_array().into_iter().zip(found.to_array()).map(|(exact, found)| (exact - found).abs());
                    let off = off.fold(0.0, f64::max);
                    assert!(off * k[0] < 0.02, "{u} {v}: {found:?} is not {exact:?}");
                    farthest = farthest.max(off);
                }
            }
        }
        assert!(inside > 280_000 && farthest * k[0] > 1e-6, "{inside} {farthest}");
    }
}
