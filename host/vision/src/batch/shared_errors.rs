//! What errors of lenses, pose and pixels do to a point.
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

use super::lanes::{multiply_add, polynomial_at};
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
/// The derivatives of one number by the pose.
pub(super) type ByPose = [f64; POSE_PARAMETERS];

/// The covariance of all that a pair shares, in the parameters above, and of the noise of its pixels.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SharedErrors {
    lenses: [LensErrors; 2],
    /// For each parameter of the right lens, the covariances with the left one.
    left_with_right: [WithLens; CENTRAL_PARAMETERS],
    /// Of the left and of the right lens, for each parameter of the pose, the covariances with it.
    lenses_with_pose: [[WithLens; POSE_PARAMETERS]; 2],
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
            lenses_with_pose: [0, RIGHT].map(|first| std::array::from_fn(|k| with_lens(first, POSE + k))),
            pose: std::array::from_fn(|i| std::array::from_fn(|k| covariance(POSE + i, POSE + k))),
        }
    }

    /// The covariance of three movements of a point, as upper triangle by rows. The first is by the left pixel, the second by the
    /// right pixel and the pose, the third by all: `left` and `right` hold the movements per pixel, `pose` those of the second and third.
    #[inline(always)]
    pub(super) fn moved<const FUSED: bool>(&self, left: &View, right: &View, pose: &[ByPose; 2]) -> [f64; 6] {
        let ([by_left, all_left], [by_right, all_right]) = (&left.turns, &right.turns);
        let (noise_left, noise_right) = (self.lenses[0].of::<FUSED>(left), self.lenses[1].of::<FUSED>(right));
        // The covariance of a pixel with the second and with the third movement.
        let (mut left_with, mut right_with) = (self.left_with_right::<FUSED>(left, right), [[0.0; 2]; 2]);
        add_with_pose::<FUSED>(&mut left_with, left, &self.lenses_with_pose[0], pose);
        add_with_pose::<FUSED>(&mut right_with, right, &self.lenses_with_pose[1], pose);
        let dot = dot::<FUSED>;
        let [pose_uu, pose_un, pose_nn] = self.by_pose::<FUSED>(pose);
        let left_own = through::<FUSED>(&noise_left, by_left);
        let left_all = sum(&through::<FUSED>(&noise_left, all_left), &twice(&left_with[1]));
        let right_own = sum(&through::<FUSED>(&noise_right, by_right), &twice(&right_with[0]));
        let right_all = sum(&through::<FUSED>(&noise_right, all_right), &twice(&right_with[1]));
        let right_both = sum(&through::<FUSED>(&noise_right, by_right), &right_with[0]);
        let vv = dot(by_left, &left_own, 0.0);
        let vu = dot(by_left, &left_with[0], 0.0);
        let vn = dot(all_left, &left_own, dot(by_left, &left_with[1], 0.0));
        let uu = dot(by_right, &right_own, pose_uu);
        let un = dot(all_left, &left_with[0], dot(all_right, &right_both, dot(by_right, &right_with[1], pose_un)));
        let nn = dot(all_left, &left_all, dot(all_right, &right_all, pose_nn));
        [vv, vu, vn, uu, un, nn]
    }

    /// The covariance of the left pixel with each of both movements by the right pixel, as far as the lenses are correlated.
    #[inline(always)]
    fn left_with_right<const FUSED: bool>(&self, left: &View, right: &View) -> [InImage; 2] {
        let mut with_lens = [[0.0; CENTRAL_PARAMETERS]; 2];
        for (k, covariances) in self.left_with_right.iter().enumerate() {
            [with_lens[0][k], with_lens[1][k]] = shift::<FUSED>(left, covariances);
        }
        let [of_u, of_v] = with_lens.map(|with_lens| shift::<FUSED>(right, &with_lens));
        right.turns.map(|by_right| [dot::<FUSED>(&of_u, &by_right, 0.0), dot::<FUSED>(&of_v, &by_right, 0.0)])
    }

    /// The covariance of two movements by the pose: variance of the first, covariance, variance of the second.
    #[inline(always)]
    fn by_pose<const FUSED: bool>(&self, [first, second]: &[ByPose; 2]) -> [f64; 3] {
        let (with_first, with_second) = (self.with_pose::<FUSED>(first), self.with_pose::<FUSED>(second));
        let dot = product::<FUSED, POSE_PARAMETERS>;
        [dot(&with_first, first), dot(&with_first, second), dot(&with_second, second)]
    }

    /// The covariances of the pose's parameters with one movement by the pose.
    #[inline(always)]
    fn with_pose<const FUSED: bool>(&self, movement: &ByPose) -> ByPose {
        let [a, b, c, d, e, f] = &self.pose;
        let dot = product::<FUSED, POSE_PARAMETERS>;
        [dot(a, movement), dot(b, movement), dot(c, movement), dot(d, movement), dot(e, movement), dot(f, movement)]
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
    fn of<const FUSED: bool>(&self, &View { place: [x, y], squared, .. }: &View) -> [f64; 3] {
        let (fused, at) = (multiply_add::<FUSED>, |terms: &[f64]| polynomial_at::<FUSED>(terms, squared));
        let [squares_u, products, squares_v] = &self.factors;
        let [u_with_u, u_with_v, v_with_u, v_with_v] = &self.with_centre;
        let [centre_uu, centre_uv, centre_vv] = self.centre;
        let uu = fused(x, fused(x, at(squares_u), at(u_with_u)), centre_uu);
        let vv = fused(y, fused(y, at(squares_v), at(v_with_v)), centre_vv);
        let rest = fused(y, at(v_with_u), centre_uv);
        [uu, fused(x, fused(y, at(products), at(u_with_v)), rest), vv]
    }
}

