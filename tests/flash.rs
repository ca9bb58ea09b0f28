//! Stories of firmware updates: a simulated board in one process, `vergence flash` in others, and what can go wrong.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod common;

use std::io::{Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::os::unix::fs::PermissionsExt;
use std::process::{Command, Output, Stdio};
use std::sync::mpsc;
use std::thread::spawn;

use common::images::{ARM, START, Workshop, application, elf};
use common::{Simulator, signal, text, vergence};
use serde_json::Value;

/// So many bytes without a pattern, different for each `seed` (Knuth's MMIX generator).
fn noise(length: usize, seed: u64) -> Vec<u8> {
    let mut state = seed;
    let next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    };
    std::iter::repeat_with(next).take(length).collect()
}

/// A board that trusts one key, and images signed by it.
struct Story {
    workshop: Workshop,
    secret: String,
    public: String,
}

impl Story {
    fn new() -> Self {
        let workshop = Workshop::new();
        let [secret, public] = workshop.key("rig.key");
        Self { workshop, secret, public }
    }

    fn board(&self, listen: &[&str]) -> Simulator {
        Simulator::start(&[listen, &["--trust", &self.public]].concat())
    }

    fn image(&self, version: &str, length: usize, seed: u64) -> (String, Value) {
        let name = format!("{version}-{seed}.vimg");
        self.workshop.sign(&noise(length, seed), &self.secret, "native-sim", version, &name)
    }
}

fn fails(output: &Output, code: i32, words: &[&str]) {
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{said}");
    words.iter().for_each(|word| assert!(said.contains(word), "should mention '{word}': {said}"));
}

/// What runs, as an update or rollback reports it.
fn runs(said: &Value) -> [&str; 2] {
    ["version", "boot"].map(|field| said["after"][field].as_str().expect("a word"))
}

#[test]
fn from_old_to_new_and_back() {
    let story = Story::new();
    let board = story.board(&["--pty"]);
    let ((old, _), (new, made)) = (story.image("1.0.0", 30_001, 1), story.image("1.1.0", 41_000, 2));
    let first = board.json(&["flash", "--serial", &old]);
    assert_eq!((&first["before"]["version"], runs(&first)), (&"0.1.0".into(), ["1.0.0", "confirmed"]));
    let second = board.json(&["flash", "--serial", &new]);
    assert_eq!((runs(&second), &second["after"]["build"]), (["1.1.0", "confirmed"], &made["build"]));
    assert_eq!((&second["sent_from"], &second["link_losses"]), (&0.into(), &0.into()));
    let status = board.json(&["status"]);
    assert_eq!((&status["firmware"], &status["build"]), (&"1.1.0".into(), &made["build"]));
    assert_eq!((&status["state"], &status["reset"]), (&"idle".into(), &"Software".into()));
    assert_eq!(runs(&board.json(&["flash", "--serial", &old])), ["1.0.0", "confirmed"], "older, but not too old");

    assert_eq!(runs(&board.json(&["flash", "--rollback"])), ["1.1.0", "reverted"]);
    fails(&board.run(&["flash", "--rollback"]), 3, &["no earlier image"]);
    assert_eq!(runs(&board.json(&["flash", "--confirm"])), ["1.1.0", "confirmed"]);
    // After an update the rig works as before.
    board.json(&["home"]);
}

