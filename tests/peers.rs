//! Rigs on several machines, each a process of its own, over TCP on this computer. Boards, stages and cameras are simulated; zenoh, the links and what
//! is published are the real ones. The test with Python needs eclipse-zenoh and rosbags; without them it prints `SKIPPED`.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a test fails loudly, shows its figures, and waits for other processes"
)]

mod common;

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, ChildStdout, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use common::browser::{browser, pictures};
use common::{fails_with, python, run, signal, small_bench_toml, text, vergence};
use serde_json::Value;
use vergence_rig::BENCH_TOML;

/// Longest wait for anything that should happen; the machine may be busy.
const PATIENCE: Duration = Duration::from_secs(90);

/// A `vergence` that serves a page, in its own process; ends with the value.
struct Served {
    process: Child,
    _out: BufReader<ChildStdout>,
    page: SocketAddr,
}

impl Served {
    fn start(arguments: &[&str]) -> Self {
        let mut process = vergence(arguments).arg("--json").stdout(Stdio::piped()).spawn().expect("it starts");
        let mut out = BufReader::new(process.stdout.take().expect("piped"));
        let mut line = String::new();
        out.read_line(&mut line).expect("it says where it is");
        let said: Value = serde_json::from_str(&line).expect("JSON");
        let url = said["url"].as_str().expect("an address").trim_start_matches("http://").trim_end_matches('/');
        Self { process, _out: out, page: url.parse().expect("an address") }
    }

    /// A rig in simulation whose cameras are small and slow: there are several, and few cores.
    fn rig(name: &str, peer: &[&str]) -> Self {
        let panel = ["panel", "--port", "sim", "--cameras", "sim", "--size", "320x320", "--rate", "2", "--home"];
        Self::start(&[&panel[..], &["--listen", "127.0.0.1:0", "--publish", name], peer].concat())
    }

    /// The answer to a request, and its body.
    fn ask(&self, method: &str, path: &str, origin: &str) -> (u16, Vec<u8>) {
        let mut stream = TcpStream::connect(self.page).expect("it listens");
        let host = self.page;
        let head = format!("{method} {path} HTTP/1.1\r\nHost: {host}\r\nOrigin: {origin}\r\nConnection: close\r\n\r\n");
        stream.write_all(head.as_bytes()).expect("a request");
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).expect("an answer");
        let body = answer.windows(4).position(|four| four == b"\r\n\r\n").expect("a head") + 4;
        (text(&answer[9..12]).parse().expect("a code"), answer[body..].to_vec())
    }

    fn json(&self, path: &str) -> Value {
        let (code, body) = self.ask("GET", path, "");
        if code == 200 { serde_json::from_slice(&body).expect("JSON") } else { Value::Null }
    }

    /// What a page of rigs says of one.
    fn of(&self, rig: &str) -> Value {
        let all = self.json("/rigs");
        all["rigs"].as_array().into_iter().flatten().find(|known| known["name"] == rig).cloned().unwrap_or_default()
    }

    /// Waits until the page of rigs says so of one.
    fn until(&self, rig: &str, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        until(what, || Some(self.of(rig)).filter(&wanted), || self.of(rig).to_string())
    }

    /// Waits until the rig itself says so.
    fn status(&self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        until(what, || Some(self.json("/status")).filter(&wanted), || self.json("/status").to_string())
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // A process that has ended already is what we want.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

fn until<T>(what: &str, found: impl Fn() -> Option<T>, instead: impl Fn() -> String) -> T {
    let begun = Instant::now();
    loop {
        if let Some(found) = found() {
            return found;
        }
        assert!(begun.elapsed() < PATIENCE, "never: {what}; instead {}", instead());
        std::thread::sleep(Duration::from_millis(100));
    }
}

/// An address for zenoh that is free.
fn free() -> String {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
    format!("tcp/{}", listener.local_addr().expect("an address"))
}

/// A way between two machines, which can be cut.
struct Way {
    /// Where it begins.
    address: String,
    is_open: Arc<AtomicBool>,
}

impl Way {
    /// A way that ends at `to`.
    fn to(to: &str) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = format!("tcp/{}", listener.local_addr().expect("an address"));
        let to: SocketAddr = to.trim_start_matches("tcp/").parse().expect("an address");
        let is_open = Arc::new(AtomicBool::new(true));
        let open = Arc::clone(&is_open);
        std::thread::spawn(move || {
            for near in listener.incoming().flatten() {
                // Where the way is cut, whoever comes is sent away.
                let Some(far) = open.load(Ordering::SeqCst).then(|| TcpStream::connect(to).ok()).flatten() else {
                    continue;
                };
                for (from, to) in [(&near, &far), (&far, &near)] {
                    let (from, to) = (from.try_clone().expect("a socket"), to.try_clone().expect("a socket"));
                    let open = Arc::clone(&open);
                    std::thread::spawn(move || carry(from, to, &open));
                }
            }
        });
        Self { address, is_open }
    }

    fn cut(&self) {
        self.is_open.store(false, Ordering::SeqCst);
    }

    fn heal(&self) {
        self.is_open.store(true, Ordering::SeqCst);
    }
}