/// The shift of the pixel by errors of the lens, by the formulas above.
#[inline(always)]
fn shift<const FUSED: bool>(
    &View { place: [x, y], squared, growth, .. }: &View,
    &[focal_u, focal_v, centre_u, centre_v, k1, k2, k3, k4]: &WithLens,
) -> InImage {
    let fused = multiply_add::<FUSED>;
    let rho = squared * fused(squared, fused(squared, fused(squared, k4, k3), k2), k1);
    [fused(x, fused(growth, focal_u, rho), centre_u), fused(y, fused(growth, focal_v, rho), centre_v)]
}

/// A covariance (variance of u, covariance, variance of v) times a vector.
#[inline(always)]
fn through<const FUSED: bool>(&[uu, uv, vv]: &[f64; 3], &[u, v]: &InImage) -> InImage {
    [multiply_add::<FUSED>(uu, u, uv * v), multiply_add::<FUSED>(uv, u, vv * v)]
}

#[inline(always)]
fn twice(vector: &InImage) -> InImage {
    vector.map(|value| 2.0 * value)
}

#[inline(always)]
fn sum(a: &InImage, b: &InImage) -> InImage {
    [a[0] + b[0], a[1] + b[1]]
}

/// Returns a · b + `rest`.
#[inline(always)]
fn dot<const FUSED: bool>(a: &InImage, b: &InImage, rest: f64) -> f64 {
    multiply_add::<FUSED>(a[0], b[0], multiply_add::<FUSED>(a[1], b[1], rest))
}

#[inline(always)]
fn product<const FUSED: bool, const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    let mut sum = 0.0;
    for k in 0..N {
        sum = multiply_add::<FUSED>(a[k], b[k], sum);
    }
    sum
}

/// Adds to `with` the covariance of a pixel with each of two movements by the pose.
#[inline(always)]
fn add_with_pose<const FUSED: bool>(
    [with_first, with_second]: &mut [InImage; 2],
    view: &View,
    covariances: &[WithLens; POSE_PARAMETERS],
    [first, second]: &[ByPose; 2],
) {
    for (k, covariances) in covariances.iter().enumerate() {
        let [u, v] = shift::<FUSED>(view, covariances);
        *with_first =
            [multiply_add::<FUSED>(u, first[k], with_first[0]), multiply_add::<FUSED>(v, first[k], with_first[1])];
        *with_second =
            [multiply_add::<FUSED>(u, second[k], with_second[0]), multiply_add::<FUSED>(v, second[k], with_second[1])];
    }
}
