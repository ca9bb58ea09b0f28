//! What a rig measures and how it is, for other machines. The rig hands over the newest of each and goes on at once; a thread of its own makes messages
//! of it and sends them. What that thread had no time for is replaced by newer and counted.

use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use vergence_board::{BoardKnowledge, BoardNews, HostClock, describe_fault};
use vergence_panel::{Panel, Session as PanelSession};
use vergence_pipeline::{Observation, PairCloud};
use vergence_protocol::{ControllerState, Microseconds, PoseReport};
use vergence_recording::messages::{self, Grade, Health};
use vergence_recording::{DIAGNOSTICS, JOINTS, POINTS, TRANSFORMS, Topic};
use vergence_rig::{Rig, RigPose};

use crate::authorisation::Secret;
use crate::desk::Desk;
use crate::error::PeersError;
use crate::keys::{Attachment, data_key, is_name, mode_key, token_key};
use crate::network::Network;
use crate::transport::{Declared, Session};
use crate::units::units;

/// The topics of a rig.
const TOPICS: [Topic; 4] = [POINTS, TRANSFORMS, JOINTS, DIAGNOSTICS];
/// Shortest time between two readings of the encoders, on the rig's clock.
const JOINTS_PACE_US: u64 = 50_000;
/// How often the rig says how it is, unless that changes.
const HEALTH_PACE: Duration = Duration::from_secs(1);

/// The ways to other machines, and the secret of those who may give orders.
pub type Ways = (Network, Option<Secret>);

/// The rig that is published.
pub struct Published {
    /// The rig.
    pub rig: Arc<Rig>,
    /// Its board; `None` of a rig without axes.
    pub board: Option<BoardKnowledge>,
    /// The clock of exposures and readings.
    pub clock: HostClock,
    /// The time at which that clock started, in microseconds since 1970.
    pub epoch_us: u64,
}

impl Published {
    /// The rig of a session of the panel; `started_us` tells when a clock started, in microseconds since 1970.
    #[must_use]
    pub fn of(panel: &Panel, session: &PanelSession, started_us: fn(HostClock) -> u64) -> Self {
        let of_live = session.live.as_ref().map(|live| live.clock);
        let of_board = session.board.as_ref().map(|board| board.client().clock());
        let clock = of_live.or(of_board).unwrap_or_else(HostClock::start);
        let board = session.board.as_ref().map(|board| board.client().knowledge());
        Self { rig: Arc::clone(panel.rig()), board, clock, epoch_us: started_us(clock) }
    }

    /// Publishes it under `name` on `network`, with what the panel shows, and lets those who have `secret` send it to its modes.
    ///
    /// # Errors
    /// As [`Publication::start`].
    pub fn with_panel(self, panel: Panel, name: &str, (network, secret): Ways) -> Result<Panel, PeersError> {
        let desk = secret.map(|secret| Desk::new(name, secret, panel.remotes()));
        let clock = self.clock;
        let publication = Publication::start(name, &network, self, desk)?;
        Ok(panel.beside(move |result| {
            if let Observation::Points { cloud, pose, .. } = &result.measurement.observation {
                publication.cloud(result.exposed(clock.now()), cloud, pose);
            }
        }))
    }
}

/// Takes what is published. Clones publish the same; the last one that is dropped ends it.
#[derive(Clone)]
pub struct Publication {
    waiting: Arc<Waiting>,
    _thread: Arc<Running>,
}

/// The newest of each, until the thread takes it.
#[derive(Default)]
struct Waiting {
    newest: Mutex<Newest>,
    news: Condvar,
}

#[derive(Default)]
struct Newest {
    cloud: Option<(Microseconds, Box<(PairCloud, RigPose)>)>,
    pose: Option<(Microseconds, PoseReport)>,
    /// Clouds that were replaced before they were sent.
    replaced: u64,
    is_ended: bool,
}

struct Running(Arc<Waiting>, Option<JoinHandle<()>>);

impl Drop for Running {
    fn drop(&mut self) {
        self.0.lock().is_ended = true;
        self.0.news.notify_one();
        if let Some(thread) = self.1.take() {
            // A thread that panicked has ended too.
            let _ = thread.join();
        }
    }
}

impl Waiting {
    /// A poisoned lock only means that another thread panicked; a slot is replaced whole.
    fn lock(&self) -> MutexGuard<'_, Newest> {
        self.newest.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn put(&self, change: impl FnOnce(&mut Newest)) {
        change(&mut self.lock());
        self.news.notify_one();
    }

    fn cloud(&self, exposed: Microseconds, measured: Box<(PairCloud, RigPose)>) {
        self.put(|newest| newest.replaced += u64::from(newest.cloud.replace((exposed, measured)).is_some()));
    }

