//! Decentring and thin prism in whole arrays: the places of a symmetric lens made those of one that is not ([`Asymmetry`]), and back.

use multiversion::multiversion;
use multiversion::target::target_cfg_f;

use super::lanes::{ALWAYS_FUSED, Kernel, for_rows};
use crate::{Asymmetry, KannalaBrandt};

/// Rows per step.
const LANES: usize = 16;

/// A lens that is not symmetric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Displaced {
    asymmetry: Asymmetry,
    centre: [f64; 2],
    focal_lengths: [f64; 2],
    /// Newton's steps that reach every place of the field.
    steps: usize,
}

impl Displaced {
    /// `None` for a symmetric lens, and where Newton's method takes long.
    pub(super) fn new(lens: &KannalaBrandt) -> Option<Self> {
        let (asymmetry, [f, ..], centre) = (lens.asymmetry(), lens.k(), lens.centre());
        let lanes = Self { asymmetry, centre: [centre.u, centre.v], focal_lengths: [f, f * lens.aspect()], steps: 0 };
        if lens.is_symmetric() {
            return None;
        }
        (2..=6).map(|steps| Self { steps, ..lanes }).find(|lanes| lanes.arrives(lens))
    }

    /// Whether the steps suffice all over the field; they square what is missing, so that the rim needs most.
    fn arrives(&self, lens: &KannalaBrandt) -> bool {
        const RINGS: usize = 16;
        const AROUND: usize = 48;
        const LARGEST_ERROR: f64 = 1e-15;
        let radius = lens.radius_max() / lens.k()[0];
        (0..RINGS * AROUND).all(|place| {
            let ring = radius * (place / AROUND + 1) as f64 / RINGS as f64;
            let (sin, cos) = (std::f64::consts::TAU * (place % AROUND) as f64 / AROUND as f64).sin_cos();
            let m = nalgebra::Vector2::new(ring * cos, ring * sin);
            let moved = self.asymmetry.moved(m);
            let ([x], [y]) = self.back::<false, 1>([moved.x], [moved.y]);
            (x - m.x).hypot(y - m.y) <= 4.0 * LARGEST_ERROR * (1.0 + ring)
        })
    }

    /// Where light arrives that the symmetric lens images at `pixels`.
    pub(super) fn displace(&self, pixels: &mut [[f64; 2]], best: bool) {
        if best {
            displace_best(self, pixels);
        } else {
            displace(self, pixels);
        }
    }

    /// Where the symmetric lens would image the light that arrives at `pixels`.
    pub(super) fn replace(&self, pixels: &[[f64; 2]], best: bool) -> Vec<[f64; 2]> {
        let mut symmetric = Vec::new();
        if best {
            replace_best(self, pixels, &mut symmetric);
        } else {
            for_rows::<ALWAYS_FUSED, LANES, 2, 2>(self, pixels, &mut symmetric);
        }
        symmetric
    }

    /// m by m'.
    #[inline(always)]
    fn back<const FUSED: bool, const W: usize>(&self, x: [f64; W], y: [f64; W]) -> ([f64; W], [f64; W]) {
        let [p1, p2, s0, s1, s2, s3, q1, q2] = self.asymmetry.to_array();
        let (mut a, mut b) = (x, y);
        for _ in 0..self.steps {
            for j in 0..W {
                let (m, n) = (a[j], b[j]);
                let square = m * m + n * n;
                let (p1, p2) = (p1 + q1 * square, p2 + q2 * square);
                let along = 2.0 * (m * p1 + n * p2);
                let (u, v) = (p1 + s0 + s1 * square, p2 + s2 + s3 * square);
                let (off_x, off_y) = (x[j] - (m + along * m + u * square), y[j] - (n + along * n + v * square));
                let lift = 2.0 * (m * q1 + n * q2);
                let (by_u, by_v) = (u + (s1 + q1) * square + lift * m, v + (s3 + q2) * square + lift * n);
                let xx = 1.0 + along + 2.0 * (m * p1 + by_u * m);
                let xy = 2.0 * (m * p2 + by_u * n);
                let yx = 2.0 * (n * p1 + by_v * m);
                let yy = 1.0 + along + 2.0 * (n * p2 + by_v * n);
                let over = 1.0 / (xx * yy - xy * yx);
                a[j] = m + (yy * off_x - xy * off_y) * over;
                b[j] = n + (xx * off_y - yx * off_x) * over;
            }
        }
        (a, b)
    }
}

impl Kernel<2, 2> for Displaced {
    #[inline(always)]
    fn lanes<const FUSED: bool, const W: usize>(&self, [u, v]: [[f64; W]; 2]) -> [[f64; W]; 2] {
        let ([cx, cy], [fx, fy]) = (self.centre, self.focal_lengths);
        let (over_x, over_y) = (1.0 / fx, 1.0 / fy);
        let (mut x, mut y) = ([0.0; W], [0.0; W]);
        for j in 0..W {
            (x[j], y[j]) = ((u[j] - cx) * over_x, (v[j] - cy) * over_y);
        }
        let (mut x, mut y) = self.back::<FUSED, W>(x, y);
        for j in 0..W {
            (x[j], y[j]) = (cx + fx * x[j], cy + fy * y[j]);
        }
        [x, y]
    }
}

#[inline(always)]
fn displace(lens: &Displaced, pixels: &mut [[f64; 2]]) {
    let ([cx, cy], [fx, fy]) = (lens.centre, lens.focal_lengths);
    let [p1, p2, s0, s1, s2, s3, q1, q2] = lens.asymmetry.to_array();
    let (over_x, over_y) = (1.0 / fx, 1.0 / fy);
    for [u, v] in pixels {
        let (m, n) = ((*u - cx) * over_x, (*v - cy) * over_y);
        let square = m * m + n * n;
        let (p1, p2) = (p1 + q1 * square, p2 + q2 * square);
        let along = 2.0 * (m * p1 + n * p2);
        *u = cx + fx * (m + along * m + (p1 + s0 + s1 * square) * square);
        *v = cy + fy * (n + along * n + (p2 + s2 + s3 * square) * square);
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
fn displace_best(lens: &Displaced, pixels: &mut [[f64; 2]]) {
    displace(lens, pixels);
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2+fma", "x86_64+avx2+fma"))]
fn replace_best(lens: &Displaced, pixels: &[[f64; 2]], symmetric: &mut Vec<[f64; 2]>) {
    if target_cfg_f!(target_feature = "fma") {
        for_rows::<true, LANES, 2, 2>(lens, pixels, symmetric);
    } else {
        for_rows::<ALWAYS_FUSED, LANES, 2, 2>(lens, pixels, symmetric);
    }
}
