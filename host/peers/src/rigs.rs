//! What is known of the rigs that are watched: the latest of each.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use serde_json::{Value, json};
use vergence_board::HostClock;
use vergence_panel::Outgoing;
use vergence_recording::{DIAGNOSTICS, JOINTS, POINTS, TRANSFORMS, Topic};
use vergence_rig::rounded;

use crate::decode::{Cloud, CloudFigures, DecodedHealth, diagnostics, joints, transforms};
use crate::keys::Attachment;
use crate::transport::Arrived;
use crate::units::in_words;

/// A rig says how it is every second; after this time it is silent.
const SILENT: Duration = Duration::from_secs(4);
/// Rigs that are kept; more are no laboratory.
const MOST_RIGS: usize = 64;
/// Grades of a `diagnostic_msgs/DiagnosticStatus`.
const GRADES: [&str; 4] = ["ok", "warning", "error", "stale"];

/// The rigs that are watched.
pub struct Rigs {
    wanted: Vec<String>,
    clock: HostClock,
    seen: Mutex<BTreeMap<String, Seen>>,
}

/// What is known of one.
#[derive(Clone, Debug, Default)]
struct Seen {
    heard: Duration,
    health: Vec<DecodedHealth>,
    joints: Vec<(String, f64)>,
    frames: BTreeMap<String, Vec<f64>>,
    cloud: Option<(Duration, CloudFigures, Vec<u8>)>,
    clouds: u64,
    /// The publisher and the number of the last message, by topic.
    last: BTreeMap<&'static str, ([u8; 16], i64)>,
    /// Messages that never came, by their numbers.
    lost: u64,
}

impl Rigs {
    /// The rigs with these names; without one, all that publish.
    #[must_use]
    pub fn new(wanted: &[String]) -> Self {
        Self { wanted: wanted.to_vec(), clock: HostClock::start(), seen: Mutex::default() }
    }

    /// A poisoned lock only means that another thread panicked; each entry is replaced whole.
    fn lock(&self) -> MutexGuard<'_, BTreeMap<String, Seen>> {
        self.seen.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn now(&self) -> Duration {
        Duration::from_micros(self.clock.now().0)
    }

    /// Takes a message; what is none of a watched rig counts for nothing.
    pub(crate) fn take(&self, Arrived { key, payload, attachment }: Arrived) {
        // Domain, rig, topic, type, hash.
        let mut parts = key.split('/').skip(1);
        let (Some(name), Some(topic)) = (parts.next(), parts.next()) else { return };
        let topics = [POINTS, JOINTS, TRANSFORMS, DIAGNOSTICS];
        let Some(topic) = topics.into_iter().find(|known| known.name.trim_start_matches('/') == topic) else { return };
        let now = self.now();
        let mut all = self.lock();
        let is_wanted = self.wanted.is_empty() || self.wanted.iter().any(|wanted| wanted == name);
        if !is_wanted || (all.len() >= MOST_RIGS && !all.contains_key(name)) {
            return;
        }
        let seen = all.entry(name.to_owned()).or_default();
        if seen.note(topic, payload, now).is_some() {
            seen.heard = now;
            seen.count(topic, attachment.as_deref().and_then(Attachment::read));
        }
    }

    /// All of it, each rig with how long ago it was heard.
    #[must_use]
    pub fn json(&self) -> Value {
        let (now, seen) = (self.now(), self.lock().clone());
        let unheard = self.wanted.iter().filter(|name| !seen.contains_key(*name));
        let unheard = unheard.map(|name| json!({ "name": name, "health": "unheard", "message": "never heard" }));
        let rigs: Vec<_> = seen.iter().map(|(name, seen)| seen.json(name, now)).chain(unheard).collect();
        json!({ "kind": "rigs", "rigs": rigs })
    }