#[test]
fn what_must_not_run_is_refused_and_the_board_stays_as_it_was() {
    let story = Story::new();
    let board = story.board(&["--pty"]);
    let [stranger, _] = story.workshop.key("stranger.key");
    let sign = |key: &str, hardware: &str, version: &str, content: &[u8]| {
        story.workshop.sign(content, key, hardware, version, "bad.vimg").0
    };
    let flash = |image: &str| board.run(&["flash", "--serial", image]);
    let bytes = noise(5_000, 3);
    fails(&flash(&sign(&stranger, "native-sim", "1.0.0", &bytes)), 2, &["not signed with a key the board trusts"]);
    fails(&flash(&sign("development", "native-sim", "1.0.0", &bytes)), 2, &["not signed with a key"]);
    let wrong = sign(&story.secret, "nucleo-g474", "1.0.0", &application());
    fails(&flash(&wrong), 2, &["for nucleo-g474, the board is native-sim"]);
    fails(&flash(&sign(&story.secret, "native-sim", "0.0.9", &bytes)), 2, &["0.0.9", "accepts 0.1.0 and newer"]);
    fails(&flash(&story.workshop.file("unsigned.bin", &bytes)), 2, &["unsigned.bin", "no signed image"]);
    fails(&flash("/nowhere/image"), 2, &["/nowhere/image"]);
    let mut damaged = std::fs::read(sign(&story.secret, "native-sim", "1.0.0", &bytes)).expect("an image");
    *damaged.last_mut().expect("a byte") ^= 1;
    fails(&flash(&story.workshop.file("damaged.vimg", &damaged)), 2, &["damaged"]);
    fails(&board.run(&["flash"]), 2, &["--serial"]);

    assert_eq!(board.json(&["status"])["firmware"], "0.1.0");
    assert_eq!(runs(&board.json(&["flash", "--serial", &story.image("1.0.0", 5_000, 4).0])), ["1.0.0", "confirmed"]);
}

#[test]
fn an_image_that_nobody_confirms_goes_back() {
    let story = Story::new();
    let board = story.board(&["--pty"]);
    let (image, _) = story.image("2.0.0", 9_000, 5);
    let on_trial = || assert_eq!(runs(&board.json(&["flash", "--serial", &image, "--no-confirm"])), ["2.0.0", "trial"]);
    on_trial();
    assert_eq!(board.json(&["status"])["state"], "firmware on trial");
    fails(&board.run(&["home"]), 3, &["trial"]);
    fails(&board.run(&["flash", "--serial", &image]), 3, &["on trial", "--confirm"]);
    assert_eq!(runs(&board.json(&["flash", "--restart"])), ["0.1.0", "reverted"]);
    on_trial();
    assert_eq!(runs(&board.json(&["flash", "--rollback"])), ["0.1.0", "reverted"]);
    on_trial();
    board.json(&["flash", "--confirm"]);
    assert_eq!(runs(&board.json(&["flash", "--restart"])), ["2.0.0", "confirmed"]);
}

/// A line between host and board. Each connection carries so many bytes of the host, then it is cut, or held up for ever
/// where it is the last: that is told to the caller, who drops what it was given to cut the line.
fn line(board: &str, carries: Vec<usize>) -> (String, mpsc::Receiver<TcpStream>) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("an address");
    let port = format!("tcp:{}", listener.local_addr().expect("an address"));
    let board = board.trim_start_matches("tcp:").to_owned();
    let (tell, held) = mpsc::channel();
    spawn(move || {
        let last = carries.len() - 1;
        for (index, carries) in carries.into_iter().enumerate() {
            let (host, _) = listener.accept().expect("a host");
            let wire = TcpStream::connect(&board).expect("the board");
            let back = [wire.try_clone(), host.try_clone()].map(|stream| stream.expect("a second handle"));
            spawn(move || {
                let [mut wire, mut host] = back;
                let _ = std::io::copy(&mut wire, &mut host);
                let _ = host.shutdown(Shutdown::Both);
            });
            let (mut limited, mut to_board) = (host.try_clone().expect("a handle").take(carries as u64), &wire);
            let _ = std::io::copy(&mut limited, &mut to_board).and_then(|_| to_board.flush());
            if index == last && limited.limit() == 0 {
                let _ = tell.send(wire);
            } else {
                let _ = (wire.shutdown(Shutdown::Both), host.shutdown(Shutdown::Both));
            }
        }
    });
    (port, held)
}

