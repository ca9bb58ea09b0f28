//! A simulated rig in real time with panel, recording and three pages: memory, losses, what the pages cost, and whether matches are right while
//! and after the mode changes.
//!
//! A minute; `VERGENCE_SOAK_MINUTES=30` for the long run, which needs 5 GB for its recording. Board, stages and cameras are simulated
//! in the process that is measured, so that its computing time holds the rendering of the images, which a real rig does not do.
//!
//! `VERGENCE_SOAK_BOARD=firmware` runs the unmodified firmware on a simulated chip in place of the controller core alone.
//!
//! `VERGENCE_SOAK_SIZE=1280x1280` takes images of this size at 10 Hz and records nothing: what pages cost beside a busy matcher.
#![cfg(target_os = "linux")]
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]
#![allow(clippy::disallowed_methods, reason = "another process is watched in real time")]

#[path = "common/association.rs"]
mod association;
#[path = "elf_rig/build.rs"]
mod build;
mod common;

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::net::TcpStream;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{JoinHandle, sleep, spawn};
use std::time::{Duration, Instant};

use association::Judge;
use common::served::Served;
use serde_json::{Value, json};
use tungstenite::client::{IntoClientRequest, client};
use tungstenite::http::HeaderValue;
use tungstenite::{Error, Message, WebSocket};
use vergence_recording::{Event, Reader};
use vergence_rig::{BENCH_TOML, Rig};

/// Length of the short run.
const SHORT: Duration = Duration::from_secs(60);
/// Memory is watched after this part of the run: buffers and tracks of the last half minute fill first.
const WARM: f64 = 0.45;
/// The most that memory may grow in the watched part, in MB: it goes up and down by some 10. The long run finds a leak of 1.2 MB a minute.
const GROWTH_MB: f64 = 20.0;
/// The most that pages may take of the computing time that the cores have: so much less has a pipeline that uses them all.
const PAGES_SHARE: f64 = 0.03;
/// Width of small images in pixels.
const SMALL: u32 = 320;
/// Time in a mode before the next.
const STAY: Duration = Duration::from_secs(2);
/// The largest part of the matches that may be wrong after a change of the mode.
const WRONG: f64 = 0.01;
/// Ticks a second in `/proc/PID/stat` (`getconf CLK_TCK`, 100 on every Linux).
const TICKS: f64 = 100.0;

type Socket = WebSocket<TcpStream>;

/// Opens a page's socket.
fn open(address: &str) -> Socket {
    let stream = TcpStream::connect(address).expect("the panel listens");
    stream.set_read_timeout(Some(Duration::from_millis(50))).expect("a socket");
    let mut request = format!("ws://{address}/socket").into_client_request().expect("a request");
    let origin = HeaderValue::from_str(&format!("http://{address}")).expect("a header");
    request.headers_mut().insert("origin", origin);
    client(request, stream).map(|(socket, _)| socket).expect("the page is let in")
}

/// A message or its header, and what follows that; `None` where none came in time.
fn read(socket: &mut Socket) -> Option<(Value, Vec<u8>)> {
    match socket.read() {
        Ok(Message::Text(text)) => Some((serde_json::from_str(&text).ok()?, Vec::new())),
        Ok(Message::Binary(bytes)) => {
            let length = u32::from_le_bytes(bytes[..4].try_into().expect("four bytes")) as usize;
            Some((serde_json::from_slice(&bytes[4..4 + length]).ok()?, bytes[4 + length..].to_vec()))
        }
        Err(Error::Io(error)) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => None,
        Ok(_) => None,
        Err(error) => panic!("the panel closed a page that reads: {error}"),
    }
}

/// What the pages saw.
#[derive(Default)]
struct Seen {
    clouds: AtomicU64,
    matching_ms: AtomicU64,
    moves_done: AtomicU64,
    moves_asked: AtomicU64,
    slow_pages: AtomicU64,
    /// Wrong matches, those that would be wrong with the next one's partner, and all: while the stages move, and of clouds of stages that stand in a new mode.
    moving: [AtomicU64; 3],
    after: [AtomicU64; 3],
    is_over: AtomicBool,
}

impl Seen {
    fn goes_on(&self) -> bool {
        !self.is_over.load(Ordering::Relaxed)
    }
}

