//! Error of measured points: from lenses, relative pose, encoders and matched pixels together.

use nalgebra::{Matrix3, Vector3};
use vergence_page::{Anchor, Axes, Drawing, Path};
use vergence_rig::{Rig, RigPose};
use vergence_vision::{Left, Point, PointUncertainty, Right, SharedCovariance, StereoPair};

use crate::image_frame::WIDTH;

/// Two cameras, the covariance that all their points share, and the standard deviation of matched pixels.
pub(crate) struct UncertainPair<'a> {
    cameras: StereoPair<'a>,
    shared: SharedCovariance,
    pixel_sigma: f64,
}

/// Standard deviations of a point in millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PointError {
    /// Along the line of sight from the middle of the baseline.
    pub along: f64,
    /// Across it, in the worse direction.
    pub across: f64,
}

impl<'a> UncertainPair<'a> {
    /// The cameras of `rig` in `pose`, with the lenses, pose and encoders as uncertain as the rig's file states, and matches good to
    /// `pixel_sigma` pixels.
    pub fn of(rig: &'a Rig, pose: &RigPose, pixel_sigma: f64) -> Self {
        let cameras =
            StereoPair { left: &rig.left_camera, right: &rig.right_camera, left_from_right: pose.left_from_right };
        Self { cameras, shared: pose.shared, pixel_sigma }
    }

    /// The error of the point at `range_mm` from the middle of the baseline, at `degrees` from straight ahead towards the right
    /// camera's side; `None` if a camera does not see it.
    pub fn at(&self, range_mm: f64, degrees: f64) -> Option<PointError> {
        let right_centre = self.cameras.left_from_right.origin().mm();
        let along = right_centre.try_normalize(0.0)?;
        let (sin, cos) = degrees.to_radians().sin_cos();
        let sight = cos * straight_ahead(&self.cameras, &along)? + sin * along;
        self.error(&(0.5 * right_centre + range_mm * sight), &sight)
    }

    fn error(&self, point: &Vector3<f64>, sight: &Vector3<f64>) -> Option<PointError> {
        let StereoPair { left, right, left_from_right } = &self.cameras;
        let point = Point::<Left>::from_mm(*point);
        left.project_point(&point).ok().filter(|pixel| left.on_sensor(*pixel))?;
        let in_right: Point<Right> = left_from_right.inverse() * point;
        right.project_point(&in_right).ok().filter(|pixel| right.on_sensor(*pixel))?;
        let uncertainty = PointUncertainty::of(&point, &self.cameras, self.pixel_sigma)?;
        let covariance = uncertainty.covariance(&self.shared);
        let flat = Matrix3::identity() - sight * sight.transpose();
        let across = (flat * covariance * flat).symmetric_eigenvalues().max();
        let [along, across] = [sight.dot(&(covariance * sight)), across].map(|variance| variance.max(0.0).sqrt());
        (along.is_finite() && across.is_finite()).then_some(PointError { along, across })
    }
}

/// Depth error over directions in the plane of the baseline and the direction straight ahead.
pub(crate) struct DepthError {
    /// Directions in degrees from straight ahead, positive to the right camera's side, and errors there. Only directions
    /// that both cameras see.
    curve: Vec<(f64, PointError)>,
    /// Range that the curve holds for, in millimetres.
    range_mm: f64,
}

impl DepthError {
    pub fn of(pair: &UncertainPair<'_>, range_mm: f64) -> Self {
        const WIDEST_DEG: i32 = 85;
        let error = |degrees: i32| Some((f64::from(degrees), pair.at(range_mm, f64::from(degrees))?));
        Self { curve: (-WIDEST_DEG..=WIDEST_DEG).filter_map(error).collect(), range_mm }
    }

    /// Direction (degrees) nearest to straight ahead, and its error.
    pub fn ahead(&self) -> Option<(f64, PointError)> {
        self.curve.iter().copied().min_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))
    }

    /// Direction (degrees) and size of the largest error along the line of sight within `half_angle_deg` of straight ahead.
    pub fn worst_within(&self, half_angle_deg: f64) -> Option<(f64, PointError)> {
        let within = self.curve.iter().copied().filter(|(degrees, _)| degrees.abs() <= half_angle_deg);
        within.max_by(|a, b| a.1.along.total_cmp(&b.1.along))
    }

    /// The upper end of the vertical axis that shows the curve, in millimetres: the error grows without bound towards
    /// the baseline, where it is cut off.
    pub fn high(&self) -> f64 {
        /// The axis ends at this multiple of the smallest error.
        const HIGHEST: f64 = 12.0;
        let least = self.curve.iter().map(|(_, error)| error.along).fold(f64::INFINITY, f64::min);
        let most = self.curve.iter().map(|(_, error)| error.along).fold(0.0, f64::max);
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
        let points: Vec<_> = self.curve.iter().map(|(degrees, error)| axes.at(*degrees, error.along)).collect();
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
fn straight_ahead(cameras: &StereoPair<'_>, along: &Vector3<f64>) -> Option<Vector3<f64>> {
    let right_axis = cameras.left_from_right.rotation() * Vector3::z();
    let between = Vector3::z() + right_axis;
    (between - along * along.dot(&between)).try_normalize(1e-6)
}
