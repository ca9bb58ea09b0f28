//! `vergence replay`: measures a recording.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use vergence_live::{LiveError, LiveResult, Measurement, Pace, Totals};
use vergence_pipeline::Method;
use vergence_recording::{Event, Reader, Replay};
use vergence_rig::Rig;

use super::model_options::MatcherOptions;
use super::publish::Publisher;
use super::result_options::ResultOptions;
use super::search_options::SearchOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file;
use crate::stopwatch::clock;

/// Measures a recording of `vergence run --record` as the live loop measures, every pair of it. The clouds depend on the recording alone: two
/// replays by one program give the same files. A recording whose program was killed ends with its last whole chunk.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder of the recording.
    recording: PathBuf,
    /// Measures with this rig file instead of the one that is attached to the recording.
    #[arg(long, value_name = "FILE")]
    rig: Option<PathBuf>,
    /// Leave out exposures of the first seconds.
    #[arg(long, value_name = "TIME", default_value = "0s", value_parser = humantime::parse_duration)]
    from: Duration,
    /// End after this many results.
    #[arg(long, value_name = "COUNT")]
    frames: Option<u64>,
    #[command(flatten)]
    results: ResultOptions,
    #[command(flatten)]
    matching: MatcherOptions,
    #[command(flatten)]
    search: SearchOptions,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let files = args.results.files()?;
    let mut reader = Reader::open(&args.recording)?;
    // The rig file precedes the first event.
    let mut next = reader.next_event()?;
    let rig = args.rig(&reader)?;
    let search = args.search.search(&rig)?;
    let measuring = Arc::new(args.search.measuring(rig)?);
    let matcher = args.matching.live(console)?;
    let mut publisher = Publisher {
        console,
        rig: Arc::clone(&measuring),
        lens: None,
        files,
        number: 0,
        recorder: None,
        pace: Pace::default(),
    };
    let mut replay = Replay::new(&measuring, Method { search: &search, ..Method::from(matcher.as_ref()) }, clock);
    let mut totals = Totals::default();
    let begun = next.as_ref().map_or(0, |heard| heard.host_us);
    let from = begun.saturating_add(u64::try_from(args.from.as_micros()).unwrap_or(u64::MAX));
    let mut publish = |measurement: Measurement| publish(&mut publisher, &mut totals, &measurement, args.frames);
    let replayed = loop {
        let Some(heard) = next else { break replay.finish(&mut publish) };
        let is_left_out = heard.host_us < from && matches!(heard.event, Event::Image(..) | Event::Pulse(_));
        if !is_left_out && let Err(end) = replay.take(heard, &mut publish) {
            break Err(end);
        }
        next = reader.next_event()?;
    };
    let is_enough = match replayed {
        Ok(()) => false,
        Err(End::Enough) => true,
        Err(End::Failed(failure)) => return Err(failure),
    };
    totals.skipped.clone_from(replay.skipped());
    if !is_enough && !reader.is_finished() {
        console.warn(format!("{} was not finished: what came after its last chunk is lost", reader.file().display()));
    }
    publisher.end(&totals)
}

/// Why a replay ends before the recording.
enum End {
    /// There are as many results as were asked for.
    Enough,
    Failed(Failure),
}

impl From<LiveError> for End {
    fn from(error: LiveError) -> Self {
        Self::Failed(error.into())
    }
}

/// Publishes a result; the time that measuring took stands for its latency.
fn publish(
    publisher: &mut Publisher,
    totals: &mut Totals,
    measurement: &Measurement,
    most: Option<u64>,
) -> Result<(), End> {
    totals.count(&measurement.observation);
    let latency = Duration::from_secs_f64(measurement.seconds);
    publisher.publish(&LiveResult { measurement, latency, totals }).map_err(End::Failed)?;
    if most.is_some_and(|most| publisher.number >= most) { Err(End::Enough) } else { Ok(()) }
}

impl Args {
    /// The rig that the options name, or the one that is attached.
    fn rig(&self, reader: &Reader) -> Result<Rig, Failure> {
        if self.rig.is_some() {
            return rig_file::load(self.rig.as_deref());
        }
        let file = reader.file();
        let text = reader.rig().ok_or_else(|| Failure::input(file, "no rig file is attached; name one with --rig"))?;
        Rig::from_toml(text).map_err(|error| Failure::input(file, format!("the attached rig file: {error}")))
    }
}
