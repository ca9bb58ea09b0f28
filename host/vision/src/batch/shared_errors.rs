//! What errors of lenses, pose and pixels do to points, for every lane.
//!
//! With φ the relative errors of the focal lengths, c those of the centre, κᵢ = f δkᵢ, and v divided by the lens's aspect, a wrong lens
//! moves the pixel of a ray by
//!
//! ```text
//! du = θ cos φ · (r/θ φu + ρ) + cu      dv = θ sin φ · (r/θ φv + ρ) + cv      ρ = κ₁ θ² + κ₂ θ⁴ + κ₃ θ⁶ + κ₄ θ⁸
//! ```
//!
//! The factors of θ cos φ and θ sin φ are polynomials in θ². So are their variances and covariances, whose coefficients are
//! summed once. The pixel's own noise adds to the variances of the centre.

use nalgebra::SMatrix;

use super::lanes::{multiply_add, polynomial};
use super::slope::{InImage, View};
use crate::lens_derivatives::{CENTRAL_PARAMETERS, LENS_PARAMETERS};
use crate::{KannalaBrandt, SHARED_PARAMETERS, SharedCovariance};

/// Number of parameters of the pose.
pub(super) const POSE_PARAMETERS: usize = 6;
/// The first parameter of the right lens, and of the pose.
const RIGHT: usize = LENS_PARAMETERS;
const POSE: usize = 2 * LENS_PARAMETERS;
/// Coefficients of r/θ in θ².
const TERMS: usize = 5;

/// Covariances of one number with the parameters of a lens.
type WithLens = [f64; CENTRAL_PARAMETERS];
/// The derivatives of one number by the pose, for each lane.
pub(super) type ByPose<const W: usize> = [[f64; W]; POSE_PARAMETERS];

/// The covariance of all that a pair shares, in the parameters above, and of the noise of its pixels.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SharedErrors {
    lenses: [LensErrors; 2],
    /// For each parameter of the right lens, the covariances with the left one.
    left_with_right: [WithLens; CENTRAL_PARAMETERS],
    /// For each parameter of the pose, the covariances with the left lens and with the right one.
    lenses_with_pose: [[WithLens; 2]; POSE_PARAMETERS],
    pose: [[f64; POSE_PARAMETERS]; POSE_PARAMETERS],
}

/// The covariance of pixels of one camera, as polynomials in θ².
#[derive(Clone, Debug, PartialEq)]
struct LensErrors {
    /// Of the factors of θ cos φ and θ sin φ: variance of the first, covariance, variance of the second.
    factors: [[f64; 2 * TERMS - 1]; 3],
    /// Of the first factor with the coordinates of the centre, then of the second. Those which occur twice are doubled.
    with_centre: [[f64; TERMS]; 4],
    /// Of the centre and the pixel's noise: variance of u, covariance, variance of v.
    centre: [f64; 3],
}

impl SharedErrors {
    pub(super) fn new(lenses: [&KannalaBrandt; 2], pixel_variance: f64, shared: &SharedCovariance) -> Self {
        let mut scales = [1.0; SHARED_PARAMETERS];
        for (lens, first) in lenses.into_iter().zip([0, RIGHT]) {
            let (f, aspect) = (lens.k()[0], lens.aspect());
            // At a fixed pixel the ray turns the other way than the pixel of a fixed ray moves: hence the sign.
            let lens = [1.0 / f, 1.0 / (f * aspect), 1.0, 1.0 / aspect, f, f, f, f].map(|scale| -scale);
            scales[first..][..CENTRAL_PARAMETERS].copy_from_slice(&lens);
        }
        let covariance = |row: usize, column: usize| scales[row] * shared.matrix()[(row, column)] * scales[column];
        let with_lens = |first: usize, column: usize| std::array::from_fn(|i| covariance(first + i, column));
        let own = |lens: &KannalaBrandt, first: usize| {
            let noise = [pixel_variance, pixel_variance / (lens.aspect() * lens.aspect())];
            LensErrors::new(&lens.k(), &SMatrix::from_fn(|i, k| covariance(first + i, first + k)), noise)
        };
        Self {
            lenses: [own(lenses[0], 0), own(lenses[1], RIGHT)],
            left_with_right: std::array::from_fn(|k| with_lens(0, RIGHT + k)),
            lenses_with_pose: std::array::from_fn(|k| [with_lens(0, POSE + k), with_lens(RIGHT, POSE + k)]),
            pose: std::array::from_fn(|i| std::array::from_fn(|k| covariance(POSE + i, POSE + k))),
        }
    }