    /// A line for people for each rig.
    #[must_use]
    pub fn lines(&self) -> Vec<String> {
        let all = self.json();
        let text = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
        let line = |rig: &Value| {
            let figure = |name: &str, unit: &str| match &rig[name] {
                Value::Null => "-".to_owned(),
                value => format!("{}{unit}", text(value)),
            };
            format!(
                "{:<16} {:<8} {:<12} {:>6} points, sigma {:>9}, {:>7} old; {}",
                text(&rig["name"]),
                text(&rig["health"]),
                figure("mode", ""),
                figure("points", ""),
                figure("sigma_mm", " mm"),
                figure("cloud_age_s", " s"),
                text(&rig["message"]),
            )
        };
        all["rigs"].as_array().into_iter().flatten().map(line).collect()
    }

    /// The newest cloud of a rig, for the page.
    #[must_use]
    pub fn cloud(&self, name: &str) -> Option<Outgoing> {
        let seen = self.lock().get(name)?.clone();
        let (_, _, message) = seen.cloud?;
        let frame = |frame: &str| seen.frames.get(frame).map(Vec::as_slice);
        Some(Cloud::read(&message)?.page_message(frame("left"), frame("right")))
    }
}

impl Seen {
    /// Keeps what a message says; `None` where it is no message of its topic.
    fn note(&mut self, topic: Topic, payload: Vec<u8>, now: Duration) -> Option<()> {
        if topic == POINTS {
            let figures = Cloud::read(&payload)?.figures();
            self.cloud = Some((now, figures, payload));
            self.clouds += 1;
        } else if topic == JOINTS {
            self.joints = joints(&payload)?;
        } else if topic == TRANSFORMS {
            self.frames = transforms(&payload)?.into_iter().collect();
        } else {
            self.health = diagnostics(&payload)?;
        }
        Some(())
    }

    fn count(&mut self, topic: Topic, attachment: Option<Attachment>) {
        let Some(Attachment { sequence, publisher, .. }) = attachment else { return };
        // A rig that was started again counts anew.
        if let Some((_, before)) =
            self.last.insert(topic.name, (publisher, sequence)).filter(|(of, _)| *of == publisher)
        {
            self.lost += u64::try_from(sequence.saturating_sub(before).saturating_sub(1)).unwrap_or(0);
        }
    }

    fn value(&self, key: &str) -> Option<&str> {
        let values = self.health.iter().flat_map(|part| &part.values);
        values.filter(|(known, _)| known == key).map(|(_, value)| value.as_str()).next()
    }

    fn json(&self, name: &str, now: Duration) -> Value {
        let age = |then: Duration| rounded(now.saturating_sub(then).as_secs_f64());
        let worst = self.health.iter().max_by_key(|part| part.grade);
        let (health, message) = match worst {
            _ if now.saturating_sub(self.heard) > SILENT => ("silent", "nothing is heard: is the way to it cut?"),
            None => ("unheard", "it has not said yet how it is"),
            Some(part) => {
                let board = self.health.iter().find(|part| part.name == "board");
                (GRADES[usize::from(part.grade).min(3)], board.unwrap_or(part).message.as_str())
            }
        };
        let figures = self.cloud.as_ref().map(|(_, figures, _)| figures);
        let units = self.value("units").unwrap_or_default();
        let axes: Vec<_> = self.joints.iter().map(|(axis, at)| in_words(axis, *at, units)).collect();
        let joints: BTreeMap<_, _> = self.joints.iter().map(|(axis, at)| (axis.as_str(), rounded(*at))).collect();
        json!({
            "name": name,
            "health": health,
            "message": message,
            "heard_s": age(self.heard),
            "state": self.value("state"),
            "mode": self.value("mode").filter(|mode| !mode.is_empty()),
            "modes": self.value("modes").map(|modes| modes.split(',').collect::<Vec<_>>()),
            "takes_orders": self.value("takes_orders") == Some("true"),
            "joints": joints,
            "axes": axes,
            "cameras": self.frames,
            "clouds": self.clouds,
            "sent": self.value("clouds").and_then(|count| count.parse::<u64>().ok()),
            "points": figures.map(|figures| figures.points),
            "sigma_mm": figures.and_then(|figures| figures.sigma_mm).map(rounded),
            "cloud_age_s": self.cloud.as_ref().map(|(at, ..)| age(*at)),
            "lost": self.lost,
            "left_out": self.value("left_out").and_then(|count| count.parse::<u64>().ok()),
        })
    }
}
