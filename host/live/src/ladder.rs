//! What the live loop does without: each loss is a rung down, and is told when it comes and when it is over.

use std::fmt;

use serde_json::{Value, json};
use tokio::time::Instant;
use vergence_board::BoardKnowledge;
use vergence_pipeline::{Observation, PointLimit, SkipReason};
use vergence_rig::Rig;

use crate::live_loop::LiveResult;
use crate::pace::Limit;
use crate::posed::LONGEST_UNSEEN;

/// The rate is judged from so many results on.
const RATED: u64 = 4;
/// A limit below this part of all points is told.
const TOLD_LIMIT: f64 = 0.9;

/// A rung of the ladder, from the smallest loss to the largest.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Rung {
    /// Fewer points are looked for, so that every exposure is measured.
    FewerPoints,
    /// Exposures are skipped, because newer ones come while one is measured.
    LowerRate,
    /// No encoder tells an axis: the images do.
    EncoderLost,
    /// One camera is dead: the other gives bearings.
    CameraLost,
    /// The link to the board ended: the last pose is used, less and less surely.
    LinkLost,
    /// The link has been gone for too long: nothing is measured.
    NothingMeasured,
}

impl Rung {
    /// The name in reports.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::FewerPoints => "fewer_points",
            Self::LowerRate => "lower_rate",
            Self::EncoderLost => "encoder_lost",
            Self::CameraLost => "camera_lost",
            Self::LinkLost => "link_lost",
            Self::NothingMeasured => "nothing_measured",
        }
    }

    /// What a result was made without.
    #[must_use]
    pub fn of(result: &LiveResult<'_>) -> Vec<Self> {
        let (measurement, is_unseen) = (result.measurement, result.measurement.unseen.is_some());
        let (alone, by_images) = match &measurement.observation {
            Observation::Bearings { .. } => (true, false),
            Observation::Points { by_images, .. } => (false, !by_images.is_empty()),
        };
        let is_slow = result.pace.is_some_and(|(_, limit)| limit == Limit::Matching);
        let rungs = [
            (result.limited.is_some(), Self::FewerPoints),
            (is_slow, Self::LowerRate),
            (by_images && !is_unseen, Self::EncoderLost),
            (alone, Self::CameraLost),
            (is_unseen, Self::LinkLost),
        ];
        rungs.into_iter().filter_map(|(is_down, rung)| is_down.then_some(rung)).collect()
    }
}

/// A step on the ladder.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// What was lost or is back.
    pub rung: Rung,
    /// Whether it was lost.
    pub is_down: bool,
}

/// A sentence for people, and the step that it tells of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Notice {
    /// The sentence.
    pub text: String,
    /// The step; `None` of other sentences.
    pub step: Option<Step>,
}

impl Notice {
    /// Of a step down or up.
    pub(crate) fn step(rung: Rung, is_down: bool, text: impl Into<String>) -> Self {
        Self { text: text.into(), step: Some(Step { rung, is_down }) }
    }

    /// The step for programs, as a line of a run; `None` of other sentences.
    #[must_use]
    pub fn json(&self) -> Option<Value> {
        let Step { rung, is_down } = self.step?;
        Some(json!({ "kind": "status", "rung": rung.as_str(), "lost": is_down, "text": self.text }))
    }
}

impl From<String> for Notice {
    fn from(text: String) -> Self {
        Self { text, step: None }
    }
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

/// What was lost so far, of all but the cameras.
#[derive(Debug, Default)]
pub(crate) struct Ladder {
    results: u64,
    has_few: bool,
    is_slow: bool,
    /// Indices of the axes that no encoder tells.
    lost: Vec<usize>,
    unlinked: Option<Instant>,
    is_over: bool,
}

impl Ladder {
    /// Takes a result: whether it has fewer points, and whether the rate is lower than the cameras give.
    pub fn note_result(&mut self, result: &LiveResult<'_>, mut tell: impl FnMut(Notice)) {
        self.results += 1;
        self.note_limit(result.limited).into_iter().for_each(&mut tell);
        if let Some((rate, limit)) = result.pace.filter(|_| self.results >= RATED) {
            let skipped = result.totals.skipped.get(&SkipReason::NewerCame).copied().unwrap_or_default();
            let is_vain = result.limited.is_some_and(|limited| !limited.helps);
            self.note_pace(rate, (limit, is_vain), skipped).into_iter().for_each(tell);
        }
    }