    /// The covariance of three movements of a point, as upper triangle by rows. The first is by the left pixel, the second by the
    /// right pixel and the pose, the third by all: `left` and `right` hold the movements per pixel, `pose` those of the second and third.
    #[inline(always)]
    pub(super) fn moved<const FUSED: bool, const W: usize>(
        &self,
        left: &View<W>,
        right: &View<W>,
        pose: &[ByPose<W>; 2],
    ) -> [[f64; W]; 6] {
        let ([by_left, all_left], [by_right, all_right]) = (&left.turns, &right.turns);
        let (noise_left, noise_right) = (self.lenses[0].of::<FUSED, W>(left), self.lenses[1].of::<FUSED, W>(right));
        // The covariance of a pixel with the second and with the third movement.
        let (mut left_with, mut right_with) = (self.left_with_right::<FUSED, W>(left, right), [[[0.0; W]; 2]; 2]);
        for (k, [with_left, with_right]) in self.lenses_with_pose.iter().enumerate() {
            let left_shift = shift::<FUSED, W>(left, &spread(with_left));
            let right_shift = shift::<FUSED, W>(right, &spread(with_right));
            for (row, by_pose) in pose.iter().enumerate() {
                add_scaled::<FUSED, W>(&mut left_with[row], &left_shift, &by_pose[k]);
                add_scaled::<FUSED, W>(&mut right_with[row], &right_shift, &by_pose[k]);
            }
        }
        let [mut uu, mut un, mut nn] = self.by_pose::<FUSED, W>(pose);
        let (mut vv, mut vu, mut vn) = ([0.0; W], [0.0; W], [0.0; W]);
        let left_own = through::<FUSED, W>(&noise_left, by_left);
        add_dot::<FUSED, W>(&mut vv, by_left, &left_own);
        add_dot::<FUSED, W>(&mut vn, all_left, &left_own);
        add_dot::<FUSED, W>(&mut nn, all_left, &through::<FUSED, W>(&noise_left, all_left));
        add_dot::<FUSED, W>(&mut vu, by_left, &left_with[0]);
        add_dot::<FUSED, W>(&mut vn, by_left, &left_with[1]);
        add_dot::<FUSED, W>(&mut un, all_left, &left_with[0]);
        add_dot::<FUSED, W>(&mut nn, all_left, &twice(&left_with[1]));
        let right_own = through::<FUSED, W>(&noise_right, by_right);
        add_dot::<FUSED, W>(&mut uu, by_right, &right_own);
        add_dot::<FUSED, W>(&mut un, all_right, &right_own);
        add_dot::<FUSED, W>(&mut nn, all_right, &through::<FUSED, W>(&noise_right, all_right));
        add_dot::<FUSED, W>(&mut uu, by_right, &twice(&right_with[0]));
        add_dot::<FUSED, W>(&mut un, all_right, &right_with[0]);
        add_dot::<FUSED, W>(&mut un, by_right, &right_with[1]);
        add_dot::<FUSED, W>(&mut nn, all_right, &twice(&right_with[1]));
        [vv, vu, vn, uu, un, nn]
    }