/// Carries bytes until the way is cut or either end is gone.
fn carry(mut from: TcpStream, mut to: TcpStream, is_open: &AtomicBool) {
    from.set_read_timeout(Some(Duration::from_millis(50))).expect("a socket");
    let mut bytes = vec![0; 65536];
    while is_open.load(Ordering::SeqCst) {
        match from.read(&mut bytes) {
            Ok(0) => break,
            Ok(count) if to.write_all(&bytes[..count]).is_err() => break,
            Err(error) if !matches!(error.kind(), std::io::ErrorKind::WouldBlock | std::io::ErrorKind::TimedOut) => {
                break;
            }
            _ => {}
        }
    }
    for end in [from, to] {
        // It is closed already where the other direction ended first.
        let _ = end.shutdown(std::net::Shutdown::Both);
    }
}

/// A file in `folder`.
fn written(folder: &Path, name: &str, text: &str) -> String {
    let file = folder.join(name);
    std::fs::write(&file, text).expect("a file");
    file.to_str().expect("a name").to_owned()
}

/// The baseline in millimetres.
fn baseline(status: &Value) -> f64 {
    status["values"][0].as_f64().unwrap_or(f64::NAN)
}

/// The bench with a linear stage so long that it takes five seconds from one mode to the other: a link that is cut on the way stops it.
fn long_bench_toml() -> String {
    let long = BENCH_TOML.replace("\"60mm\", \"220mm\"", "\"60mm\", \"500mm\"");
    long.replacen("baseline = \"145mm\"", "baseline = \"460mm\"", 1)
        .replace("baseline = \"145mm\"", "baseline = \"60mm\"")
}

fn rests_in(mode: &'static str) -> impl Fn(&Value) -> bool {
    move |status| status["state"] == "idle" && status["mode"] == mode && status["doing"].is_null()
}

#[test]
fn three_rigs_are_watched_from_one_page_and_a_cut_link_stops_nothing_but_an_order() {
    let folder = tempfile::tempdir().expect("a folder");
    let known = written(folder.path(), "known", "a secret of more than sixteen letters\n");
    let other = written(folder.path(), "other", "another secret of as many letters");
    let at = free();
    let watcher = Served::start(&["peers", "--page", "127.0.0.1:0", "--peer-listen", &at, "--peer-secret", &known]);
    let way = Way::to(&at);
    let (ordered_at, peer) = (free(), ["--peer", at.as_str()]);
    let long = written(folder.path(), "long.toml", &long_bench_toml());
    let ways = ["--peer", way.address.as_str(), "--peer-listen", &ordered_at, "--peer-secret", &known, "--rig", &long];
    let first = Served::rig("first", &ways);
    let _others = ["second", "third"].map(|name| Served::rig(name, &peer));

    let measures = |rig: &Value| rig["health"] == "ok" && rig["points"].as_u64().is_some_and(|points| points > 20);
    for name in ["first", "second", "third"] {
        let rig = watcher.until(name, "three rigs measure", measures);
        println!("{rig}");
        assert!(rig["sigma_mm"].as_f64().is_some_and(|sigma| sigma > 0.0 && sigma < 1000.0), "{rig}");
        assert_eq!(rig["cameras"]["left"].as_array().map(Vec::len), Some(12), "{rig}");
        assert_eq!(rig["takes_orders"], name == "first");
        let axes = rig["axes"].to_string();
        assert!(axes.contains(" mm") && axes.contains('°'), "{axes}");
    }
    let (code, cloud) = watcher.ask("GET", "/rigs/second/cloud", "");
    let header = u32::from_le_bytes(cloud[..4].try_into().expect("a header")) as usize;
    let told: Value = serde_json::from_slice(&cloud[4..4 + header]).expect("JSON");
    assert_eq!(code, 200);
    assert_eq!(cloud.len() - 4 - header, told["count"].as_u64().expect("a count") as usize * (16 + 13 * 4));

    orders_need_the_secret(&first, &watcher, &ordered_at, [&known, &other]);
    people_see_them(&watcher);
    a_cut_way_stops_an_order(&first, &watcher, &way);
}

