//! The demonstration with modes that the robot chooses itself.

use serde_json::{Value, json};
use vergence_rig::rounded;

use super::joints::Joints;
use super::mission::{Mission, Orders, Outcome, Outlooks, STORY, Step};
use super::target::{Found, Inspected};
use super::{Corridor, Sight, Station, Story, walls};
use crate::error::DemoError;

/// What was told of the mission so far.
#[derive(Default)]
struct Told {
    story: Story,
    stations: usize,
    found: Option<Found>,
    inspected: Option<Inspected>,
}

impl Corridor<'_> {
    /// Runs the mission in the usual corridor with modes by the policy and a trunk that `joints` move, and which stands in spider; `said`
    /// hears each line as it comes.
    ///
    /// # Errors
    /// As [`Self::play`]; also where the target was not found.
    pub fn play_auto(mut self, joints: &mut dyn Joints, said: &mut dyn FnMut(&str)) -> Result<Story, DemoError> {
        let rig = self.rig.clone();
        let outlooks = Outlooks::of(&rig)?;
        let mut told = Told::default();
        let first = self.change(STORY[0], joints, &mut told.story.changes)?;
        let first = format!("{first}; the mission begins");
        said(&first);
        told.story.lines.push(first);
        let sight = Sight::Rendered(self.clock);
        let mission = Mission::new((&outlooks, joints), &self.corridor, Orders::Auto, sight, self.seed);
        let (outcome, stations) = mission.run(&mut |step| {
            for line in self.hear(step, &mut told)? {
                said(&line);
                told.story.lines.push(line);
            }
            Ok(())
        })?;
        let last = in_words(&outcome);
        said(&last);
        let Told { mut story, found, inspected, .. } = told;
        story.lines.push(last);
        story.mission = outcome_json(&outcome);
        self.stations = stations;
        match (found, inspected) {
            (Some(found), Some(inspected)) => self.finish(story, &found, &inspected),
            _ => Err(DemoError::Matching("the target was not found".into())),
        }
    }

    /// Writes what a step shows, and says it.
    fn hear(&self, step: Step<'_>, told: &mut Told) -> Result<Vec<String>, DemoError> {
        Ok(match step {
            Step::Mode { names, seconds, why } => {
                let change = self.changed(names, Some(seconds))?;
                told.story.changes.push(change.json(why));
                why.map(str::to_owned).into_iter().chain([change.in_words()]).collect()
            }
            Step::Measured(task, station) => {
                let name = format!("{}-{}", told.stations, station.mode);
                station.write(&name, self.out).map_err(|error| DemoError::File(error.to_string()))?;
                told.stations += 1;
                measured_in_words(task, station)
            }
            Step::Found(found) => {
                told.found = Some(found.clone());
                vec![format!("  {}", found.in_words())]
            }
            Step::Inspected(inspected) => {
                told.inspected = Some(*inspected);
                vec![format!("  {}", inspected.in_words())]
            }
        })
    }
}

fn measured_in_words(task: &str, station: &Station) -> Vec<String> {
    let walls = station.walls.as_ref().map(walls::Walls::in_words);
    std::iter::once(station.in_words(task)).chain(walls.map(|walls| format!("  {walls}"))).collect()
}

fn in_words(outcome: &Outcome) -> String {
    format!(
        "{} changes of the mode; the robot would have taken {:.0} s, and saw {:.0} % of the free floor",
        outcome.changes,
        outcome.seconds,
        100.0 * outcome.area
    )
}

fn outcome_json(outcome: &Outcome) -> Value {
    json!({
        "seconds": rounded(outcome.seconds),
        "area_seen": rounded(outcome.area),
        "target_error_mm": outcome.target_error_mm.map(rounded),
        "wall_errors_mm": outcome.wall_errors_mm.iter().copied().map(rounded).collect::<Vec<_>>(),
        "walls_missed": outcome.walls_missed,
    })
}
