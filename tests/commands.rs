//! docs/commands.md is what the program says of itself. After a change of the command line write it anew:
//! `VERGENCE_WRITE_DOCS=1 cargo test -p vergence --test commands`.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

use std::fmt::Write;
use std::path::Path;

use clap::Command;
use vergence::cli::{TASKS, command};

const HEAD: &str = "# Commands

Every verb by task, as `vergence help VERB` prints it. This page is generated from the program; do not edit it.

Options may also stand before the verb: `vergence --port sim home` is `vergence home --port sim`. With `--json` a result is
one JSON object on standard output, and a failure is one on standard error: `{\"error\": {\"kind\": ..., \"exit_code\": ...,
\"message\": ...}}`. The exit code is the same with and without `--json`: 0 ok, 1 check failed, 2 usage or bad input, 3
device, 4 protocol mismatch.
";

/// The help of `command`, which is reached by `path`, and of the verbs inside it.
fn describe(command: &Command, path: &str, page: &mut String) {
    let mut shown = command.clone().bin_name(path).mut_args(|argument| argument.hide_env_values(true));
    let help = shown.render_long_help().to_string();
    let lines: Vec<&str> = help.lines().map(str::trim_end).collect();
    let _ = write!(page, "\n### {path}\n\n```text\n{}\n```\n", lines.join("\n").trim_end());
    for inner in command.get_subcommands().filter(|inner| inner.get_name() != "help") {
        describe(inner, &format!("{path} {}", inner.get_name()), page);
    }
}

#[test]
fn the_page_of_commands_is_what_the_program_says() {
    let mut whole = command();
    whole.build();
    let mut page = HEAD.to_owned();
    for (task, verbs) in TASKS {
        let _ = write!(page, "\n## {task}\n");
        for verb in verbs.iter().filter(|verb| **verb != "help") {
            let verb = whole.find_subcommand(verb).unwrap_or_else(|| panic!("{verb} is missing"));
            describe(verb, &format!("vergence {}", verb.get_name()), &mut page);
        }
    }
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/commands.md");
    if std::env::var_os("VERGENCE_WRITE_DOCS").is_some() {
        std::fs::write(&path, &page).expect("the page is written");
    }
    let kept = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        kept == page,
        "docs/commands.md is out of date: VERGENCE_WRITE_DOCS=1 cargo test -p vergence --test commands"
    );
}
