//! What the verbs share that measure live: how images are taken, and how they are matched.

use std::path::Path;
use std::sync::Arc;

use tokio::sync::mpsc::Receiver;
use vergence_camera::CameraEvent;
use vergence_live::{LiveLoop, MatchingTime};
use vergence_matching::Matcher;
use vergence_pipeline::{Exposures, PointBudget, Search};
use vergence_protocol::TriggerMark;
use vergence_rig::Rig;
use vergence_vision::Side;

use super::model_options::MatcherOptions;
use super::search_options::SearchOptions;
use super::taking_options::{LiveRig, TakingOptions};
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::stopwatch::clock as stopwatch;

/// How images are taken and measured.
#[derive(Debug, clap::Args)]
pub struct LiveOptions {
    #[command(flatten)]
    pub taking: TakingOptions,
    #[command(flatten)]
    matching: MatcherOptions,
    #[command(flatten)]
    search: SearchOptions,
    /// Fewest points that are looked for where time is short; a lower rate comes only after that. With more than the matcher follows, time
    /// never limits the points.
    #[arg(long, default_value_t = 150, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(1..))]
    least_points: u32,
}

/// What measures.
pub struct LiveMethod {
    /// The rig, with the field of the lenses in which points are made.
    pub measuring: Arc<Rig>,
    matcher: Arc<dyn Matcher>,
    search: Arc<Search>,
    least_points: usize,
}

impl LiveOptions {
    /// As [`TakingOptions::connect`], with what measures.
    ///
    /// # Errors
    /// As there; options of the matcher or the search that do not fit.
    pub async fn connect(
        &self,
        cameras: &[String],
        common: &CommonOptions,
        out: Option<&Path>,
        console: Console,
    ) -> Result<(LiveRig, LiveMethod), Failure> {
        let method = |known: &Rig| {
            Ok(LiveMethod {
                search: Arc::new(self.search.search(known)?),
                // A simulated camera shows nothing beyond the field in which it is known.
                measuring: Arc::new(self.search.measuring(known.clone())?),
                matcher: Arc::from(self.matching.live(console)?),
                least_points: self.least_points as usize,
            })
        };
        self.taking.connect(cameras, common, out, console, method).await
    }
}

impl LiveMethod {
    /// The loop that measures what arrives at `events`, by these pulses; matching takes `time` on its clock.
    pub fn live_loop(
        &self,
        rig: &LiveRig,
        events: Receiver<(Side, CameraEvent)>,
        marks: Option<Receiver<TriggerMark>>,
        time: MatchingTime,
    ) -> LiveLoop {
        // Where matching takes a fixed time on a simulated clock, fewer points are no quicker.
        let most = self.matcher.most_points().filter(|_| !matches!(time, MatchingTime::Fixed(_)));
        LiveLoop {
            rig: Arc::clone(&self.measuring),
            matcher: Arc::clone(&self.matcher),
            search: Arc::clone(&self.search),
            events,
            marks,
            board: rig.board.as_ref().map(|board| board.client().knowledge()),
            clock: rig.clock,
            exposures: Exposures::new(rig.period_us),
            matching_time: time,
            stopwatch,
            memory: Arc::default(),
            budget: most.map(|most| PointBudget::new(self.least_points, most, rig.period_us.map(|us| 1e-6 * us))),
            dense: false,
        }
    }
}
