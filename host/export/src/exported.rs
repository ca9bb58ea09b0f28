//! What became of an export.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde_json::{Value, json};

/// What was exported.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Exported {
    /// Number of pairs.
    pub pairs: u64,
    /// Number of images of one camera without the other's: left, right.
    pub alone: [u64; 2],
    /// Number of pairs whose pose is not known.
    pub without_pose: u64,
    /// Exposures that were left out, by reason.
    pub skipped: BTreeMap<String, u64>,
    /// Sentences that people should know.
    pub warnings: Vec<String>,
    /// What was written.
    pub out: PathBuf,
}

impl Exported {
    /// One line for people.
    #[must_use]
    pub fn in_words(&self) -> String {
        let [left, right] = self.alone;
        let alone =
            if left + right > 0 { format!(", {left} left and {right} right images alone") } else { String::new() };
        let pose = if self.without_pose > 0 { format!(", {} without pose", self.without_pose) } else { String::new() };
        format!("{} pairs{pose}{alone}{} in {}", self.pairs, self.skipped_in_words(), self.out.display())
    }

    /// What was left out, beginning with a comma; empty where nothing was.
    pub(crate) fn skipped_in_words(&self) -> String {
        self.skipped.iter().map(|(reason, count)| format!(", {count} left out ({reason})")).collect()
    }

    /// The same for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        json!({
            "pairs": self.pairs,
            "left_alone": self.alone[0],
            "right_alone": self.alone[1],
            "without_pose": self.without_pose,
            "skipped": self.skipped,
            "warnings": self.warnings,
            "out": self.out,
        })
    }
}
