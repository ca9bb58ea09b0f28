//! `vergence replay`: measures a recording.

use std::path::PathBuf;
use std::pin::pin;
use std::sync::Arc;
use std::time::Duration;

use vergence_board::HostClock;
use vergence_live::{LiveError, LiveResult, Measurement, Pace, Totals};
use vergence_panel::{Panel, Screen, Setting};
use vergence_pipeline::Method;
use vergence_recording::{Jump, Pacing, Reader, RecordingError, Replay, play};

use super::model_options::MatcherOptions;
use super::panel_options::PanelOptions;
use super::publish::{Publisher, tell};
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
///
/// With --panel a page shows it as `vergence panel` shows a rig: it can be held, and played from elsewhere.
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
    /// Replay so many times as fast as it was recorded, 0.01 to 1000; 1 is as recorded, and what --panel takes. Every pair is still measured:
    /// where matching takes longer, the replay is slower. Without both, as fast as matching goes.
    #[arg(long, value_name = "FACTOR", value_parser = parse_factor)]
    rate: Option<f64>,
    /// Begin again after the end, until Ctrl-C or --frames, at any --rate or none. Each time gives the same clouds.
    #[arg(long = "loop")]
    is_endless: bool,
    #[command(flatten)]
    panel: PanelOptions,
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
    let rig = args.rig.as_deref().map_or_else(|| Ok(reader.attached_rig()?), |file| rig_file::load(Some(file)))?;
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
    };
    let recorded_ms = reader.begun_ns().map(|ns| ns / 1_000_000);
    let simulated = reader.simulated().map(str::to_owned);
    let setting = Setting { rig: Arc::clone(&measuring), simulated, has_cameras: true, recorded_ms };
    let (panel, _serving) = args.panel.serve(setting, console)?.unzip();
    let rate = args.rate.or(panel.as_ref().map(|_| 1.0));
    let mut screen = panel.clone().map(|panel| Screen::new(panel, reader.length(), rate));
    let (mut totals, mut pace, mut from) = (Totals::default(), Pace::default(), args.from);
    let mut interrupted = pin!(interrupted());
    loop {
        let before = publisher.number;
        // Made anew each time: the matcher follows points from pair to pair.
        let matcher = args.matching.live(console)?;
        let method = Method { search: &search, ..Method::from(matcher.as_ref()) };
        let mut replay = Replay::new(&measuring, method, clock, screen.as_mut());
        let mut publish = |measurement: Measurement| {
            publish(&mut publisher, (&mut totals, &mut pace), (&measurement, panel.as_ref()), args.frames)
        };
        let played = tokio::select! {
            played = play(&mut reader, next, &mut replay, Pacing { from, rate }, &mut publish) => played,
            () = &mut interrupted => Err(End::Enough),
        };
        replay.account(&mut totals);
        from = match (played, &mut screen) {
            (Err(End::Failed(failure)), _) => return Err(failure),
            (Err(End::Enough), _) => break,
            (Err(End::Elsewhere(Jump(to))), _) => to,
            (Ok(()), screen) => {
                if before == 0 && !reader.is_finished() {
                    let file = reader.file().display();
                    console.warn(format!("{file} was not finished: what came after its last chunk is lost"));
                }
                match screen {
                    // A recording without a result gives none the next time either.
                    _ if args.is_endless && publisher.number > before => args.from,
                    Some(screen) => tokio::select! {
                        Jump(to) = screen.jump() => to,
                        () = &mut interrupted => break,
                    },
                    None => break,
                }
            }
        };
        reader = Reader::open(&args.recording)?;
        next = reader.next_event()?;
    }
    tell(&totals, console)
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
    /// A page wants to see it from elsewhere.
    Elsewhere(Jump),
    Failed(Failure),
}

impl From<Jump> for End {
    fn from(jump: Jump) -> Self {
        Self::Elsewhere(jump)
    }
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
    (totals, pace): (&mut Totals, &mut Pace),
    (measurement, panel): (&Measurement, Option<&Panel>),
    most: Option<u64>,
) -> Result<(), End> {
    totals.count(&measurement.observation);
    let latency = Duration::from_secs_f64(measurement.seconds);
    let result =
        LiveResult { measurement, latency, totals, limited: None, pace: pace.note(measurement.middle.us, totals) };
    publisher.publish(&result).map_err(End::Failed)?;
    panel.into_iter().for_each(|panel| panel.show(&result));
    if most.is_some_and(|most| publisher.number >= most) { Err(End::Enough) } else { Ok(()) }
}
