//! The stages of the work on one pair, and how long each takes by the caller's clock.

use std::time::Duration;

/// A stage of the work on one pair of images, in the order in which they run.
///
/// Functions of this crate report the end of each stage to a callback. A caller with a clock reads it there:
///
/// ```
/// use vergence_pipeline::Stage;
///
/// let mut ended = Vec::new();
/// let mut on_end = |stage: Stage| ended.push(stage.as_str());
/// on_end(Stage::Match);
/// on_end(Stage::Triangulate);
/// assert_eq!(ended, ["match", "triangulate"]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Stage {
    /// Finding homologous points.
    Match,
    /// Making points of them.
    Triangulate,
    /// Dense: resampling both images onto views with common rows.
    Turn,
    /// Dense: finding where the images show the rows of these views.
    Align,
    /// Dense: comparing every pixel over all disparities.
    Sweep,
    /// Dense: registering the best disparity to a part of a pixel.
    Register,
    /// Dense: ranges and their uncertainty.
    Range,
}

impl Stage {
    /// The name in reports.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Match => "match",
            Self::Triangulate => "triangulate",
            Self::Turn => "turn",
            Self::Align => "align",
            Self::Sweep => "sweep",
            Self::Register => "register",
            Self::Range => "range",
        }
    }
}

/// How long each stage took: a stopwatch that is read at the end of every stage, by a clock that the caller passes in.
#[derive(Clone, Debug)]
pub struct StageTimes {
    clock: fn() -> Duration,
    began: Duration,
    seconds: Vec<(Stage, f64)>,
}

impl StageTimes {
    /// Starts the first stage. `clock` returns the time since some fixed instant.
    #[must_use]
    pub fn start(clock: fn() -> Duration) -> Self {
        Self { clock, began: clock(), seconds: Vec::new() }
    }

    /// Notes the time of `stage`, which ends now, and starts the next.
    pub fn ended(&mut self, stage: Stage) {
        let now = (self.clock)();
        self.seconds.push((stage, now.saturating_sub(self.began).as_secs_f64()));
        self.began = now;
    }

    /// The stages in the order in which they ran, in seconds.
    #[must_use]
    pub fn seconds(&self) -> &[(Stage, f64)] {
        &self.seconds
    }

    /// How long `stage` took, in seconds; zero where it did not run.
    #[must_use]
    pub fn of(&self, stage: Stage) -> f64 {
        self.seconds.iter().filter(|(ran, _)| *ran == stage).map(|(_, seconds)| seconds).sum()
    }
}
