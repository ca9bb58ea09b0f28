//! Models fetched from a server: taken up where they broke, checked, recorded. The server is our own, on this machine: the
//! publishers' could not be tried.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and says what it skips"
)]

mod common;

use std::io::{BufRead, BufReader, Write};
use std::net::TcpListener;
use std::path::Path;
use std::sync::{Arc, Mutex};

use common::{fails_with, run_json};
use serde_json::Value;

/// How the server answers.
#[derive(Clone, Copy)]
enum Manner {
    Whole,
    /// It hangs up after so many bytes, whatever it promised.
    Breaks(usize),
    Missing,
}

/// A server of one file; what ranges it was asked for.
struct Server {
    address: String,
    asked: Arc<Mutex<Vec<usize>>>,
}

impl Server {
    fn of(content: Vec<u8>, manner: Manner) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = format!("http://{}/model.onnx", listener.local_addr().expect("an address"));
        let asked = Arc::new(Mutex::new(Vec::new()));
        let noted = Arc::clone(&asked);
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                let mut from = 0;
                let mut lines = BufReader::new(&stream).lines().map_while(Result::ok);
                for line in lines.by_ref().take_while(|line| !line.is_empty()) {
                    let range = line.to_lowercase().strip_prefix("range: bytes=").map(str::to_owned);
                    if let Some(start) = range.as_deref().and_then(|range| range.split('-').next()?.parse().ok()) {
                        from = start;
                    }
                }
                noted.lock().expect("not poisoned").push(from);
                answer(&stream, &content, from, manner);
            }
        });
        Self { address, asked }
    }

    fn asked(&self) -> Vec<usize> {
        self.asked.lock().expect("not poisoned").clone()
    }
}

fn answer(mut stream: impl Write, content: &[u8], from: usize, manner: Manner) {
    let total = content.len();
    let (status, body) = match manner {
        Manner::Missing => ("404 Not Found", &[][..]),
        _ if from >= total => ("416 Range Not Satisfiable", &[][..]),
        _ if from > 0 => ("206 Partial Content", &content[from..]),
        _ => ("200 OK", content),
    };
    let sent = if let Manner::Breaks(after) = manner { &body[..after.min(body.len())] } else { body };
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Length: {}\r\nContent-Range: bytes {from}-{}/{total}\r\nConnection: close\r\n\r\n",
        body.len(),
        total.saturating_sub(1)
    );
    // A client that has hung up is none of the server's business.
    let _ = stream.write_all(head.as_bytes()).and_then(|()| stream.write_all(sent));
}

fn tiny(file: &str) -> Vec<u8> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../networks/tests/tiny");
    std::fs::read(folder.join(file)).expect("a tiny network")
}

#[test]
fn a_broken_download_is_taken_up_and_what_came_first_is_recorded() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = folder.path().to_str().expect("UTF-8");
    let network = tiny("pipeline.onnx");
    let pulled = |server: &Server, more: &[&str], then: &dyn Fn(&[&str]) -> Value| {
        let pull = ["models", "pull", "disk-lightglue", "--models", store, "--json", "--from", &server.address];
        then(&[&pull[..], more].concat())
    };
    let fails = |server: &Server, more: &[&str], code, words: &[&str]| {
        pulled(server, more, &|arguments| {
            fails_with(arguments, code, words);
            Value::Null
        })
    };
    let succeeds = |server: &Server, more: &[&str]| pulled(server, more, &run_json);

    let missing = Server::of(network.clone(), Manner::Missing);
    fails(&missing, &[], 2, &["could not be fetched", &missing.address]);

    let broken = Server::of(network.clone(), Manner::Breaks(100));
    fails(&broken, &[], 2, &["could not be fetched", "the part that came is kept, try again"]);
    let came =
        std::fs::metadata(folder.path().join(".downloads/disk_lightglue_pipeline.ort.onnx")).expect("kept").len();
    assert!((100..network.len() as u64).contains(&came), "{came}");

    let whole = Server::of(network.clone(), Manner::Whole);
    let first = succeeds(&whole, &[]);
    assert_eq!(whole.asked(), [usize::try_from(came).expect("small")], "from where it broke on");
    let manifest = std::fs::read_to_string(folder.path().join("disk-lightglue/model.toml")).expect("it is kept");
    let sha256 = first["sha256"].as_str().expect("a digest");
    assert!(manifest.contains(sha256), "{manifest}");

    let mut other = network;
    *other.last_mut().expect("bytes") ^= 1;
    let changed = Server::of(other, Manner::Whole);
    fails(&changed, &[], 1, &["SHA-256", sha256, "nothing was changed"]);
    fails(&whole, &["--sha256", "00"], 1, &["not 00"]);
    assert_eq!(succeeds(&whole, &["--sha256", sha256])["sha256"], sha256);
}

#[test]
fn what_is_no_network_of_the_right_tensors_is_not_kept() {
    let folder = tempfile::tempdir().expect("a folder");
    let store = folder.path().to_str().expect("UTF-8");
    for (content, words) in
        [(b"<html>Sign in</html>".to_vec(), "cannot be loaded"), (tiny("extractor64.onnx"), "does not fit")]
    {
        let server = Server::of(content, Manner::Whole);
        let pull = ["models", "pull", "disk-lightglue", "--models", store, "--json", "--from", &server.address];
        fails_with(&pull, 2, &[words]);
        assert!(!folder.path().join("disk-lightglue").exists());
        std::fs::remove_dir_all(folder.path().join(".downloads")).expect("what came");
    }
}