    /// The covariance of the left pixel with each of both movements by the right pixel, as far as the lenses are correlated.
    #[inline(always)]
    fn left_with_right<const FUSED: bool, const W: usize>(&self, left: &View<W>, right: &View<W>) -> [InImage<W>; 2] {
        let mut with_lens = [[[0.0; W]; CENTRAL_PARAMETERS]; 2];
        for (k, covariances) in self.left_with_right.iter().enumerate() {
            [with_lens[0][k], with_lens[1][k]] = shift::<FUSED, W>(left, &spread(covariances));
        }
        let mut out = [[[0.0; W]; 2]; 2];
        for (axis, with_lens) in with_lens.iter().enumerate() {
            let shifted = shift::<FUSED, W>(right, with_lens);
            for (out, by_right) in out.iter_mut().zip(&right.turns) {
                add_dot::<FUSED, W>(&mut out[axis], &shifted, by_right);
            }
        }
        out
    }

    /// The covariance of two movements by the pose: variance of the first, covariance, variance of the second.
    #[inline(always)]
    fn by_pose<const FUSED: bool, const W: usize>(&self, [first, second]: &[ByPose<W>; 2]) -> [[f64; W]; 3] {
        let mut out = [[0.0; W]; 3];
        for (i, covariances) in self.pose.iter().enumerate() {
            let (mut with_first, mut with_second) = ([0.0; W], [0.0; W]);
            for (k, covariance) in covariances.iter().enumerate() {
                add_product::<FUSED, W>(&mut with_first, &[*covariance; W], &first[k]);
                add_product::<FUSED, W>(&mut with_second, &[*covariance; W], &second[k]);
            }
            add_product::<FUSED, W>(&mut out[0], &with_first, &first[i]);
            add_product::<FUSED, W>(&mut out[1], &with_first, &second[i]);
            add_product::<FUSED, W>(&mut out[2], &with_second, &second[i]);
        }
        out
    }
}

impl LensErrors {
    fn new(
        k: &[f64; TERMS],
        covariance: &SMatrix<f64, CENTRAL_PARAMETERS, CENTRAL_PARAMETERS>,
        [noise_u, noise_v]: [f64; 2],
    ) -> Self {
        // Row i holds the coefficient of θ²ⁱ in the factor of θ cos φ or θ sin φ, by the parameters.
        let factor = |focal: usize| {
            SMatrix::<f64, TERMS, CENTRAL_PARAMETERS>::from_fn(|i, parameter| {
                let distortion = if i > 0 && parameter == 3 + i { 1.0 } else { 0.0 };
                if parameter == focal { k[i] } else { distortion }
            })
        };
        let both = [factor(0), factor(1)];
        let factors = [[0, 0], [0, 1], [1, 1]].map(|[a, b]: [usize; 2]| {
            let product = both[a] * covariance * both[b].transpose();
            let mut sums = [0.0; 2 * TERMS - 1];
            for (i, k) in (0..TERMS).flat_map(|i| (0..TERMS).map(move |k| (i, k))) {
                sums[i + k] += product[(i, k)];
            }
            sums
        });
        let with_centre = [(0, 2, 2.0), (0, 3, 1.0), (1, 2, 1.0), (1, 3, 2.0)]
            .map(|(a, centre, times): (usize, usize, f64)| (both[a] * covariance.column(centre) * times).into());
        let centre = [covariance[(2, 2)] + noise_u, covariance[(2, 3)], covariance[(3, 3)] + noise_v];
        Self { factors, with_centre, centre }
    }