/// A page that sends the rig from mode to mode, and hears that it arrives.
fn drive(address: &str, seen: &Seen) {
    let mut socket = open(address);
    let say = |socket: &mut Socket, message: Value| {
        socket.send(Message::Text(message.to_string().into())).expect("the panel listens");
    };
    say(&mut socket, json!({ "do": "take" }));
    let (mut beat, mut asked, mut modes) = (Instant::now(), None::<&str>, ["human", "herbivore"].iter().cycle());
    let mut arrived = None::<Instant>;
    while seen.goes_on() {
        if beat.elapsed() > Duration::from_millis(250) {
            say(&mut socket, json!({ "do": "beat" }));
            beat = Instant::now();
        }
        let Some((message, _)) = read(&mut socket) else { continue };
        let is_at_rest = message["kind"] == "status" && message["state"] == "idle" && message["doing"].is_null();
        let is_known = message["referenced"] == json!([true, true]);
        if is_at_rest && is_known && asked.is_none_or(|mode| message["mode"] == mode) {
            if arrived.get_or_insert_with(Instant::now).elapsed() < STAY {
                continue;
            }
            arrived = None;
            seen.moves_done.fetch_add(u64::from(asked.is_some()), Ordering::Relaxed);
            asked = modes.next().copied();
            seen.moves_asked.fetch_add(1, Ordering::Relaxed);
            say(&mut socket, json!({ "do": "mode", "name": asked }));
        }
        assert_ne!(message["kind"], "refused", "{message}");
    }
}

/// A page that reads all that it gets, and looks at every match where images are small.
fn watch(address: &str, seen: &Seen) {
    let mut socket = open(address);
    let bench = Rig::from_toml(BENCH_TOML).expect("the bench").with_sensors(SMALL).expect("small cameras");
    let judge = size().is_none().then(|| Judge::new(bench));
    while seen.goes_on() {
        let Some((message, payload)) = read(&mut socket) else { continue };
        if message["kind"] != "cloud" {
            continue;
        }
        seen.clouds.fetch_add(1, Ordering::Relaxed);
        seen.matching_ms.fetch_add(message["work_ms"].as_f64().unwrap_or(0.0) as u64, Ordering::Relaxed);
        if let Some(judge) = judge.as_ref().filter(|_| message["bearings"].is_null()) {
            let counts = if message["moving"] == true { &seen.moving } else { &seen.after };
            for (count, more) in counts.iter().zip(judge.wrong(&message, &payload)) {
                count.fetch_add(more, Ordering::Relaxed);
            }
        }
    }
}

/// The size of the images, where it is not the small one.
fn size() -> Option<String> {
    std::env::var("VERGENCE_SOAK_SIZE").ok()
}

/// The simulated board: without a chip, or with the firmware on one.
fn port() -> String {
    match std::env::var("VERGENCE_SOAK_BOARD").as_deref() {
        Err(_) => "sim".into(),
        Ok("firmware") => format!("sim:{}", build::build("vergence-nucleo-g474").display()),
        Ok(other) => panic!("VERGENCE_SOAK_BOARD={other}: it may be firmware"),
    }
}

/// A page that says it is there and never reads. The panel gives it up after a while; then it comes again.
fn neglect(address: &str, seen: &Seen) {
    while seen.goes_on() {
        let mut socket = open(address);
        seen.slow_pages.fetch_add(1, Ordering::Relaxed);
        let beat = Message::Text(r#"{"do":"beat"}"#.into());
        while seen.goes_on() && socket.send(beat.clone()).is_ok() {
            sleep(Duration::from_millis(250));
        }
    }
}

/// Resident memory of a process in MB.
fn memory_mb(process: u32) -> f64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).expect("it runs");
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).expect("its memory");
    line.trim().trim_end_matches("kB").trim().parse::<f64>().expect("a number") / 1024.0
}

/// Seconds of computing in a `stat` file: fields 14 and 15 after the name, which is in brackets (proc(5)).
fn computing(stat: &str) -> f64 {
    let after_name = stat.rsplit_once(')').map_or("", |(_, rest)| rest);
    let ticks = after_name.split_whitespace().skip(11).take(2).filter_map(|field| field.parse::<f64>().ok());
    ticks.sum::<f64>() / TICKS
}

