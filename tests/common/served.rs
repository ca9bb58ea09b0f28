//! A verb that serves the panel, in its own process.
#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use std::io::{BufRead, BufReader, Read};
use std::process::{Child, Stdio};
use std::thread::{JoinHandle, spawn};

use serde_json::Value;

use super::{signal, vergence};

/// A panel in its own process; ends with the value.
pub struct Served {
    process: Child,
    /// Reads on what it says: a pipe that is full would stop it.
    rest: Option<JoinHandle<String>>,
    /// The address of the page.
    pub url: String,
}

impl Served {
    /// Runs the verb in `arguments` until it says where its page is.
    pub fn start(arguments: &[&str]) -> Self {
        let mut process = vergence(arguments).arg("--json").stdout(Stdio::piped()).spawn().expect("the panel starts");
        let mut out = BufReader::new(process.stdout.take().expect("piped"));
        let mut line = String::new();
        out.read_line(&mut line).expect("it says where it is");
        let said: Value = serde_json::from_str(&line).expect("JSON");
        let rest = spawn(move || {
            let mut rest = String::new();
            out.read_to_string(&mut rest).expect("text");
            rest
        });
        Self { process, rest: Some(rest), url: said["url"].as_str().expect("an address").to_owned() }
    }

    /// The number of the process.
    pub fn id(&self) -> u32 {
        self.process.id()
    }

    /// The host and the port of the page.
    pub fn address(&self) -> &str {
        self.url.trim_start_matches("http://").trim_end_matches('/')
    }

    /// Ends as by Ctrl-C, in order; returns what it said after its address.
    pub fn terminate(&mut self) -> String {
        signal(self.process.id(), "-TERM");
        let said = self.rest.take().map(|rest| rest.join().expect("text")).unwrap_or_default();
        assert!(self.process.wait().expect("it was started").success(), "{said}");
        said
    }
}

impl Drop for Served {
    fn drop(&mut self) {
        // A process that has ended already is what we want.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}
