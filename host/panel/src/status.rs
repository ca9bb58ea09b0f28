//! The board as pages see it: pose, state, fault with its remedy, clock, link.

use std::sync::Arc;
use std::time::Duration;

use serde_json::{Value, json};
use vergence_board::{BoardKnowledge, pose_json, positions};
use vergence_live::LONGEST_UNSEEN;
use vergence_protocol::{AxisKind, ControllerState, Microseconds, PoseReport};
use vergence_rig::{AxisPosition, Rig, RigAxis, rounded};

use crate::hub::{Hub, Task, text_message};
use crate::streams::{Outgoing, Stream};

/// Shortest time between two messages, unless the state changes or a fault comes or goes.
const PACE: Duration = Duration::from_millis(50);

/// Tells the pages of every pose, as often as they have use for it.
pub struct Reporter {
    hub: Arc<Hub>,
    told: Option<(Microseconds, ControllerState, bool)>,
}

impl Reporter {
    /// Reports to the pages of `hub`.
    pub const fn new(hub: Arc<Hub>) -> Self {
        Self { hub, told: None }
    }

    /// Tells of a pose at `now` on the clock of the link, of which `knowledge` is.
    pub fn report(&mut self, rig: &Rig, pose: &PoseReport, knowledge: &BoardKnowledge, now: Microseconds) {
        // Pages have a pace of their own, also where a recording is played faster.
        let told_at = self.hub.clock.now();
        let state = (pose.state, pose.fault.is_some());
        let early = |then: Microseconds| u128::from(told_at.0.saturating_sub(then.0)) < PACE.as_micros();
        if self.told.is_some_and(|(then, before, fault)| early(then) && (before, fault) == state) {
            return;
        }
        self.told = Some((told_at, state.0, state.1));
        let values = positions(rig, pose);
        self.hub.put(Stream::Status, text_message(&self.json(rig, pose, &values, (knowledge, now))));
        self.hub.place.send_replace(Some(values.iter().map(|position| position.value()).collect()));
    }

    fn json(
        &self,
        rig: &Rig,
        pose: &PoseReport,
        values: &[AxisPosition],
        (knowledge, now): (&BoardKnowledge, Microseconds),
    ) -> Value {
        let Task { text, targets } = self.hub.task();
        let in_units = |all: &[AxisPosition]| -> Vec<f64> { all.iter().map(|at| rounded(at.mm_or_deg())).collect() };
        let (map, statistics) = (knowledge.clock_map(), knowledge.statistics());
        let error = map.board_at(now).map(|now| rounded(now.error_us));
        let mut status = pose_json(rig, pose);
        for (name, value) in [
            ("kind", json!("status")),
            ("values", json!(in_units(values))),
            ("targets", json!(targets.as_deref().map(in_units))),
            ("doing", json!(text)),
            (
                "clock",
                json!({
                    "error_us": error, "drift_ppm": map.drift().map(|drift| rounded(drift.ppm)), "lost": map.is_lost(),
                }),
            ),
            (
                "link",
                json!({
                    "round_trip_us": statistics.round_trip.map(|time| time.0),
                    "poses_lost": statistics.poses_lost,
                    "retransmitted": statistics.retransmitted,
                    "dropped": statistics.link.dropped(),
                }),
            ),
        ] {
            status[name] = value;
        }
        status
    }
}

/// Tells the pages that the link has been gone for `gone`: the last status, and how uncertain the positions have become since. Of axes that
/// moved when the link ended nobody knows where they came to rest.
pub fn report_lost(hub: &Hub, gone: Duration) {
    let Some(Outgoing::Text(last)) = hub.latest(Stream::Status) else { return };
    let Ok(mut status) = serde_json::from_str::<Value>(&last) else { return };
    let sigma = |axis: &RigAxis| {
        let sigma = axis.sigma_unseen(gone) * axis.value_per_count();
        rounded(if axis.kind == AxisKind::Linear { sigma } else { sigma.to_degrees() })
    };
    let moved = ["moving", "homing", "stopping"].iter().any(|state| status["state"] == *state);
    let sigmas: Option<Vec<f64>> = (!moved).then(|| hub.setting.rig.axes.iter().map(sigma).collect());
    status["doing"] = Value::Null;
    status["targets"] = Value::Null;
    status["link"]["lost_s"] = json!(rounded(gone.as_secs_f64()));
    status["link"]["sigmas"] = json!(sigmas);
    status["link"]["measures"] = json!(gone < LONGEST_UNSEEN);
    hub.put(Stream::Status, text_message(&status));
}