#[test]
fn a_link_cut_in_mid_upload_is_taken_up_again() {
    let story = Story::new();
    let board = story.board(&["--tcp", "127.0.0.1:0"]);
    let (image, made) = story.image("1.0.0", 60_000, 6);
    let (port, _held) = line(&board.port, vec![20_000, 25_000, usize::MAX]);
    let output = vergence(&["--port", &port, "flash", "--serial", &image, "--json"]).output().expect("the binary runs");
    assert!(output.status.success(), "{}", text(&output.stderr));
    assert!(text(&output.stderr).contains("goes on where it stopped"));
    let said: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!((&said["link_losses"], &said["after"]["build"]), (&2.into(), &made["build"]));
    assert_eq!(runs(&said), ["1.0.0", "confirmed"]);
}

#[test]
fn a_host_that_dies_in_mid_upload_is_followed_by_one_that_goes_on() {
    let story = Story::new();
    let board = story.board(&["--tcp", "127.0.0.1:0"]);
    let (image, _) = story.image("1.0.0", 60_000, 7);
    let (port, held) = line(&board.port, vec![20_000]);
    let mut host = vergence(&["--port", &port, "flash", "--serial", &image]).spawn().expect("the binary runs");
    let wire = held.recv().expect("the line is held up");
    host.kill().expect("killed");
    host.wait().expect("gone");
    drop((wire.shutdown(Shutdown::Both), wire));
    let said = board.json(&["flash", "--serial", &image]);
    let from = said["sent_from"].as_u64().expect("a place");
    assert!((15_000..20_000).contains(&from), "it went on at {from}");
    assert_eq!(runs(&said), ["1.0.0", "confirmed"]);
}

#[test]
fn an_interrupted_update_says_what_is_left_and_how_to_go_on() {
    let story = Story::new();
    let board = story.board(&["--tcp", "127.0.0.1:0"]);
    let (image, _) = story.image("1.0.0", 60_000, 8);
    let (port, held) = line(&board.port, vec![20_000]);
    let mut command = vergence(&["--port", &port, "flash", "--serial", &image]);
    let host = command.stderr(Stdio::piped()).spawn().expect("the binary runs");
    let wire = held.recv().expect("the line is held up");
    #[allow(clippy::disallowed_methods, reason = "how long a process takes to end")]
    let asked = std::time::Instant::now();
    signal(host.id(), "-INT");
    let output = host.wait_with_output().expect("it ends");
    assert!(asked.elapsed().as_secs_f64() < 1.0, "it took {:?}", asked.elapsed());
    fails(&output, 3, &["of 60000 bytes", "old image", "same command again", "flash --restart"]);
    drop((wire.shutdown(Shutdown::Both), wire));
    let said = board.json(&["flash", "--serial", &image]);
    let from = said["sent_from"].as_u64().expect("a place");
    assert!((15_000..20_000).contains(&from), "it went on at {from}");
}

/// A stand-in for probe-rs that writes down what it is told and keeps what it should download.
fn probe_rs(workshop: &Workshop, version: &str, download: &str) -> String {
    let folder = workshop.path("bin");
    std::fs::create_dir_all(&folder).expect("a folder");
    let script = format!(
        "#!/bin/sh\nPATH=/usr/bin:/bin\n[ \"$1\" = --version ] && echo 'probe-rs {version} (git commit: abc)' && exit\n\
         echo \"$@\" >> '{folder}/log'\n[ \"$1\" != download ] && exit\nfor last; do :; done\ncp \"$last\" '{folder}/got'\n\
         {download}\n"
    );
    let path = format!("{folder}/probe-rs");
    std::fs::write(&path, script).expect("written");
    std::fs::set_permissions(&path, std::fs::Permissions::from_mode(0o755)).expect("may be run");
    folder
}

fn with_path(mut command: Command, path: &str) -> Output {
    command.env("PATH", path).stdin(Stdio::null()).output().expect("the binary runs")
}

