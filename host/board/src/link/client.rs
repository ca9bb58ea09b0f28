//! A handle to an open session: it asks the board through the task that owns the wire.

use tokio::sync::{mpsc, oneshot, watch};
use tokio::time::timeout;
use vergence_protocol::{Compatibility, HostStatistics, PoseReport, Report, Request, SessionId, TriggerMark};
use vergence_rig::ClockMap;

use super::attention::Attention;
use super::clock::HostClock;
use super::error::{LinkError, OpenError};
use super::follow::Broadcaster;
use super::knowledge::BoardKnowledge;
use super::open::{OpenWire, Patience, Port};
use super::task::{Command, LinkTask, Outlets};

/// Trigger pulses that are kept until they are taken: seconds of them at the highest rate.
const MARKS_KEPT: usize = 2_048;
/// Pieces of log that are kept until they are taken: more than the board keeps.
const LOGS_KEPT: usize = 256;

/// A handle to one open protocol session. Dropping it closes the link.
pub struct Client {
    commands: mpsc::Sender<Command>,
    poses: watch::Receiver<Option<PoseReport>>,
    marks: mpsc::Receiver<TriggerMark>,
    logs: mpsc::Receiver<Vec<u8>>,
    end: watch::Receiver<Option<LinkError>>,
    knowledge: BoardKnowledge,
    attention: Attention,
    clock: HostClock,
    session: SessionId,
    compatibility: Compatibility,
    patience: Patience,
}

/// What outlives a link, so that the link after it goes on: the host's clock, and what the board told.
#[derive(Clone, Debug)]
pub struct Continuity {
    /// The host's clock.
    pub clock: HostClock,
    /// What the board told.
    pub knowledge: BoardKnowledge,
}

impl Continuity {
    /// Of a first link, by a wire of `baud` bits per second; `None` where bytes take no time.
    #[must_use]
    pub fn begin(baud: Option<u32>) -> Self {
        Self { clock: HostClock::start(), knowledge: BoardKnowledge::new(baud) }
    }
}

impl Client {
    /// Opens session `session` over `wire`; `continuity` is that of the link before it, where there was one. Must be called inside a tokio runtime: it starts a task that owns the wire.
    ///
    /// # Errors
    /// [`LinkError`] where the board does not answer in time ([`Patience::reply`]).
    pub async fn connect(wire: OpenWire, session: SessionId, continuity: Continuity) -> Result<Self, LinkError> {
        let Continuity { clock, knowledge } = continuity;
        let patience = wire.patience;
        let (commands, inbox) = mpsc::channel(16);
        let (pose_sender, poses) = watch::channel(None);
        let (mark_sender, marks) = mpsc::channel(MARKS_KEPT);
        let (log_sender, logs) = mpsc::channel(LOGS_KEPT);
        let (end_sender, end) = watch::channel(None);
        let (opened_sender, opened) = oneshot::channel();
        // Without a socket nobody can follow; the board can still be driven.
        let followers = wire.lock.as_ref().and_then(|lock| Broadcaster::start(lock).ok());
        let outlets = Outlets { poses: pose_sender, marks: mark_sender, logs: log_sender, followers };
        let attention = Attention::new(clock.now());
        let noted = (knowledge.clone(), attention.clone());
        let task = LinkTask::new(session, clock, inbox, outlets, opened_sender, noted);
        tokio::spawn(async move {
            let error = task.run(wire).await;
            end_sender.send_replace(Some(error));
        });
        let compatibility = opened.await.unwrap_or(Err(LinkError::SessionLost))?;
        Ok(Self { commands, poses, marks, logs, end, knowledge, attention, clock, session, compatibility, patience })
    }

    /// As [`Self::connect`], over a wire that leads to `port`.
    ///
    /// # Errors
    /// [`OpenError::Unanswered`] where the board does not answer in time ([`Patience::reply`]).
    pub async fn at(
        port: &Port,
        wire: OpenWire,
        session: SessionId,
        continuity: Continuity,
    ) -> Result<Self, OpenError> {
        let opened = Self::connect(wire, session, continuity).await;
        opened.map_err(|error| OpenError::Unanswered { port: port.clone(), why: error.behind(port).to_string() })
    }

    /// Whether host and board speak the same protocol version.
    #[must_use]
    pub fn compatibility(&self) -> Compatibility {
        self.compatibility
    }

    /// The session's id.
    #[must_use]
    pub fn session(&self) -> SessionId {
        self.session
    }

