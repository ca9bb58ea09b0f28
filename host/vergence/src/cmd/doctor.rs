//! `vergence doctor`: what is well, what is not, and what to do.

mod board;
mod machine;

use serde_json::{Value, json};

use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;

/// Checks rig file, ports, permissions, cameras, and the board with its link, clock, state and settings. Moves nothing.
/// Each line passes, warns or fails, with the reason and a remedy. Exit code 1 when one fails.
#[derive(Debug, clap::Args)]
pub struct Args {}

/// Result of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    Pass,
    Warn,
    Fail,
}

impl Verdict {
    const ALL: [Self; 3] = [Self::Pass, Self::Warn, Self::Fail];

    fn name(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Warn => "warn",
            Self::Fail => "fail",
        }
    }
}

/// A check and its result.
#[derive(Clone, Debug)]
struct Finding {
    check: &'static str,
    verdict: Verdict,
    reason: String,
    remedy: Option<String>,
}

impl Finding {
    fn pass(check: &'static str, reason: impl Into<String>) -> Self {
        Self { check, verdict: Verdict::Pass, reason: reason.into(), remedy: None }
    }

    fn warn(check: &'static str, reason: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { check, verdict: Verdict::Warn, reason: reason.into(), remedy: Some(remedy.into()) }
    }

    fn fail(check: &'static str, reason: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { check, verdict: Verdict::Fail, reason: reason.into(), remedy: Some(remedy.into()) }
    }

    fn json(&self) -> Value {
        json!({
            "check": self.check, "verdict": self.verdict.name(), "reason": self.reason, "remedy": self.remedy,
        })
    }
}

pub async fn run(_: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let (rig, rig_finding) = machine::rig(globals);
    let globals = &Globals { rig, ..globals.clone() };
    let mut findings = vec![rig_finding];
    findings.extend(machine::cameras());
    let port = machine::port(globals);
    let reachable = port.verdict != Verdict::Fail;
    findings.push(port);
    if reachable {
        findings.extend(board::examine(globals, console).await);
    }
    for Finding { check, verdict, reason, remedy } in &findings {
        console.say(format!("{}  {check:<9} {reason}", verdict.name()))?;
        if let Some(remedy) = remedy {
            console.say(format!("                -> {remedy}"))?;
        }
    }
    let [passed, warned, failed] =
        Verdict::ALL.map(|verdict| findings.iter().filter(|finding| finding.verdict == verdict).count());
    console.say(format!("{passed} passed, {warned} warned, {failed} failed"))?;
    console.result(&json!({
        "checks": findings.iter().map(Finding::json).collect::<Vec<_>>(),
        "passed": passed, "warned": warned, "failed": failed,
    }))?;
    if failed > 0 {
        return Err(Failure::check(format!("{failed} of {} checks failed", findings.len())));
    }
    Ok(())
}