#[test]
fn a_debug_probe_writes_image_and_seal_and_the_board_is_asked() {
    let story = Story::new();
    let board = story.board(&["--pty"]);
    let [(same, _), (image, made)] = [("native-sim", "native.vimg"), ("nucleo-g474", "nucleo.vimg")]
        .map(|(hardware, name)| story.workshop.sign(&application(), &story.secret, hardware, "1.0.0", name));
    let path = probe_rs(&story.workshop, "0.32.0", "");
    let flash = |file: &str| with_path(board.command(&["flash", "--swd", file, "--json"]), &path);

    fails(&flash(&image), 1, &["another board", "0123456789abcdef"]);
    // The simulated board cannot be written by a probe: it gets the same build another way.
    board.json(&["flash", "--serial", &same]);
    let output = flash(&image);
    assert!(output.status.success(), "{}", text(&output.stderr));
    let said: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    assert_eq!(said["after"]["build"], made["build"]);

    let log = std::fs::read_to_string(format!("{path}/log")).expect("a log");
    let told: Vec<&str> = log.lines().collect();
    let download =
        "download --chip STM32G474RETx --non-interactive --verify --binary-format bin --base-address 0x0800e800";
    assert!(told[0].starts_with(download), "{log}");
    assert_eq!(told[1], "reset --chip STM32G474RETx --non-interactive");
    let got = std::fs::read(format!("{path}/got")).expect("what was downloaded");
    let file = std::fs::read(&image).expect("an image");
    let (state, active) = got.split_at(4_096);
    assert!(state.iter().all(|&byte| byte == 0xFF), "no swap may be under way");
    // A seal, a page of its own, then the image.
    assert_eq!((&active[..128], &active[2_048..]), (&file[..128], &file[128..]));

    // The boot loader itself.
    let boot_loader = story.workshop.file("boot.elf", &elf(ARM, &[(0x0800_0000, &[1; 64])]));
    assert!(flash(&boot_loader).status.success());
    let log = std::fs::read_to_string(format!("{path}/log")).expect("a log");
    assert!(log.contains("--binary-format elf") && log.contains("boot.elf"), "{log}");
}

#[test]
fn what_a_debug_probe_cannot_do_is_told() {
    let story = Story::new();
    let board = story.board(&["--pty"]);
    let (image, _) = story.workshop.sign(&application(), &story.secret, "nucleo-g474", "1.0.0", "nucleo.vimg");
    let flash = |file: &str, path: &str| with_path(board.command(&["flash", "--swd", file]), path);
    fails(&flash(&image, "/nowhere"), 3, &["probe-rs is not installed", "cargo install probe-rs-tools"]);
    for old in ["0.31.2", "new"] {
        let path = probe_rs(&story.workshop, old, "");
        fails(&flash(&image, &path), 3, &[old, "0.32 or newer"]);
    }
    let errors = [
        ("Error: No connected probes were found.", "no debug probe is connected"),
        ("Error: Permission denied (os error 13)", "udev rules"),
        ("Error: Multiple probes found", "--probe"),
        ("Error: Resource busy", "in use by another program"),
        ("Error: Verification failed", "flash does not hold"),
        ("Error: Connecting to the chip was unsuccessful.", "the chip does not answer"),
        ("Error: it rains", "probe-rs said: Error: it rains"),
    ];
    for (says, meant) in errors {
        let path = probe_rs(&story.workshop, "0.33.1", &format!("echo '{says}' >&2; exit 1"));
        fails(&flash(&image, &path), 3, &[meant, says]);
    }
    let path = probe_rs(&story.workshop, "1.0.0", "");
    let unsealed = story.workshop.file("app.elf", &elf(ARM, &[(START, &application())]));
    fails(&flash(&unsealed, &path), 2, &["app.elf", "vergence image sign"]);
    fails(&flash(&story.image("1.0.0", 100, 8).0, &path), 2, &["for native-sim"]);
    fails(&flash(&story.workshop.file("raw.bin", &[1; 100]), &path), 2, &["no signed image"]);
}
