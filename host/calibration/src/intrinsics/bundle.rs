//! The joint least-squares problem: one lens, an optional bow of the target, and the target's pose in every view.

use nalgebra::{Isometry3, Point3, SVector, Vector3};
use vergence_vision::Point;

use super::lens::{LENS, LensParameters, reprojected};
use super::observations::{Observation, ObservedView};
use super::prior::{KNOWN, Known, Strength};
use crate::reprojection::{POSE, moved};
use crate::schur_lm::{Equations, SchurProblem};

/// Unknowns that all views share.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shared {
    pub lens: LensParameters,
    /// Height of the target's middle towards +z of its frame, from bows along x and along y, in millimetres.
    pub warp_mm: [f64; 2],
}

/// The parameters of [`Shared`], lens first.
pub(super) const SHARED: usize = LENS + 2;

impl Shared {
    pub fn flat(lens: impl Into<LensParameters>) -> Self {
        Self { lens: lens.into(), warp_mm: [0.0; 2] }
    }

    /// The parameters, lens first.
    pub fn to_array(self) -> [f64; SHARED] {
        let (lens, [x, y]) = (self.lens.to_array(), self.warp_mm);
        std::array::from_fn(|i| if i < LENS { lens[i] } else { [x, y][i - LENS] })
    }

    /// Distance in pixels between `observation` and its reprojection; NaN where there is none.
    pub fn residual_px(&self, pose: &Isometry3<f64>, observation: &Observation) -> f64 {
        let point = pose * self.on_target(observation);
        let Some(projected) = reprojected(&self.lens, &Point::from_mm(point.coords)) else { return f64::NAN };
        let [du, dv] = [projected.pixel[0] - observation.pixel[0], projected.pixel[1] - observation.pixel[1]];
        (du * du + dv * dv).sqrt()
    }

    /// [`Self::residual_px`] in units of the corner's relative sigma.
    pub fn deviation(&self, pose: &Isometry3<f64>, observation: &Observation) -> f64 {
        self.residual_px(pose, observation) / observation.relative_sigma
    }

    pub fn on_target(&self, observation: &Observation) -> Point3<f64> {
        let [x, y] = observation.target;
        Point3::new(x, y, self.warp_mm[0] * observation.bow[0] + self.warp_mm[1] * observation.bow[1])
    }
}

/// Residual of one corner (reprojection less observation, in pixels) and its derivatives, column by column.
struct Row {
    residual: [f64; 2],
    by_lens: [[f64; 2]; LENS],
    by_warp: [[f64; 2]; SHARED - LENS],
    by_pose: [[f64; 2]; POSE],
}

impl Row {
    #[inline(always)]
    fn of(shared: &Shared, pose: &Isometry3<f64>, observation: &Observation) -> Option<Self> {
        let turned = pose.rotation * shared.on_target(observation).coords;
        let projected = reprojected(&shared.lens, &Point::from_mm(turned + pose.translation.vector))?;
        let [dx, dy, dz] = projected.by_point;
        let along = |d: &Vector3<f64>| [0, 1].map(|row| dx[row] * d.x + dy[row] * d.y + dz[row] * d.z);
        let by_height = along(&(pose.rotation * Vector3::z()));
        // ∂(exp(ω) p)/∂ωᵢ = eᵢ × p.
        let [turn_x, turn_y, turn_z] =
            [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis: Vector3<f64>| along(&axis.cross(&turned)));
        Some(Self {
            residual: [projected.pixel[0] - observation.pixel[0], projected.pixel[1] - observation.pixel[1]],
            by_lens: projected.by_lens,
            by_warp: observation.bow.map(|bow| by_height.map(|d| bow * d)),
            by_pose: [turn_x, turn_y, turn_z, dx, dy, dz],
        })
    }

    /// The derivative by a parameter of [`Shared`].
    fn by_shared(&self, parameter: usize) -> [f64; 2] {
        if parameter < LENS { self.by_lens[parameter] } else { self.by_warp[parameter - LENS] }
    }
}

/// The problem over the used corners of `views`, with only the parameters in `free` (indices into those of the lens, then the warp)
/// adjusted.
pub(super) struct Bundle<'a> {
    pub views: &'a [&'a ObservedView],
    pub free: &'a [usize],
    /// How strongly what is known of lenses before any view counts, see [`super::prior::Prior::strength`].
    pub prior: Option<Strength>,
}