    /// A limit that comes and goes near all points is not told each time.
    fn note_limit(&mut self, limited: Option<PointLimit>) -> Option<Notice> {
        match limited {
            Some(PointLimit { most, of, .. }) if !self.has_few && (most as f64) < TOLD_LIMIT * of as f64 => {
                self.has_few = true;
                let text =
                    format!("fewer points: at most {most} of {of} are looked for, so that every exposure is measured");
                Some(Notice::step(Rung::FewerPoints, true, text))
            }
            None if std::mem::take(&mut self.has_few) => {
                Some(Notice::step(Rung::FewerPoints, false, "there is time for all points again"))
            }
            _ => None,
        }
    }

    /// It is vain to look for fewer points where a pair takes the whole period without any.
    fn note_pace(&mut self, rate: f64, (limit, is_vain): (Limit, bool), skipped: u64) -> Option<Notice> {
        let is_slow = limit == Limit::Matching;
        if std::mem::replace(&mut self.is_slow, is_slow) == is_slow {
            return None;
        }
        let text = if is_slow {
            let whatever = if is_vain { ", whatever its points" } else { "" };
            format!(
                "lower rate: {rate:.1} Hz, because matching takes longer than the next exposure{whatever}; {skipped} skipped so far"
            )
        } else {
            format!("full rate again: {rate:.1} Hz, every exposure is measured")
        };
        Some(Notice::step(Rung::LowerRate, is_slow, text))
    }

    /// Looks at what the board tells.
    pub fn note_board(&mut self, rig: &Rig, board: &BoardKnowledge, mut tell: impl FnMut(Notice)) {
        self.note_link(board.has_ended(), &mut tell);
        let lost: Vec<usize> = board.lost_axes().iter().map(|lost| lost.axis).collect();
        // A link that is back knows nothing of the faults before it, and has told of itself.
        if self.unlinked.is_some() || lost == self.lost {
            return;
        }
        let names = |axes: &[usize]| -> String {
            let names = axes.iter().filter_map(|axis| rig.axes.get(*axis)).map(|axis| axis.name.as_str());
            names.collect::<Vec<_>>().join(" and ")
        };
        tell(if lost.len() > self.lost.len() {
            let text = format!("no encoder tells {}: the images tell it, as soon as the stages stand", names(&lost));
            Notice::step(Rung::EncoderLost, true, text)
        } else {
            let text = format!("an encoder tells {} again", names(&self.lost));
            Notice::step(Rung::EncoderLost, !lost.is_empty(), text)
        });
        self.lost = lost;
    }

    fn note_link(&mut self, has_ended: bool, tell: &mut impl FnMut(Notice)) {
        let longest = LONGEST_UNSEEN.as_secs();
        match self.unlinked {
            None if has_ended => {
                self.unlinked = Some(Instant::now());
                let text =
                    format!("the link to the board ended: for {longest} s the last pose is used, less and less surely");
                tell(Notice::step(Rung::LinkLost, true, text));
            }
            Some(since) if has_ended && !self.is_over && since.elapsed() > LONGEST_UNSEEN => {
                self.is_over = true;
                let text = format!("the link has been gone for {longest} s: nothing is measured until it is back");
                tell(Notice::step(Rung::NothingMeasured, true, text));
            }
            Some(since) if !has_ended => {
                self.unlinked = None;
                if std::mem::take(&mut self.is_over) {
                    tell(Notice::step(Rung::NothingMeasured, false, "it is measured again"));
                }
                let text = format!(
                    "the link to the board is back after {:.1} s: its readings tell the pose again",
                    since.elapsed().as_secs_f64()
                );
                tell(Notice::step(Rung::LinkLost, false, text));
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use vergence_board::BoardNews;
    use vergence_rig::BENCH_TOML;

    use super::*;

    #[test]
    fn a_link_that_ends_and_comes_back_is_told_once_each() {
        let Ok(rig) = Rig::from_toml(BENCH_TOML) else { panic!("the bench is a rig") };
        let (board, mut ladder) = (BoardKnowledge::new(None), Ladder::default());
        let mut steps = |board: &BoardKnowledge| {
            let mut steps = Vec::new();
            ladder.note_board(&rig, board, |notice| steps.extend(notice.step));
            steps
        };
        assert_eq!(steps(&board), []);
        let step = |is_down| [Step { rung: Rung::LinkLost, is_down }];
        board.note(&BoardNews::LinkEnded);
        assert_eq!((&steps(&board)[..], steps(&board)), (&step(true)[..], Vec::new()));
        board.note(&BoardNews::LinkBack);
        assert_eq!((&steps(&board)[..], steps(&board)), (&step(false)[..], Vec::new()));
    }
}