    /// What is new, as soon as there is something, and at the latest after [`HEALTH_PACE`].
    fn take(&self) -> Newest {
        let is_empty = |newest: &mut Newest| newest.cloud.is_none() && newest.pose.is_none() && !newest.is_ended;
        let waited = self.news.wait_timeout_while(self.lock(), HEALTH_PACE, is_empty);
        let (mut newest, _) = waited.unwrap_or_else(PoisonError::into_inner);
        Newest { cloud: newest.cloud.take(), pose: newest.pose.take(), ..*newest }
    }
}

impl Publication {
    /// Publishes a rig under `name` on `network`, and takes orders at `desk`.
    ///
    /// # Errors
    /// [`PeersError::Name`], [`PeersError::Open`], [`PeersError::BuiltWithout`]
    pub fn start(name: &str, network: &Network, rig: Published, desk: Option<Desk>) -> Result<Self, PeersError> {
        if !is_name(name) {
            return Err(PeersError::Name(name.to_owned()));
        }
        let waiting = Arc::new(Waiting::default());
        if let Some(board) = &rig.board {
            let (poses, clock) = (Arc::clone(&waiting), rig.clock);
            board.listen(move |news| {
                if let BoardNews::Pose(pose) = news {
                    poses.put(|newest| newest.pose = Some((clock.now(), pose.clone())));
                }
            });
        }
        let sender = Sender::new(name, Session::open(network)?, rig, desk)?;
        let taken = Arc::clone(&waiting);
        let thread = std::thread::Builder::new().name("peers".to_owned()).spawn(move || sender.run(&taken));
        let thread = thread.map_err(|error| PeersError::Open(error.to_string()))?;
        Ok(Self { waiting: Arc::clone(&waiting), _thread: Arc::new(Running(waiting, Some(thread))) })
    }

    /// Publishes a cloud of the pair that was exposed at `exposed`, and the pose of the cameras.
    pub fn cloud(&self, exposed: Microseconds, cloud: &PairCloud, pose: &RigPose) {
        self.waiting.cloud(exposed, Box::new((cloud.clone(), pose.clone())));
    }
}

/// Makes messages and sends them.
struct Sender {
    rig: Published,
    takes_orders: bool,
    /// Topics with key, publisher and number of the last message.
    topics: [(Topic, String, [u8; 16], i64); 4],
    told: Told,
    // In this order they are dropped: what is declared, and then the session.
    _declared: Vec<Declared>,
    session: Session,
}

/// What was sent last.
struct Told {
    pose: Option<PoseReport>,
    now: Microseconds,
    joints: Option<Microseconds>,
    health: Option<(Microseconds, Option<(ControllerState, bool)>)>,
    clouds: u64,
    unsent: u64,
}

impl Sender {
    fn new(name: &str, session: Session, rig: Published, desk: Option<Desk>) -> Result<Self, PeersError> {
        let id = session.id()?;
        let tokens: Vec<_> = TOPICS.iter().zip(1..).map(|(topic, at)| token_key(&id, name, at, Some(topic))).collect();
        let [a, b, c, d] = [0, 1, 2, 3]
            .map(|at: usize| (TOPICS[at], data_key(name, &TOPICS[at]), Attachment::publisher(&tokens[at]), 0));
        let mut declared = vec![session.show(&[&[token_key(&id, name, 0, None)], &tokens[..]].concat())?];
        let takes_orders = desk.is_some();
        if let Some(desk) = desk {
            let desk = Mutex::new(desk);
            let answer = move |question: &[u8]| desk.lock().unwrap_or_else(PoisonError::into_inner).answer(question);
            declared.push(session.answer(&mode_key(name), answer)?);
        }
        let told = Told { pose: None, now: Microseconds(0), joints: None, health: None, clouds: 0, unsent: 0 };
        Ok(Self { rig, takes_orders, topics: [a, b, c, d], told, _declared: declared, session })
    }

    fn run(mut self, waiting: &Waiting) {
        loop {
            let Newest { cloud, pose, replaced, is_ended } = waiting.take();
            if is_ended {
                return;
            }
            let is_silent = cloud.is_none() && pose.is_none();
            if let Some((now, pose)) = pose {
                self.told.now = now;
                self.joints(now, &pose);
                self.told.pose = Some(pose);
            }
            if let Some((exposed, measured)) = cloud {
                self.told.now = self.told.now.max(exposed);
                let (cloud, pose) = *measured;
                let at = self.ns(exposed);
                self.send(TRANSFORMS, at, messages::transforms(at, &pose));
                self.send(POINTS, at, messages::cloud(at, &cloud));
                self.told.clouds += 1;
            }
            self.health(replaced, is_silent);
        }
    }