impl<'a> Bundle<'a> {
    /// The problem without a prior.
    pub const fn of(views: &'a [&'a ObservedView], free: &'a [usize]) -> Self {
        Self { views, free, prior: None }
    }
}

impl SchurProblem<POSE> for Bundle<'_> {
    type Shared = Shared;
    type Block = Isometry3<f64>;

    fn shared_dimension(&self) -> usize {
        self.free.len()
    }

    fn block_residuals(&self, shared: &Shared, index: usize, pose: &Isometry3<f64>, equations: &mut Equations<POSE>) {
        let Some(view) = self.views.get(index) else { return };
        let mut columns = [[0.0; 2]; SHARED];
        for observation in view.used() {
            let Some(row) = Row::of(shared, pose, observation) else {
                // No reprojection: the solver rejects a step whose cost is not a number.
                return equations.add(&[f64::NAN; 2], 1.0, &[], &[[0.0; 2]; POSE]);
            };
            for (column, &parameter) in columns.iter_mut().zip(self.free) {
                *column = row.by_shared(parameter);
            }
            equations.add(&row.residual, observation.relative_sigma, &columns[..self.free.len()], &row.by_pose);
        }
    }

    fn shared_residuals(&self, shared: &Shared, equations: &mut Equations<POSE>) {
        let Some(strength) = self.prior else { return };
        let values = shared.to_array();
        let place = |parameter: usize| self.free.iter().position(|&free| free == parameter);
        for (nth, Known { sum, sigma }) in KNOWN.iter().enumerate() {
            let mut columns = vec![[0.0]; self.free.len()];
            let mut off = 0.0;
            for &(parameter, weight) in *sum {
                let Some(column) = place(parameter) else { continue };
                columns[column] = [strength.of(nth) * weight / sigma];
                off += columns[column][0] * values[parameter];
            }
            if sum.first().is_some_and(|&(own, _)| place(own).is_some()) {
                equations.add_plain(&[off], &columns, &[[0.0]; POSE]);
            }
        }
    }

    fn shared_plus(&self, shared: &Shared, step: &[f64]) -> Shared {
        let mut lens = shared.lens.to_array();
        let mut warp_mm = shared.warp_mm;
        for (&parameter, delta) in self.free.iter().zip(step) {
            if let Some(value) = lens.iter_mut().chain(&mut warp_mm).nth(parameter) {
                *value += delta;
            }
        }
        Shared { lens: LensParameters::from_array(lens), warp_mm }
    }

    fn block_plus(&self, pose: &Isometry3<f64>, step: &SVector<f64, POSE>) -> Isometry3<f64> {
        moved(pose, step)
    }
}

#[cfg(test)]
mod tests {
    use num_dual::{Dual64, DualNum};
    use proptest::prelude::*;

    use super::*;

    type Dual3 = [Dual64; 3];

    /// `point` turned by the unit quaternion next to (1, ω/2), which is exp(ω) to first order.
    fn turned(omega: Dual3, point: Dual3) -> Dual3 {
        let [x, y, z] = omega.map(|w| w * 0.5);
        let length = (x * x + y * y + z * z + 1.0).sqrt();
        let (w, v) = (length.recip(), [x / length, y / length, z / length]);
        let cross =
            |a: Dual3, b: Dual3| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let once = cross(v, point);
        let twice = cross(v, once);
        std::array::from_fn(|i| point[i] + (once[i] * w + twice[i]) * 2.0)
    }