/// Computing time of the threads that serve pages, by thread: one that ends keeps what it had when it was seen last.
#[derive(Default)]
struct PageThreads(BTreeMap<String, f64>);

impl PageThreads {
    fn look(&mut self, process: u32) {
        let threads = std::fs::read_dir(format!("/proc/{process}/task")).expect("it runs");
        for thread in threads.flatten() {
            let read = |name: &str| std::fs::read_to_string(thread.path().join(name)).unwrap_or_default();
            if read("comm").trim() == "panel" {
                let known = self.0.entry(thread.file_name().to_string_lossy().into_owned()).or_default();
                *known = known.max(computing(&read("stat")));
            }
        }
    }

    fn seconds(&self) -> f64 {
        self.0.values().sum()
    }
}

/// The slope of the least-squares line through `points`.
fn slope(points: &[(f64, f64)]) -> f64 {
    let count = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|point| point.0), mean(|point| point.1));
    let [over, under] = points
        .iter()
        .fold([0.0; 2], |[over, under], point| [over + (point.0 - x) * (point.1 - y), under + (point.0 - x).powi(2)]);
    over / under
}

/// How long the run takes.
fn length() -> Duration {
    let minutes = std::env::var("VERGENCE_SOAK_MINUTES").ok().and_then(|text| text.parse::<f64>().ok());
    minutes.map_or(SHORT, |minutes| Duration::from_secs_f64(60.0 * minutes))
}

/// What is in the recording: pulses, images of each camera, and poses, all without a gap in their numbers.
fn recorded(folder: &Path) -> (u64, [u64; 2], u64) {
    let mut reader = Reader::open(folder).expect("a recording");
    let (mut pulses, mut images, mut poses) = (Vec::new(), [Vec::new(), Vec::new()], Vec::new());
    while let Some(heard) = reader.next_event().expect("an event") {
        match heard.event {
            Event::Pulse(mark) => pulses.push(mark.seq),
            Event::Image(eye, stamp) => images[eye.side().index()].push(stamp.seq),
            Event::Pose(pose) => poses.push(pose.seq),
            _ => {}
        }
    }
    for seqs in [&pulses, &images[0], &images[1]] {
        assert!(seqs.windows(2).all(|pair| pair[1] == pair[0].wrapping_add(1)), "a pulse or an image is missing");
    }
    assert!(poses.windows(2).all(|pair| pair[1] == pair[0].wrapping_add(1)), "a pose is missing");
    (pulses.len() as u64, images.map(|seqs| seqs.len() as u64), poses.len() as u64)
}