    /// The host clock of this link.
    #[must_use]
    pub fn clock(&self) -> HostClock {
        self.clock
    }

    /// What the next link to this board goes on with.
    #[must_use]
    pub fn continuity(&self) -> Continuity {
        Continuity { clock: self.clock, knowledge: self.knowledge.clone() }
    }

    /// Sends a request and waits for the board's reply, for at most [`Patience::reply`].
    ///
    /// # Errors
    /// [`LinkError`] where the link ended or the board stayed silent.
    pub async fn ask(&self, request: Request) -> Result<Report, LinkError> {
        self.attention.pay(self.clock.now());
        let (reply, answer) = oneshot::channel();
        self.commands.send(Command::Ask { request, reply }).await.map_err(|_| self.why_ended())?;
        match timeout(self.patience.reply, answer).await {
            Ok(Ok(result)) => result,
            Ok(Err(_)) => Err(self.why_ended()),
            Err(_) => Err(LinkError::Silent(self.patience.reply)),
        }
    }

    /// Sends heartbeats from now on that keep a lease of `lease_ms` milliseconds alive; zero stops them, and the lease runs out.
    /// They depend on this handle: without a call of [`Self::next_pose`] or [`Self::ask`] for a second while the board moves, or
    /// for two minutes while it rests, they stop, because the program that moves the board hangs.
    ///
    /// # Errors
    /// [`LinkError`] where the link ended.
    pub async fn hold_lease(&self, lease_ms: u16) -> Result<(), LinkError> {
        self.commands.send(Command::Hold { lease_ms }).await.map_err(|_| self.why_ended())
    }

    /// Waits for the next pose from the board; poses that nobody waited for are skipped.
    ///
    /// # Errors
    /// [`LinkError`] where the link ended, or no pose came in time ([`Patience::pose`]).
    pub async fn next_pose(&mut self) -> Result<PoseReport, LinkError> {
        let patience = self.patience.pose;
        match timeout(patience, self.poses.changed()).await {
            Ok(Ok(())) => {
                self.attention.pay(self.clock.now());
                self.poses.borrow_and_update().clone().ok_or(LinkError::Silent(patience))
            }
            Ok(Err(_)) => Err(self.why_ended()),
            Err(_) => Err(LinkError::Silent(patience)),
        }
    }

    /// Waits for the next pulse of the camera trigger, for as long as it takes.
    ///
    /// # Errors
    /// [`LinkError`] where the link ended.
    pub async fn next_mark(&mut self) -> Result<TriggerMark, LinkError> {
        match self.marks.recv().await {
            Some(mark) => Ok(mark),
            None => Err(self.why_ended()),
        }
    }

    /// Discards the pulses that have arrived but were not taken.
    pub fn forget_marks(&mut self) {
        while self.marks.try_recv().is_ok() {}
    }

    /// Waits for the next bytes of the board's log, for as long as it takes.
    ///
    /// # Errors
    /// [`LinkError`] where the link ended.
    pub async fn next_log(&mut self) -> Result<Vec<u8>, LinkError> {
        match self.logs.recv().await {
            Some(bytes) => Ok(bytes),
            None => Err(self.why_ended()),
        }
    }

    /// Hands over the stream of camera trigger pulses, so that another task can read them; [`Self::next_mark`] returns none
    /// from then on.
    pub fn take_marks(&mut self) -> mpsc::Receiver<TriggerMark> {
        std::mem::replace(&mut self.marks, mpsc::channel(1).1)
    }

    /// The clock map, encoder readings and statistics of this link, to be read by other tasks.
    #[must_use]
    pub fn knowledge(&self) -> BoardKnowledge {
        self.knowledge.clone()
    }

    /// The latest map between board clock and host clock.
    #[must_use]
    pub fn clock_map(&self) -> ClockMap {
        self.knowledge.clock_map()
    }

    /// Counts of frames, retransmissions and poses since the link was opened.
    #[must_use]
    pub fn statistics(&self) -> HostStatistics {
        self.knowledge.statistics()
    }

    /// Closes the link and waits until its port is free.
    pub async fn close(self) {
        let Self { commands, mut end, .. } = self;
        drop(commands);
        // An error means that the task has ended already.
        let _ = end.wait_for(Option::is_some).await;
    }

    fn why_ended(&self) -> LinkError {
        self.end.borrow().clone().unwrap_or(LinkError::SessionLost)
    }
}