    fn ns(&self, at: Microseconds) -> u64 {
        (self.rig.epoch_us + at.0) * 1000
    }

    fn joints(&mut self, now: Microseconds, pose: &PoseReport) {
        if self.told.joints.is_none_or(|told| now.0.saturating_sub(told.0) >= JOINTS_PACE_US) {
            self.told.joints = Some(now);
            let at = self.ns(now);
            self.send(JOINTS, at, messages::joint_state(at, &self.rig.rig.axes, pose));
        }
    }

    fn send(&mut self, topic: Topic, stamp_ns: u64, message: Vec<u8>) {
        let Some((_, key, publisher, sequence)) = self.topics.iter_mut().find(|(known, ..)| *known == topic) else {
            return;
        };
        *sequence += 1;
        let stamp_ns = i64::try_from(stamp_ns).unwrap_or(i64::MAX);
        let beside = Attachment { sequence: *sequence, stamp_ns, publisher: *publisher };
        // A session that is closed sends nothing; the rig goes on.
        self.told.unsent += u64::from(self.session.publish(key, message, beside.bytes()).is_err());
    }

    /// Says how the rig is, where that is due or has changed.
    fn health(&mut self, replaced: u64, is_silent: bool) {
        let now = self.told.now;
        let state = self.told.pose.as_ref().map(|pose| (pose.state, pose.fault.is_some()));
        let is_early = |then: Microseconds| u128::from(now.0.saturating_sub(then.0)) < HEALTH_PACE.as_micros();
        if !is_silent && self.told.health.is_some_and(|(then, before)| is_early(then) && before == state) {
            return;
        }
        self.told.health = Some((now, state));
        let unsent = replaced + self.told.unsent;
        let publishing = Health {
            grade: Grade::Ok,
            name: "publishing",
            message: format!("{} clouds sent, {unsent} not", self.told.clouds),
            values: vec![
                ("clouds", self.told.clouds.to_string()),
                ("left_out", unsent.to_string()),
                ("takes_orders", self.takes_orders.to_string()),
                ("units", units(&self.rig.rig)),
                ("modes", self.rig.rig.modes.iter().map(|mode| mode.name.as_str()).collect::<Vec<_>>().join(",")),
            ],
        };
        let parts: Vec<_> = self.board(is_silent).into_iter().chain([publishing]).collect();
        let at = self.ns(now);
        self.send(DIAGNOSTICS, at, messages::diagnostics(at, &parts));
    }

    fn board(&self, is_silent: bool) -> Option<Health> {
        let knowledge = self.rig.board.as_ref()?;
        let (rig, pose) = (&self.rig.rig, self.told.pose.as_ref());
        let (grade, message) = match pose {
            None => (Grade::Stale, "the board has said nothing yet".to_owned()),
            Some(_) if is_silent => (Grade::Stale, "the board is silent".to_owned()),
            Some(PoseReport { fault: Some(fault), .. }) => (Grade::Error, describe_fault(rig, fault)),
            Some(pose) => (Grade::Ok, pose.state.to_string()),
        };
        let (map, statistics) = (knowledge.clock_map(), knowledge.statistics());
        let mut values = vec![("poses_lost", statistics.poses_lost.to_string())];
        if let Some(pose) = pose {
            let mode = rig.reported_mode(pose).map(|mode| mode.to_string()).unwrap_or_default();
            values.extend([("state", pose.state.to_string()), ("mode", mode)]);
        }
        values.extend(statistics.round_trip.map(|time| ("round_trip_us", time.0.to_string())));
        values.extend(map.board_at(self.told.now).map(|now| ("clock_error_us", format!("{:.0}", now.error_us))));
        Some(Health { grade, name: "board", message, values })
    }
}

#[cfg(test)]
mod tests {
    use vergence_rig::BENCH_TOML;

    use super::*;

    #[test]
    fn the_newest_cloud_waits_and_the_ones_before_are_counted() {
        let waiting = Waiting::default();
        let pose = Rig::from_toml(BENCH_TOML).expect("the bench").pose_read_at(&[145.0, 0.0]);
        for at in 1..=3 {
            waiting.cloud(Microseconds(at), Box::new((PairCloud::default(), pose.clone())));
        }
        let taken = waiting.take();
        assert_eq!((taken.cloud.map(|(at, _)| at), taken.replaced), (Some(Microseconds(3)), 2));
        waiting.put(|newest| newest.is_ended = true);
        let ended = waiting.take();
        assert!(ended.is_ended && ended.cloud.is_none() && ended.replaced == 2);
    }
}
