//! Seconds of a calibration and of the detection of a chessboard, on one thread.

use image::GrayImage;
use vergence_calibration::detect::detect;
use vergence_calibration::{IntrinsicsOptions, TargetSpec, TargetView, calibrate_intrinsics, median};
use vergence_vision::ImageSize;

use crate::error::BenchError;
use crate::peer::PeerCalibration;
use crate::{Clock, timed};

/// A fit within this factor of the least-squares optimum has converged.
const CONVERGED: f64 = 1.5;
/// SciPy's optimum takes at least this many times as long as this program, or this program is too slow.
const FASTER_THAN_SCIPY: f64 = 10.0;

/// One thread, and a clock.
pub struct OneThread {
    pool: rayon::ThreadPool,
    clock: Clock,
}

/// A calibration of one camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solve {
    /// Corners in all views.
    pub corners: usize,
    /// Median of the seconds of all runs.
    pub seconds: f64,
    /// Root mean square of the residuals, in pixels.
    pub rms_px: f64,
    /// The same without outliers.
    pub rms_inlier_px: f64,
}

/// How a [`Solve`] stands beside the peers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Comparison {
    /// Whether OpenCV's fit comes near the least-squares optimum.
    pub opencv_converged: bool,
    /// Whether this program is no slower; `None` where OpenCV did not converge.
    pub no_slower_than_opencv: Option<bool>,
    /// Whether this program takes at most a tenth of SciPy's time; `None` where SciPy failed.
    pub a_tenth_of_scipy: Option<bool>,
}

/// Detections of one chessboard in several images.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Detections {
    /// Images in which it was found.
    pub found: usize,
    /// Images in which all its corners were found.
    pub complete: usize,
    milliseconds: Vec<f64>,
}

impl OneThread {
    /// Starts the thread.
    ///
    /// # Errors
    /// Where the system gives none.
    pub fn start(clock: Clock) -> Result<Self, BenchError> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        Ok(Self { pool: pool.map_err(|error| BenchError::Threads(error.to_string()))?, clock })
    }

    /// Calibrates a camera of `size` from `views`, `runs` times.
    ///
    /// # Errors
    /// Where the views give no calibration.
    pub fn solve(&self, views: &[TargetView], size: ImageSize, runs: u16) -> Result<Solve, BenchError> {
        let solve = || calibrate_intrinsics(views, size, &IntrinsicsOptions::default());
        let failed = |error: vergence_calibration::IntrinsicsError| BenchError::Work(error.to_string());
        let mut seconds = Vec::new();
        for _ in 0..runs {
            let (solved, taken) = timed(self.clock, || self.pool.install(solve));
            solved.map_err(failed)?;
            seconds.push(taken);
        }
        let found = solve().map_err(failed)?;
        Ok(Solve {
            corners: found.corners_total,
            seconds: median(seconds).unwrap_or_default(),
            rms_px: found.rms_px,
            rms_inlier_px: found.rms_inlier_px,
        })
    }

    /// Looks for `target` in `image` and counts it among `detections`.
    pub fn detect(&self, image: &GrayImage, target: &TargetSpec, detections: &mut Detections) {
        let (found, seconds) = timed(self.clock, || self.pool.install(|| detect(image, target, None)));
        detections.milliseconds.push(1e3 * seconds);
        detections.found += usize::from(found.is_ok());
        detections.complete += usize::from(found.is_ok_and(|found| found.complete));
    }
}

impl Comparison {
    /// Compares the `seconds` of this program with the peers.
    #[must_use]
    pub fn of(seconds: f64, PeerCalibration { opencv, scipy }: &PeerCalibration) -> Self {
        let converged = opencv.rms_px.zip(scipy.rms_px).is_some_and(|(theirs, least)| theirs <= CONVERGED * least);
        Self {
            opencv_converged: converged,
            no_slower_than_opencv: opencv.seconds.filter(|_| converged).map(|theirs| seconds <= theirs),
            a_tenth_of_scipy: scipy.seconds.map(|theirs| seconds * FASTER_THAN_SCIPY <= theirs),
        }
    }
}

impl Detections {
    /// Images so far.
    #[must_use]
    pub fn images(&self) -> usize {
        self.milliseconds.len()
    }

    /// Median of the milliseconds for an image; 0 without images.
    #[must_use]
    pub fn median_ms(&self) -> f64 {
        median(self.milliseconds.clone()).unwrap_or_default()
    }
}
