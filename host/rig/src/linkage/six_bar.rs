//! The planar six-bar that the trunk is while both folds are flat, in closed form.
//!
//! Corners A to F go round: A, B, C on the left from front to rear, D, E, F on the right from rear to front. Angles are interior.

use std::f64::consts::{PI, TAU};

use nalgebra::{Rotation2, Vector2};

/// Lengths of the links of a planar six-bar, in millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SixBar {
    /// Links AB, BC, DE and EF.
    pub side: f64,
    /// Links CD and FA.
    pub end: f64,
}

/// Interior angles of the corners A to F in radians, from 0 to a whole turn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corners(pub [f64; 6]);

/// Why there is no six-bar with these angles.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SixBarError {
    /// Corners D and F are farther apart than both links between them reach.
    #[error("corners D and F are {apart_mm:.3} mm apart, and the links between them reach {reach_mm:.3} mm")]
    TooFar {
        /// Distance of D and F in millimetres.
        apart_mm: f64,
        /// Reach of both links in millimetres.
        reach_mm: f64,
    },
    /// Corners D and F coincide: E may lie anywhere on a circle.
    #[error("corners D and F coincide, so that corner E may lie anywhere around them")]
    Undetermined,
}

impl SixBar {
    /// All shapes with these interior angles of A, B and C, in radians: corner E outward, and inward; once where D, E and F are in
    /// line.
    ///
    /// # Errors
    /// [`SixBarError`] where there is none, or one for every place of E.
    pub fn shapes(&self, driven: [f64; 3]) -> Result<Vec<Corners>, SixBarError> {
        let half = HalfLoop::of(self, driven);
        let (apart, reach) = (half.apart(), 2.0 * self.side);
        // What rounding leaves of links in line.
        let rounding = 1e-12 * reach;
        if apart > reach + rounding {
            return Err(SixBarError::TooFar { apart_mm: apart, reach_mm: reach });
        }
        if apart <= rounding {
            return Err(SixBarError::Undetermined);
        }
        let height = self.height(apart);
        let heights = if apart >= reach - rounding { vec![0.0] } else { vec![-height, height] };
        Ok(heights.into_iter().map(|height| half.closed_by(height)).collect())
    }

    /// The shape with corner E outward; where corners D and F are farther apart than both links between them reach, as by noise at a
    /// dead centre, that with D, E and F in line.
    #[must_use]
    pub fn outward_or_straight(&self, driven: [f64; 3]) -> Corners {
        let half = HalfLoop::of(self, driven);
        half.closed_by(-self.height(half.apart()))
    }

    /// By how much the square of the distance of corners D and F, with A, B and C at these interior angles in radians, is more than that
    /// which the links between them reach, in square millimetres: zero at the dead centre, and smooth there.
    pub(crate) fn beyond_reach(&self, driven: [f64; 3]) -> f64 {
        HalfLoop::of(self, driven).apart().powi(2) - (2.0 * self.side).powi(2)
    }

    /// Distance of corner E from the line through D and F, which are `apart`.
    fn height(&self, apart: f64) -> f64 {
        (self.side.powi(2) - (apart / 2.0).powi(2)).max(0.0).sqrt()
    }
}

/// The links from corner D over C, B and A to F, which the driven corners place.
struct HalfLoop {
    driven: [f64; 3],
    d: Vector2<f64>,
    f: Vector2<f64>,
    /// Direction of link FA.
    fa: f64,
}

impl HalfLoop {
    fn of(links: &SixBar, driven: [f64; 3]) -> Self {
        let [a, b, c] = driven;
        // Directions of the links, going round; CD lies along x, and the inside is to the left of each link.
        let bc = c - PI;
        let ab = bc - (PI - b);
        let fa = ab - (PI - a);
        let d = Vector2::new(links.end, 0.0);
        let f = -links.side * (direction(bc) + direction(ab)) - links.end * direction(fa);
        Self { driven, d, f, fa }
    }

    fn apart(&self) -> f64 {
        (self.f - self.d).norm()
    }

    /// The shape with corner E at `height` to the left of the line from D to F.
    fn closed_by(&self, height: f64) -> Corners {
        let way = self.f - self.d;
        let beside = Rotation2::new(PI / 2.0) * way.try_normalize(0.0).unwrap_or_else(Vector2::x);
        let e = (self.d + self.f) / 2.0 + beside * height;
        let (de, ef) = (heading(e - self.d), heading(self.f - e));
        let interior = |turn: f64| (PI - turn).rem_euclid(TAU);
        let [a, b, c] = self.driven.map(|angle| angle.rem_euclid(TAU));
        Corners([a, b, c, interior(de), interior(ef - de), interior(self.fa - ef)])
    }
}

fn direction(angle: f64) -> Vector2<f64> {
    Vector2::new(angle.cos(), angle.sin())
}

fn heading(way: Vector2<f64>) -> f64 {
    way.y.atan2(way.x)
}

impl Corners {
    /// The shape of `shapes` that is nearest to this one, by the largest difference of an angle: the branch of a linkage that moves
    /// continuously. `None` where there is none.
    #[must_use]
    pub fn nearest(&self, shapes: &[Self]) -> Option<Self> {
        let apart = |other: &Self| {
            let differences =
                self.0.iter().zip(other.0).map(|(one, other)| ((one - other + PI).rem_euclid(TAU) - PI).abs());
            differences.fold(0.0, f64::max)
        };
        shapes.iter().copied().min_by(|one, other| apart(one).total_cmp(&apart(other)))
    }
}
