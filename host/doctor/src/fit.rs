//! How well the calibration fits the pictures in front of the cameras: whether matches lie on the epipolar planes that it states.

use std::sync::{Arc, Mutex};
use std::time::Duration;

use tokio::sync::mpsc::Receiver;
use vergence_board::{Board, Finding, HostClock};
use vergence_camera::CameraEvent;
use vergence_live::{Clock, Limits, LiveError, LiveLoop, LiveResult, MatchingTime, Totals};
use vergence_matching::GuidedMatcher;
use vergence_pipeline::{Exposures, Observation, PairCloud, Search, TimeBase};
use vergence_protocol::{Request, Trigger, TriggerMark};
use vergence_rig::{ExposureTiming, Rig};
use vergence_vision::Side;

/// Longest wait for a pair.
const PATIENCE: Duration = Duration::from_secs(5);
/// With fewer points nothing is said.
const FEWEST: usize = 30;
/// With fewer keypoints an image has hardly any texture.
const FEWEST_KEYPOINTS: usize = 50;
/// Least part of the keypoints that become points where the pose is right: pairs that were taken together have 17 % to 38 % (vergence-plausibility).
const LEAST_SHARE: f64 = 0.03;

/// A pair of cameras that run, beside their board.
pub struct Running<'a> {
    /// What is known of the rig.
    pub rig: Arc<Rig>,
    /// How each camera exposes, where it has said so; it says it once.
    pub timing: [Option<ExposureTiming>; 2],
    /// Events of both cameras.
    pub events: Receiver<(Side, CameraEvent)>,
    /// Pulses of the trigger.
    pub marks: Option<Receiver<TriggerMark>>,
    /// The board; `None` of a rig without axes.
    pub board: Option<&'a Board>,
    /// How it fires the cameras; `None` where they run freely.
    pub trigger: Option<Trigger>,
    /// The clock of images and pulses, and the time between pulses in microseconds.
    pub clock: (HostClock, Option<f64>),
    /// Tells how long matching takes.
    pub stopwatch: Clock,
}

/// Measures the next pair, and compares it with what the calibration states.
pub async fn check_fit(running: Running<'_>) -> Finding {
    let Running { rig, timing, events, marks, board, trigger, clock: (clock, period_us), stopwatch } = running;
    if board.is_some_and(|board| !board.is_referenced()) {
        return Finding::warn(
            "fit",
            "the axes do not know where they are, so that nothing says whether the calibration fits",
            "vergence home",
        );
    }
    let mut live = LiveLoop {
        rig,
        matcher: Arc::new(GuidedMatcher::default()),
        search: Arc::new(Search::default()),
        events,
        marks,
        board: board.map(|board| board.client().knowledge()),
        clock,
        exposures: Exposures::new(period_us),
        matching_time: MatchingTime::Real,
        stopwatch,
        memory: Arc::<Mutex<_>>::default(),
        budget: None,
        dense: false,
    };
    let base = live.board.as_ref().map_or(TimeBase::Host, |board| TimeBase::Board(board.clock_map()));
    for (side, timing) in [Side::Left, Side::Right].into_iter().zip(timing) {
        if let Some(timing) = timing {
            live.exposures.camera_ready(side, timing, &base);
        }
    }
    let mut found = None;
    let limits = Limits { results: Some(1), time: Some(PATIENCE) };
    let note = |result: LiveResult<'_>| {
        found = Some(match &result.measurement.observation {
            Observation::Points { cloud, .. } => fit(cloud),
            Observation::Bearings { side, .. } => Finding::warn(
                "fit",
                format!("only the {side} camera sends images, so that nothing says whether the calibration fits"),
                "see what was said of the other camera",
            ),
        });
        Ok::<(), LiveError>(())
    };
    set_trigger(board, trigger).await;
    let ended = live.run(limits, &mut Totals::default(), note, |_| ()).await;
    set_trigger(board, trigger.map(|_| Trigger::Off)).await;
    match (found, ended) {
        (Some(found), _) => found,
        (None, Err(error)) => Finding::fail("fit", error.to_string(), "see what was said of cameras and rig file"),
        (None, Ok(_)) => Finding::warn(
            "fit",
            "no pair came whose pose is known, so that nothing says whether the calibration fits",
            "give the axes their reference ('vergence home'), and see what was said of trigger and pairing",
        ),
    }
}

/// Where the link fails, the loop ends and says so.
async fn set_trigger(board: Option<&Board>, trigger: Option<Trigger>) {
    if let (Some(board), Some(trigger)) = (board, trigger) {
        let _ = board.ask(Request::SetTrigger(trigger)).await;
    }
}

/// What the points of a pair say of the calibration.
#[must_use]
pub fn fit(cloud: &PairCloud) -> Finding {
    let mut off: Vec<f64> = cloud.points.iter().map(|point| point.point.residual.rad().abs()).collect();
    let mut stated: Vec<f64> = cloud.points.iter().map(|point| point.point.residual_sigma.rad()).collect();
    let median = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied().unwrap_or_default().to_degrees()
    };
    // Half of the values of a normal distribution lie within 0.6745 standard deviations.
    let (found, expected) = (median(&mut off), 0.6745 * median(&mut stated));
    let points = cloud.points.len();
    let remedy = "check that left and right are not swapped, that no lens was turned and no screw is loose; then calibrate again";
    if let Some(drift) = cloud.significant_drift() {
        return Finding::fail(
            "fit",
            format!(
                "the pictures contradict the calibration: they show a pose that is {:.2} off, more than it states to be uncertain",
                drift.angle
            ),
            remedy,
        );
    }
    if cloud.keypoints >= FEWEST_KEYPOINTS && (points as f64) < LEAST_SHARE * cloud.keypoints as f64 {
        return Finding::fail(
            "fit",
            format!(
                "the pictures contradict the calibration: of {} keypoints only {points} have a partner where it says that one must be",
                cloud.keypoints
            ),
            remedy,
        );
    }
    if points < FEWEST || cloud.pose_drift.is_none() {
        return Finding::warn(
            "fit",
            format!("only {points} points were found in a pair: too few to say whether the calibration fits"),
            "show the cameras a room with texture, in focus and well lit",
        );
    }
    Finding::pass(
        "fit",
        format!(
            "{points} points of a pair are {found:.3} degrees off their epipolar planes (the median), {expected:.3} are stated"
        ),
    )
}