fn orders_need_the_secret(first: &Served, watcher: &Served, ordered_at: &str, [known, other]: [&str; 2]) {
    let order = |mode| ["peers", "first", "--peer", ordered_at, "--mode", mode];
    let by = |mode, secret| [&order(mode)[..], &["--peer-secret", secret]].concat();
    fails_with(&order("herbivore"), 3, &["--peer-secret"]);
    fails_with(&by("herbivore", other), 3, &["the secret is another one"]);
    fails_with(&by("owl", known), 3, &["no mode 'owl'"]);
    first.status("it has not moved", |status| status["doing"].is_null() && status["state"] == "idle");
    let done = run(&by("human", known));
    assert!(done.status.success(), "{}", text(&done.stderr));
    first.status("it is where it was sent", rests_in("human"));
    watcher.until("first", "its mode is published", |rig| rig["mode"] == "human");
    // A page of another site cannot give orders, and the page of the rigs can.
    let origin = format!("http://{}", watcher.page);
    assert_eq!(watcher.ask("POST", "/rigs/first/mode/herbivore", "http://evil.example").0, 403);
    let (code, why) = watcher.ask("POST", "/rigs/second/mode/herbivore", &origin);
    assert_eq!(code, 409, "a rig without a secret takes no orders: {}", text(&why));
    assert_eq!(watcher.ask("POST", "/rigs/first/mode/herbivore", &origin), (204, Vec::new()));
    first.status("the page sent it", rests_in("herbivore"));
}

/// A real browser shows the three, the cloud of one, and sends one to a mode.
fn people_see_them(watcher: &Served) {
    let Some((chromium, scripts)) = browser() else { return };
    let mut script = Command::new("node");
    script.arg(scripts.join("rigs.mjs")).args([&chromium, &format!("http://{}/", watcher.page)]).arg(pictures());
    assert!(script.status().expect("node starts").success(), "the browser found a fault: see above");
}

fn a_cut_way_stops_an_order(first: &Served, watcher: &Served, way: &Way) {
    let sent = |rig: &Value| rig["sent"].as_u64().expect("a count");
    std::thread::scope(|scope| {
        let origin = format!("http://{}", watcher.page);
        let ordered = scope.spawn(move || watcher.ask("POST", "/rigs/first/mode/human", &origin));
        first.status("it is on its way", |status| status["state"] == "moving" && baseline(status) < 450.0);
        way.cut();
        let stopped = first.status("nobody asks any more, and it stops", |status| {
            status["state"] == "idle" && status["doing"].is_null()
        });
        println!("cut on the way, it rests at a baseline of {} mm", baseline(&stopped));
        assert!(baseline(&stopped) > 65.0 && baseline(&stopped) < 455.0, "{stopped}");
        let before = watcher.until("first", "the watcher sees that it is silent", |rig| rig["health"] == "silent");
        let (at, is_later) = (stopped["board_us"].clone(), |now: &Value, then: &Value| now.as_u64() > then.as_u64());
        first.status("its board goes on", |status| is_later(&status["board_us"], &at));
        way.heal();
        let healed = watcher.until("first", "it is heard again", |rig| {
            let is_near = rig["heard_s"].as_f64().is_some_and(|age| age < 2.0);
            rig["health"] == "ok" && is_near && rig["sent"] != before["sent"]
        });
        let (code, why) = ordered.join().expect("an answer");
        println!("{code} {}; {} clouds sent before, {} after", text(&why), sent(&before), sent(&healed));
        assert_eq!(code, 409);
        assert!(text(&why).contains("did not reach mode 'human'"), "{}", text(&why));
        // Two clouds a second for more than four seconds; at most three of them after the way was open again.
        assert!(sent(&healed) >= sent(&before) + 5, "it measured while nobody heard: {before} {healed}");
    });
    watcher.until("first", "clouds come again", |rig| rig["cloud_age_s"].as_f64().is_some_and(|age| age < 2.0));
}