#[test]
fn memory_stays_flat_nothing_is_lost_matches_are_right_and_pages_cost_little() {
    let folder = tempfile::tempdir().expect("a folder");
    let recording = folder.path().join("recording");
    let name = recording.to_str().expect("a name");
    let large = size();
    let (size, rate) = large.as_deref().map_or(("320x320", "2"), |size| (size, "10"));
    let port = port();
    let rig = ["panel", "--port", &port, "--cameras", "sim", "--home", "--size", size, "--rate", rate];
    let recorded_to: &[&str] = if large.is_none() { &["--record", name] } else { &[] };
    let mut served = Served::start(&[&rig[..], &["--listen", "127.0.0.1:0"], recorded_to].concat());
    let (process, seen) = (served.id(), Arc::new(Seen::default()));
    let pages: Vec<JoinHandle<()>> = [drive, watch, neglect]
        .into_iter()
        .map(|page: fn(&str, &Seen)| {
            let (address, seen) = (served.address().to_owned(), Arc::clone(&seen));
            spawn(move || page(&address, &seen))
        })
        .collect();

    let (begun, length, mut threads, mut memory) = (Instant::now(), length(), PageThreads::default(), Vec::new());
    while begun.elapsed() < length {
        assert!(pages.iter().all(|page| !page.is_finished()), "a page failed: see above");
        threads.look(process);
        memory.push((begun.elapsed().as_secs_f64(), memory_mb(process)));
        sleep(Duration::from_millis(500));
    }
    let whole = computing(&std::fs::read_to_string(format!("/proc/{process}/stat")).expect("it runs"));
    seen.is_over.store(true, Ordering::Relaxed);
    for page in pages {
        page.join().expect("a page that failed says why above");
    }
    let ending = Instant::now();
    let said = served.terminate();
    println!(
        "it ended within {:.1} s: images that wait for the recording are made and written first",
        ending.elapsed().as_secs_f64()
    );
    let end: Value = serde_json::from_str(said.lines().last().expect("an end")).expect("JSON");

    let memory_at = |part: f64| memory[((memory.len() - 1) as f64 * part) as usize].1;
    println!(
        "memory in MB by eighths: {:.1?}",
        (0..=8).map(|eighth| memory_at(f64::from(eighth) / 8.0)).collect::<Vec<_>>()
    );
    let watched: Vec<_> = memory.iter().filter(|(at, _)| *at > WARM * length.as_secs_f64()).copied().collect();
    let per_minute = 60.0 * slope(&watched);
    let growth = per_minute * (1.0 - WARM) * length.as_secs_f64() / 60.0;
    let most = memory.iter().map(|(_, mb)| *mb).fold(0.0, f64::max);
    println!(
        "{:.0} s: memory {most:.1} MB at most, grows by {per_minute:+.3} MB a minute, {growth:+.1} MB in the watched part",
        length.as_secs_f64()
    );
    let [clouds, matching, asked, done, slow] =
        [&seen.clouds, &seen.matching_ms, &seen.moves_asked, &seen.moves_done, &seen.slow_pages]
            .map(|count| count.load(Ordering::Relaxed));
    let (share, work) = (threads.seconds() / whole, matching as f64 / 1000.0);
    let cores = std::thread::available_parallelism().map_or(1.0, |cores| cores.get() as f64);
    let taken = threads.seconds() / (cores * length.as_secs_f64());
    println!(
        "threads of the panel: {:.2} s of {whole:.1} s of computing of the process ({:.2} %), {:.2} % of what {cores} cores can do; matching and \
         triangulation took {work:.1} s on the clock for {clouds} clouds",
        threads.seconds(),
        100.0 * share,
        100.0 * taken
    );
    println!("{done} of {asked} moves done; the page that never reads came {slow} times; {end}");
    let wrong = |name: &str, counts: &[AtomicU64; 3]| {
        let [wrong, swapped, all] = counts.each_ref().map(|count| count.load(Ordering::Relaxed));
        let share = wrong as f64 / all as f64;
        println!("{name}: {wrong} of {all} matches are wrong ({:.3} %), {swapped} with other partners", 100.0 * share);
        assert!(10 * swapped > 9 * all, "the check finds matches that are wrong");
        share
    };
    if large.is_none() {
        let shares = [wrong("while the stages move", &seen.moving), wrong("in a new mode", &seen.after)];
        assert!(shares.iter().all(|share| *share < WRONG), "{shares:?}");
    }
    assert!(growth < GROWTH_MB || large.is_some(), "memory grows");
    assert!(taken < PAGES_SHARE, "pages cost too much");
    assert!(done + 1 >= asked && done > 2, "an order was lost");

    // Every pulse of the board is a result, skipped for a reason, or open at the end.
    let count = |name: &str| end[name].as_u64().expect("a count");
    let skipped = end["skipped"].as_object().expect("reasons").iter();
    let skipped: u64 = skipped
        .filter(|(reason, _)| !reason.starts_with("image_"))
        .map(|(_, count)| count.as_u64().expect("a count"))
        .sum();
    assert_eq!(count("pulses"), count("clouds") + count("bearings") + skipped + count("open"), "{end}");
    assert!(count("open") <= 10, "{end}");
    if large.is_some() {
        return;
    }
    let (pulses, images, poses) = recorded(&recording);
    println!("recorded without a gap: {pulses} pulses, {images:?} images, {poses} poses");
    // What the recorder has heard and the loop not yet, when both end.
    assert!((count("pulses")..=count("pulses") + 2).contains(&pulses), "{pulses}");
    assert!(images.iter().all(|images| images.abs_diff(pulses) <= 2), "{images:?} of {pulses} pulses");
    assert!(count("clouds") > pulses / 10, "{end}");
}