    /// The reprojection with its unknowns (lens, warp, turn, shift) as dual numbers.
    fn reprojected(unknowns: [Dual64; SHARED + POSE], pose: &Isometry3<f64>, observation: &Observation) -> [Dual64; 2] {
        let [
            fx,
            fy,
            cx,
            cy,
            k1,
            k2,
            k3,
            k4,
            e0,
            e1,
            p1,
            p2,
            s0,
            s1,
            s2,
            s3,
            k5,
            k6,
            p3,
            p4,
            warp_x,
            warp_y,
            a,
            b,
            c,
            dx,
            dy,
            dz,
        ] = unknowns;
        let height = warp_x * observation.bow[0] + warp_y * observation.bow[1];
        let axes = pose.rotation.to_rotation_matrix().into_inner();
        let flat: Dual3 = std::array::from_fn(|i| {
            height * axes[(i, 2)] + (axes[(i, 0)] * observation.target[0] + axes[(i, 1)] * observation.target[1])
        });
        let [x, y, z] = turned([a, b, c], flat);
        let t = pose.translation.vector;
        let (x, y, z) = (x + dx + t.x, y + dy + t.y, z + dz + t.z);
        let rho = (x * x + y * y).sqrt();
        let mut theta = rho.atan2(z);
        for _ in 0..8 {
            // Newton's steps on ρ cos θ - (z - e) sin θ; near the root the slope's own derivative does not matter.
            let (sine, cosine) = theta.sin_cos();
            let growth = e0 + e1 * theta * theta;
            let slope = (sine - theta * cosine) / (sine * sine) * growth + (theta / sine - 1.0) * e1 * theta * 2.0;
            let e = (theta / sine - 1.0) * growth;
            theta += (rho * cosine - (z - e) * sine) / (rho * sine + (z - e) * cosine - slope * sine);
        }
        let s = theta * theta;
        let scale = theta * ((((((k6 * s + k5) * s + k4) * s + k3) * s + k2) * s + k1) * s + 1.0) / rho;
        let (m, n) = (scale * x, scale * y);
        let square = m * m + n * n;
        let (p1, p2) = (p1 + p3 * square, p2 + p4 * square);
        let along = (m * p1 + n * p2) * 2.0;
        let (u, v) = (s0 + s1 * square + p1, s2 + s3 * square + p2);
        [cx + fx * (m + along * m + u * square), cy + fy * (n + along * n + v * square)]
    }

    proptest! {
        #[test]
        fn every_column_agrees_with_dual_numbers(
            turn in prop::array::uniform3(-2.0..2.0),
            [x, y, z] in prop::array::uniform3(-300.0..300.0_f64),
            target in prop::array::uniform2(-100.0..100.0),
            bow in prop::array::uniform2(0.0..1.0),
            warp_mm in prop::array::uniform2(-3.0..3.0),
            pupil_mm in prop_oneof![Just(0.0), -1.0..3.0],
            [e1, p1, p2, s0, s1, s2, s3] in prop_oneof![Just([0.0; 7]), prop::array::uniform7(-0.01..0.01)],
            [p3, p4] in prop_oneof![Just([0.0; 2]), prop::array::uniform2(-0.01..0.01)],
            [k5, k6] in prop_oneof![Just([0.0; 2]), prop::array::uniform2(-1e-4..1e-4)],
        ) {
            let pose = Isometry3::new(Vector3::new(x, y, z), Vector3::from(turn));
            let observation = Observation { target, bow, pixel: [0.0; 2], relative_sigma: 1.0, index: 0, used: true };
            let central = [300.0, 310.0, 600.0, 500.0, 0.02, -0.01, 0.004, -0.001];
            let [fx, fy, cx, cy, k1, k2, k3, k4] = central;
            let lens = LensParameters::from_array([fx, fy, cx, cy, k1, k2, k3, k4, pupil_mm, 10.0 * e1, p1, p2, s0, s1, s2, s3, k5, k6, p3, p4]);
            let shared = Shared { lens, warp_mm };
            let projected = pose * shared.on_target(&observation);
            // Where the derivatives are not huge: away from the camera and from the direction straight behind it.
            prop_assume!(projected.coords.norm() > 50.0 && projected.x.hypot(projected.y) > 5.0);
            // Where the pupil stays far in front of the point.
            prop_assume!(projected.coords.angle(&Vector3::z()) < 2.0);
            let row = Row::of(&shared, &pose, &observation).unwrap();
            let values = lens.to_array().into_iter().chain(warp_mm).chain([0.0; POSE]);
            let values: Vec<f64> = values.collect();
            let columns = (0..SHARED).map(|parameter| row.by_shared(parameter)).chain(row.by_pose);
            for (index, column) in columns.enumerate() {
                let unknowns = std::array::from_fn(|i| Dual64::new(values[i], if i == index { 1.0 } else { 0.0 }));
                let dual = reprojected(unknowns, &pose, &observation);
                for i in 0..2 {
                    prop_assert!((row.residual[i] - dual[i].re).abs() < 1e-8);
                    let error = (column[i] - dual[i].eps).abs();
                    prop_assert!(error <= 1e-8 * dual[i].eps.abs().max(1.0), "unknown {index}: {column:?}, {dual:?}");
                }
            }
        }
    }
}
