//! Seconds of a calibration and of the detection of a chessboard, on one thread.

use std::path::PathBuf;

use image::GrayImage;
use image::imageops::grayscale;
use serde_json::{Value, json};
use vergence_calibration::{IntrinsicsOptions, calibrate_intrinsics};
use vergence_camera::read_image;
use vergence_rig::rounded;
use vergence_targets::{TargetSpec, TargetView, detect};
use vergence_vision::ImageSize;
use vergence_vision::median;

use crate::error::BenchError;
use crate::peer::{Detector, OpenCvDetectors, PeerCalibration, PeerFit};
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

    /// Looks for `target` in every image file.
    ///
    /// # Errors
    /// [`BenchError::Image`] where one cannot be read.
    pub fn detect_files(&self, paths: &[PathBuf], target: &TargetSpec) -> Result<Detections, BenchError> {
        let mut found = Detections::default();
        for path in paths {
            let image = read_image(path).map_err(|error| BenchError::Image(error.to_string()))?;
            self.detect(&grayscale(&image), target, &mut found);
        }
        Ok(found)
    }
}

impl Solve {
    /// Seconds and errors for people, beside those of the `peers`; `what` names the set.
    #[must_use]
    pub fn in_words(&self, what: &str, peers: Option<&PeerCalibration>) -> String {
        let ms = |seconds: Option<f64>| seconds.map_or_else(|| "failed".into(), |s| format!("{:.1} ms", 1e3 * s));
        let px = |px: Option<f64>| px.map_or_else(|| "-".into(), |px| format!("{px:.3} px"));
        let fit = |fit: &PeerFit| format!("{} ({})", ms(fit.seconds), px(fit.rms_px));
        let ours = format!("{} ({})", ms(Some(self.seconds)), px(Some(self.rms_px)));
        let peers = peers.map(|peers| format!("; OpenCV {}; SciPy {}", fit(&peers.opencv), fit(&peers.scipy)));
        format!("{what} ({} corners): {ours}{}", self.corners, peers.unwrap_or_default())
    }

    /// The same for programs.
    #[must_use]
    pub fn json(&self, peers: Option<&PeerCalibration>) -> Value {
        let mut value = json!({
            "corners": self.corners,
            "seconds": self.seconds,
            "rms_px": self.rms_px,
            "rms_inlier_px": self.rms_inlier_px,
        });
        if let Some(peers) = peers {
            let fit = |fit: &PeerFit| json!({ "seconds": fit.seconds, "rms_px": fit.rms_px, "error": fit.error });
            let comparison = Comparison::of(self.seconds, peers);
            value["opencv"] = fit(&peers.opencv);
            value["opencv"]["converged"] = comparison.opencv_converged.into();
            value["scipy"] = fit(&peers.scipy);
            value["no_slower_than_opencv"] = comparison.no_slower_than_opencv.into();
            value["a_tenth_of_scipy"] = comparison.a_tenth_of_scipy.into();
        }
        value
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

    /// Counts and time for people, beside those of OpenCV's detectors where they were asked; `name` is the set's.
    #[must_use]
    pub fn in_words(&self, name: &str, peer: Option<&OpenCvDetectors>) -> String {
        let one = |name: &str, Detector { boards, median_ms }: Detector| {
            format!("{name} found in {boards}, {:.1} ms", rounded(median_ms))
        };
        let all = |OpenCvDetectors { classic, sb, sb_thorough }: &OpenCvDetectors| {
            let three = [one("classic", *classic), one("SB", *sb), one("SB, exhaustive and accurate,", *sb_thorough)];
            format!("; OpenCV {}", three.join("; "))
        };
        format!(
            "{name}: found in {} of {} images, {} of them complete, {:.1} ms an image{}",
            self.found,
            self.images(),
            self.complete,
            rounded(self.median_ms()),
            peer.map(all).unwrap_or_default()
        )
    }

    /// The same for programs.
    #[must_use]
    pub fn json(&self, name: &str, peer: Option<&OpenCvDetectors>) -> Value {
        let mut value = json!({
            "set": name,
            "images": self.images(),
            "boards": self.found,
            "complete": self.complete,
            "median_ms": self.median_ms(),
        });
        if let Some(peer) = peer {
            value["opencv"] = json!(peer);
        }
        value
    }
}
