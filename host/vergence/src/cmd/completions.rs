//! `vergence completions SHELL`: the verbs and options, for a shell.

use clap_complete::{Shell, generate};
use serde_json::json;

use crate::cli;
use crate::console::Console;
use crate::failure::Failure;

/// Prints the script on standard output. For bash:
/// vergence completions bash > ~/.local/share/bash-completion/completions/vergence
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The shell.
    shell: Shell,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let mut script = Vec::new();
    generate(args.shell, &mut cli::command(), "vergence", &mut script);
    let script = String::from_utf8_lossy(&script);
    console.say(script.trim_end())?;
    console.result(&json!({ "shell": args.shell.to_string(), "script": script }))
}
