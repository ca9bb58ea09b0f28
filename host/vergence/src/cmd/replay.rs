//! `vergence replay`: measures a recording.

use std::path::PathBuf;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use vergence_board::HostClock;
use vergence_live::{LiveError, LiveResult, Measurement, Pace, Totals};
use vergence_pipeline::Method;
use vergence_recording::{Pacing, Reader, RecordingError, Replay, play};
use vergence_rig::Rig;

use super::model_options::MatcherOptions;
use super::publish::Publisher;
use super::result_options::ResultOptions;
use super::search_options::SearchOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::interrupted;
use crate::rig_file;
use crate::stopwatch::clock;

/// Measures a recording of `vergence run --record` as the live loop measures, every pair of it. The clouds depend on the recording alone: two
/// replays by one program give the same files. A recording whose program was killed ends with its last whole chunk. Ctrl-C ends after the pair that is
/// being measured.
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
    /// Replay so many times as fast as it was recorded, 0.01 to 1000; 1 is as recorded. Every pair is still measured: where matching takes longer,
    /// the replay is slower. Without it, as fast as matching goes.
    #[arg(long, value_name = "FACTOR", value_parser = parse_factor)]
    rate: Option<f64>,
    /// Begin again after the end, until Ctrl-C or --frames, at any --rate or none. Each time gives the same clouds.
    #[arg(long = "loop")]
    is_endless: bool,
    #[command(flatten)]
    results: ResultOptions,
    #[command(flatten)]
    matching: MatcherOptions,
    #[command(flatten)]
    search: SearchOptions,
}

pub async fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let files = args.results.files()?;
    let mut reader = Reader::open(&args.recording)?;
    // The rig file precedes the first event.
    let mut next = reader.next_event()?;
    let rig = args.rig(&reader)?;
    let search = args.search.search(&rig)?;
    let measuring = Arc::new(args.search.measuring(rig)?);
    let mut publisher = Publisher {
        console,
        rig: Arc::clone(&measuring),
        lens: None,
        files,
        number: 0,
        clock: HostClock::start(),
        recorder: None,
        publication: None,
        pace: Pace::default(),
    };
    let (mut totals, pacing) = (Totals::default(), Pacing { from: args.from, rate: args.rate });
    let mut interrupted = pin!(interrupted());
    loop {
        let before = publisher.number;
        // Made anew each time: the matcher follows points from pair to pair.
        let matcher = args.matching.live(console)?;
        let mut replay = Replay::new(&measuring, Method { search: &search, ..Method::from(matcher.as_ref()) }, clock);
        let mut publish = |measurement: Measurement| publish(&mut publisher, &mut totals, &measurement, args.frames);
        let played = tokio::select! {
            played = play(&mut reader, next, &mut replay, pacing, &mut publish) => played,
            () = &mut interrupted => Err(End::Enough),
        };
        for (reason, count) in replay.skipped() {
            *totals.skipped.entry(*reason).or_default() += count;
        }
        match played {
            Err(End::Failed(failure)) => return Err(failure),
            Err(End::Enough) => break,
            Ok(()) if before == 0 && !reader.is_finished() => console
                .warn(format!("{} was not finished: what came after its last chunk is lost", reader.file().display())),
            Ok(()) => {}
        }
        // A recording without a result gives none the next time either.
        if !args.is_endless || publisher.number == before {
            break;
        }
        reader = Reader::open(&args.recording)?;
        next = reader.next_event()?;
    }
    publisher.end(&totals)
}

/// Parses how many times as fast as recorded.
fn parse_factor(text: &str) -> Result<f64, String> {
    let factor = text.parse().ok().filter(|factor| (0.01..=1000.0).contains(factor));
    factor.ok_or_else(|| format!("'{text}' is no factor: choose 0.01 to 1000 times as fast as recorded"))
}

/// Why a replay ends before the recording.
enum End {
    /// There are as many results as were asked for, or the program is asked to end.
    Enough,
    Failed(Failure),
}

impl From<RecordingError> for End {
    fn from(error: RecordingError) -> Self {
        Self::Failed(error.into())
    }
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
