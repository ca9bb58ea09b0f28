//! Error of measured distances from the uncertainty of the relative pose.
//!
//! A point P = λ f is seen by the left ray f and the right ray d from the right centre t, P = t + μ d. When the right
//! camera turns by ω and shifts by δ, the point moves along the left ray by
//!
//! ```text
//! dλ = q · (δ + μ ω × d) / (q · f)        q in the epipolar plane and orthogonal to d
//! ```

use nalgebra::{Matrix6, Vector3, Vector6};
use vergence_page::{Anchor, Axes, Drawing, Path};
use vergence_vision::{KannalaBrandt, Left, Right, Transform, UnitRay};

use crate::image_frame::WIDTH;

/// Two cameras and the covariance of their relative pose.
pub(crate) struct UncertainPair<'a> {
    pub left: &'a KannalaBrandt,
    pub right: &'a KannalaBrandt,
    pub left_from_right: Transform<Left, Right>,
    /// In local coordinates `[ω, δ]`, radians and millimetres about the left axes.
    pub covariance: Matrix6<f64>,
}

/// Depth error over directions in the plane of the baseline and the direction straight ahead.
pub(crate) struct DepthError {
    /// Directions in degrees from straight ahead, positive to the right camera's side, and standard deviations in
    /// millimetres. Only directions that both cameras see.
    curve: Vec<(f64, f64)>,
    /// Range that the curve holds for, in millimetres.
    range_mm: f64,
}

impl DepthError {
    pub fn of(pair: &UncertainPair<'_>, range_mm: f64) -> Self {
        const WIDEST_DEG: i32 = 85;
        let right_centre = pair.left_from_right.origin().mm();
        let along = right_centre.try_normalize(0.0);
        let ahead = along.and_then(|along| straight_ahead(pair, &along));
        let error = |degrees: i32| {
            let (ahead, along) = (ahead?, along?);
            let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
            let point = 0.5 * right_centre + range_mm * (cos * ahead + sin * along);
            Some((f64::from(degrees), sigma_mm(pair, &point)?))
        };
        Self { curve: (-WIDEST_DEG..=WIDEST_DEG).filter_map(error).collect(), range_mm }
    }

    /// Direction (degrees) nearest to straight ahead, and its error (mm).
    pub fn ahead(&self) -> Option<(f64, f64)> {
        self.curve.iter().copied().min_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))
    }

    /// Direction (degrees) and size (mm) of the largest error within `half_angle_deg` of straight ahead.
    pub fn worst_within(&self, half_angle_deg: f64) -> Option<(f64, f64)> {
        let within = self.curve.iter().copied().filter(|(degrees, _)| degrees.abs() <= half_angle_deg);
        within.max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The upper end of the vertical axis that shows the curve, in millimetres: the error grows without bound towards
    /// the baseline, where it is cut off.
    pub fn high(&self) -> f64 {
        /// The axis ends at this multiple of the smallest error.
        const HIGHEST: f64 = 12.0;
        let least = self.curve.iter().map(|(_, sigma)| *sigma).fold(f64::INFINITY, f64::min);
        let most = self.curve.iter().map(|(_, sigma)| *sigma).fold(0.0, f64::max);
        if least.is_finite() { (1.1 * most).min(HIGHEST * least).max(1e-9) } else { 1.0 }
    }

    /// The curve over directions; the vertical axis ends at `high` millimetres.
    pub fn draw(&self, high: f64) -> Drawing {
        const HEIGHT: f64 = 360.0;
        let mut drawing = Drawing::new(WIDTH, HEIGHT);
        let axes = Axes::filling(&drawing, [-90.0, 90.0], [0.0, high]);
        drawing.rect(axes.corner(), axes.extent(), "sensor", "");
        let range = vergence_page::significant(self.range_mm, 3);
        axes.draw(&mut drawing, "direction from straight ahead (°)", &format!("± of the distance at {range} mm (mm)"));
        let points: Vec<_> = self.curve.iter().map(|(degrees, sigma)| axes.at(*degrees, *sigma)).collect();
        drawing.clipped(axes.corner(), axes.extent(), |drawing| {
            // Directions that one camera does not see interrupt the line.
            let step = axes.extent()[0] / 180.0;
            for part in points.chunk_by(|a, b| b[0] - a[0] < 1.5 * step) {
                drawing.path(&Path::through(part), "run", "");
            }
        });
        let [x, y] = axes.corner();
        drawing.text([x + 8.0, y + 16.0], Anchor::Start, "halo", "left");
        drawing.text([x + axes.extent()[0] - 8.0, y + 16.0], Anchor::End, "halo", "right");
        drawing
    }
}

/// The direction between the optical axes, made orthogonal to the baseline; in the left frame.
fn straight_ahead(pair: &UncertainPair<'_>, along: &Vector3<f64>) -> Option<Vector3<f64>> {
    let right_axis = pair.left_from_right.rotation() * Vector3::z();
    let between = Vector3::z() + right_axis;
    (between - along * along.dot(&between)).try_normalize(1e-6)
}

/// Standard deviation of the distance of `point`; `None` if a camera does not see it, or sees it along the baseline.
fn sigma_mm(pair: &UncertainPair<'_>, point: &Vector3<f64>) -> Option<f64> {
    let pose = pair.left_from_right;
    let left = UnitRay::<Left>::new(*point)?;
    let arm = point - pose.origin().mm();
    let right = UnitRay::<Left>::new(arm)?;
    pair.left.project(&left).ok().filter(|pixel| pair.left.on_sensor(*pixel))?;
    let seen = pair.right.project(&(pose.inverse() * right)).ok();
    seen.filter(|pixel| pair.right.on_sensor(*pixel))?;

    let (f, d) = (left.vector(), right.vector());
    let across = d.cross(&f.cross(&d).try_normalize(1e-9)?);
    let gain = across.dot(&f);
    let by_turn = d.cross(&across) * (arm.norm() / gain);
    let by_shift = across / gain;
    let by_move = Vector6::new(by_turn.x, by_turn.y, by_turn.z, by_shift.x, by_shift.y, by_shift.z);
    let variance = by_move.dot(&(pair.covariance * by_move));
    variance.is_finite().then(|| variance.max(0.0).sqrt())
}
