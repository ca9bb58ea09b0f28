//! Checks of a board and of the machine that it is connected to: what is well, what is not, and what to do.

mod board;
mod machine;

use serde_json::{Value, json};

pub use self::board::{BoardChecks, check_board};
pub use self::machine::{check_port, forbidden};

/// Result of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// All is well.
    Pass,
    /// It works, but not as well as it could.
    Warn,
    /// It does not work.
    Fail,
}

impl Verdict {
    /// All of them, the best first.
    pub const ALL: [Self; 3] = [Self::Pass, Self::Warn, Self::Fail];

    /// Its name, for people and programs.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Pass => "pass",
            Self::Warn => "warn",
            Self::Fail => "fail",
        }
    }
}

/// A check and its result.
#[derive(Clone, Debug)]
pub struct Finding {
    /// What was checked, in one word.
    pub check: &'static str,
    /// The result.
    pub verdict: Verdict,
    /// What was found, as a sentence.
    pub reason: String,
    /// What to do; `None` where all is well.
    pub remedy: Option<String>,
    /// Whether this user lacks the right to use a device.
    pub is_forbidden: bool,
}

impl Finding {
    /// A check that passes.
    pub fn pass(check: &'static str, reason: impl Into<String>) -> Self {
        Self { check, verdict: Verdict::Pass, reason: reason.into(), remedy: None, is_forbidden: false }
    }

    /// A check that passes with a warning.
    pub fn warn(check: &'static str, reason: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { check, verdict: Verdict::Warn, reason: reason.into(), remedy: Some(remedy.into()), is_forbidden: false }
    }

    /// A check that fails.
    pub fn fail(check: &'static str, reason: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { check, verdict: Verdict::Fail, reason: reason.into(), remedy: Some(remedy.into()), is_forbidden: false }
    }

    /// A check that fails because this user lacks the right to use a device.
    pub fn forbidden(check: &'static str, reason: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { is_forbidden: true, ..Self::fail(check, reason, remedy) }
    }

    /// Lines for people: the verdict and its reason, and what to do.
    #[must_use]
    pub fn in_words(&self) -> Vec<String> {
        let Self { check, verdict, reason, remedy, .. } = self;
        let first = format!("{}  {check:<9} {reason}", verdict.name());
        [first].into_iter().chain(remedy.iter().map(|remedy| format!("                -> {remedy}"))).collect()
    }

    /// The finding for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "check": self.check, "verdict": self.verdict.name(), "reason": self.reason, "remedy": self.remedy,
        })
    }
}

/// All `findings` and their counts for people, and for programs as a part of `result`.
#[must_use]
pub fn told(findings: &[Finding], mut result: Value) -> (Vec<String>, Value) {
    let counts = Verdict::ALL.map(|verdict| findings.iter().filter(|finding| finding.verdict == verdict).count());
    let mut lines: Vec<_> = findings.iter().flat_map(Finding::in_words).collect();
    lines.push(format!("{} passed, {} warned, {} failed", counts[0], counts[1], counts[2]));
    result["checks"] = findings.iter().map(Finding::json).collect();
    for (name, count) in ["passed", "warned", "failed"].into_iter().zip(counts) {
        result[name] = json!(count);
    }
    (lines, result)
}