    /// The covariance of the pixel: variance of u, covariance, variance of v.
    #[inline(always)]
    fn of<const FUSED: bool, const W: usize>(&self, view: &View<W>) -> [[f64; W]; 3] {
        let View { place: [x, y], squared, .. } = view;
        let [factor_uu, factor_uv, factor_vv] = &self.factors;
        let [u_with_u, u_with_v, v_with_u, v_with_v] = &self.with_centre;
        let [mut uu, mut uv, mut vv] = [[0.0; W]; 3];
        let (squares, once) = (polynomial::<FUSED, W>(factor_uu, squared), polynomial::<FUSED, W>(u_with_u, squared));
        for j in 0..W {
            uu[j] = multiply_add::<FUSED>(x[j], multiply_add::<FUSED>(x[j], squares[j], once[j]), self.centre[0]);
        }
        let (squares, once) = (polynomial::<FUSED, W>(factor_vv, squared), polynomial::<FUSED, W>(v_with_v, squared));
        for j in 0..W {
            vv[j] = multiply_add::<FUSED>(y[j], multiply_add::<FUSED>(y[j], squares[j], once[j]), self.centre[2]);
        }
        let products = polynomial::<FUSED, W>(factor_uv, squared);
        let (along_u, along_v) = (polynomial::<FUSED, W>(u_with_v, squared), polynomial::<FUSED, W>(v_with_u, squared));
        for j in 0..W {
            let rest = multiply_add::<FUSED>(y[j], along_v[j], self.centre[1]);
            uv[j] = multiply_add::<FUSED>(x[j], multiply_add::<FUSED>(y[j], products[j], along_u[j]), rest);
        }
        [uu, uv, vv]
    }
}

/// The shift of the pixel by errors of the lens, by the formulas above.
#[inline(always)]
fn shift<const FUSED: bool, const W: usize>(
    View { place: [x, y], squared, growth, .. }: &View<W>,
    [focal_u, focal_v, centre_u, centre_v, k1, k2, k3, k4]: &[[f64; W]; CENTRAL_PARAMETERS],
) -> InImage<W> {
    let mut out = [[0.0; W]; 2];
    for j in 0..W {
        let inner = multiply_add::<FUSED>(squared[j], multiply_add::<FUSED>(squared[j], k4[j], k3[j]), k2[j]);
        let rho = squared[j] * multiply_add::<FUSED>(squared[j], inner, k1[j]);
        let (along_u, along_v) =
            (multiply_add::<FUSED>(growth[j], focal_u[j], rho), multiply_add::<FUSED>(growth[j], focal_v[j], rho));
        out[0][j] = multiply_add::<FUSED>(x[j], along_u, centre_u[j]);
        out[1][j] = multiply_add::<FUSED>(y[j], along_v, centre_v[j]);
    }
    out
}

/// The same numbers in all lanes.
#[inline(always)]
fn spread<const W: usize>(numbers: &WithLens) -> [[f64; W]; CENTRAL_PARAMETERS] {
    let mut out = [[0.0; W]; CENTRAL_PARAMETERS];
    for (out, number) in out.iter_mut().zip(numbers) {
        *out = [*number; W];
    }
    out
}

/// A covariance (variance of u, covariance, variance of v) times a vector.
#[inline(always)]
fn through<const FUSED: bool, const W: usize>([uu, uv, vv]: &[[f64; W]; 3], [u, v]: &InImage<W>) -> InImage<W> {
    let mut out = [[0.0; W]; 2];
    for j in 0..W {
        out[0][j] = multiply_add::<FUSED>(uu[j], u[j], uv[j] * v[j]);
        out[1][j] = multiply_add::<FUSED>(uv[j], u[j], vv[j] * v[j]);
    }
    out
}

#[inline(always)]
fn twice<const W: usize>(vector: &InImage<W>) -> InImage<W> {
    let mut out = *vector;
    out.iter_mut().flatten().for_each(|value| *value *= 2.0);
    out
}

#[inline(always)]
fn add_dot<const FUSED: bool, const W: usize>(sum: &mut [f64; W], a: &InImage<W>, b: &InImage<W>) {
    for (a, b) in a.iter().zip(b) {
        add_product::<FUSED, W>(sum, a, b);
    }
}

#[inline(always)]
fn add_scaled<const FUSED: bool, const W: usize>(sum: &mut InImage<W>, vector: &InImage<W>, factor: &[f64; W]) {
    for (sum, component) in sum.iter_mut().zip(vector) {
        add_product::<FUSED, W>(sum, component, factor);
    }
}

#[inline(always)]
fn add_product<const FUSED: bool, const W: usize>(sum: &mut [f64; W], a: &[f64; W], b: &[f64; W]) {
    for j in 0..W {
        sum[j] = multiply_add::<FUSED>(a[j], b[j], sum[j]);
    }
}