/// A Python program on zenoh hears what the rig publishes; what it got is in the recording of the same run, byte by byte, and rosbags decodes it.
#[test]
fn what_is_published_is_what_was_recorded() {
    let Some(python) = python("import zenoh, rosbags", "eclipse-zenoh rosbags") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let rig = folder.path().join("small.toml");
    std::fs::write(&rig, small_bench_toml()).expect("a file");
    let (rig, recording) = (rig.to_str().expect("a name"), folder.path().join("recording"));
    let at = free();
    let board =
        ["run", "--port", "sim", "--rig", rig, "--cameras", "sim", "--home", "--match-time", "100ms", "--rate", "5"];
    let published =
        ["--publish", "bench", "--peer-listen", at.as_str(), "--record", recording.to_str().expect("a name")];
    let mut measuring = vergence(&[&board[..], &published].concat()).stdout(Stdio::null()).spawn().expect("it starts");
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/peers");
    let heard = folder.path().join("heard.pickle");
    let hears = Command::new(&python).arg(script.join("hear.py")).args([at.as_str(), "bench"]).arg(&heard).output();
    signal(measuring.id(), "-INT");
    assert!(measuring.wait().expect("it was started").success());
    let hears = hears.expect("python runs");
    assert!(hears.status.success(), "{}", text(&hears.stderr));
    let compares = Command::new(&python).arg(script.join("compare.py")).arg(&recording).arg(&heard).output();
    let compares = compares.expect("python runs");
    assert!(compares.status.success(), "{}{}", text(&compares.stdout), text(&compares.stderr));
    println!("{}", text(&compares.stdout).trim());
}

/// A program that knows the secret gives an order; one that overheard it gives it again in vain.
#[test]
fn an_order_that_was_overheard_is_refused() {
    let Some(python) = python("import zenoh", "eclipse-zenoh") else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let known = written(folder.path(), "known", "a secret of more than sixteen letters");
    let at = free();
    let rig = Served::rig("bench", &["--peer-listen", &at, "--peer-secret", &known]);
    rig.status("it has its reference", |status| {
        status["referenced"] == serde_json::json!([true, true]) && status["doing"].is_null()
    });
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/peers/order.py");
    let output =
        Command::new(python).arg(script).args([at.as_str(), "bench", &known, "human"]).output().expect("python runs");
    assert!(output.status.success(), "{}{}", text(&output.stdout), text(&output.stderr));
    println!("{}", text(&output.stdout).trim());
    rig.status("it is where it was sent", rests_in("human"));
}

#[test]
fn what_cannot_be_meant_is_refused() {
    let run = ["run", "--port", "sim", "--cameras", "sim", "--home", "--frames", "1", "--publish"];
    fails_with(&[&run[..], &["bench"]].concat(), 2, &["--peer", "--peer-listen"]);
    fails_with(&[&run[..run.len() - 1], &["--peer", "tcp/127.0.0.1:1"]].concat(), 2, &["--publish NAME"]);
    fails_with(&[&run[..], &["a b", "--peer", "tcp/127.0.0.1:1"]].concat(), 2, &["no name for a rig"]);
    fails_with(&[&run[..], &["bench", "--peer", "udp/127.0.0.1:1"]].concat(), 2, &["tcp/HOST:PORT"]);
    fails_with(&[&run[..], &["bench", "--peer-listen", "tcp/0.0.0.0:0"]].concat(), 2, &["--peer-network"]);
    let folder = tempfile::tempdir().expect("a folder");
    let short = written(folder.path(), "short", "guess");
    let peers = ["peers", "bench", "--peer", "tcp/127.0.0.1:1", "--peer-secret"];
    fails_with(&[&peers[..], &[short.as_str()]].concat(), 2, &["at least 16"]);
    fails_with(&[&peers[..], &["/nowhere/secret"]].concat(), 2, &["/nowhere/secret"]);
    fails_with(&["peers", "--page", "0.0.0.0:0", "--peer", "tcp/127.0.0.1:1"], 2, &["this one", "127.0.0.1"]);
    fails_with(&["peers", "--mode", "human", "--peer", "tcp/127.0.0.1:1"], 2, &["one rig"]);
}
