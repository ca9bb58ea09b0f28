//! The client: a task that owns the wire and the protocol session, and a handle that asks it for things.

use std::collections::BTreeMap;
use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::sync::{mpsc, oneshot, watch};
use tokio::time::{sleep_until, timeout};
use vergence_protocol::{
    Compatibility, FrameMark, HostEvent, HostSession, HostStatistics, MAX_FRAME, Microseconds, PoseReport, Report,
    Request, SessionId, Ticket,
};
use vergence_rig::{ClockMap, Exchange, JointSample};

use super::clock::HostClock;
use super::error::LinkError;
use super::knowledge::BoardKnowledge;
use super::open::OpenWire;

/// How long the board may take to answer the first Hello.
const HELLO_TIMEOUT: Duration = Duration::from_secs(2);
/// How long a request may take, retransmissions included.
const REPLY_TIMEOUT: Duration = Duration::from_secs(2);
/// Clock exchanges: quickly at first, then slowly.
/// Odd periods, so that they do not keep step with the latency timer of a USB bridge.
const PROBE_FAST_US: u64 = 98_390;
const PROBE_SLOW_US: u64 = 983_900;
const FAST_PROBES: u32 = 10;
/// Pulses that may wait to be taken: seconds at the highest rate.
const MARKS_KEPT: usize = 2_048;
/// Pieces of log that may wait to be taken: more than the board keeps.
const LOGS_KEPT: usize = 256;

enum Command {
    /// Sent reliably; the reply comes back.
    Ask { request: Request, reply: oneshot::Sender<Result<Report, LinkError>> },
    /// Heartbeats from now on, with this lease; zero ends them.
    Hold { lease_ms: u16 },
}

/// A handle to an open session. Dropping it closes the link.
pub struct Client {
    commands: mpsc::Sender<Command>,
    poses: watch::Receiver<Option<PoseReport>>,
    marks: mpsc::Receiver<FrameMark>,
    logs: mpsc::Receiver<Vec<u8>>,
    end: watch::Receiver<Option<LinkError>>,
    learned: BoardKnowledge,
    clock: HostClock,
    session: SessionId,
    compatibility: Compatibility,
}

impl Client {
    /// Opens session `session` over `wire`.
    ///
    /// # Errors
    /// [`LinkError`] where the board does not answer.
    pub async fn connect(wire: OpenWire, session: SessionId, clock: HostClock) -> Result<Self, LinkError> {
        let (commands, inbox) = mpsc::channel(16);
        let (pose_sender, poses) = watch::channel(None);
        let (mark_sender, marks) = mpsc::channel(MARKS_KEPT);
        let (log_sender, logs) = mpsc::channel(LOGS_KEPT);
        let (end_sender, end) = watch::channel(None);
        let (opened_sender, opened) = oneshot::channel();
        let learned = BoardKnowledge::new(wire.baud);
        let task = LinkTask {
            session: HostSession::new(session),
            clock,
            inbox,
            poses: pose_sender,
            marks: mark_sender,
            logs: log_sender,
            opened: Some(opened_sender),
            waiting: BTreeMap::new(),
            learned: learned.clone(),
            heartbeat: None,
            next_probe: Microseconds(0),
            probes: 0,
            received: 0,
        };
        tokio::spawn(async move {
            let error = task.run(wire).await;
            end_sender.send_replace(Some(error));
        });
        let compatibility = opened.await.unwrap_or(Err(LinkError::SessionLost))?;
        Ok(Self { commands, poses, marks, logs, end, learned, clock, session, compatibility })
    }

    /// Whether both ends mean the same messages.
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

    /// Asks the board and waits for its reply.
    ///
    /// # Errors
    /// [`LinkError`] where the link ended or the board stayed silent.
    pub async fn ask(&self, request: Request) -> Result<Report, LinkError> {
        let (reply, answer) = oneshot::channel();
        self.commands.send(Command::Ask { request, reply }).await.map_err(|_| self.why_ended())?;
        match timeout(REPLY_TIMEOUT, answer).await {
            Ok(Ok(result)) => result,
            Ok(Err(_)) => Err(self.why_ended()),
            Err(_) => Err(LinkError::Silent(REPLY_TIMEOUT)),
        }
    }

    /// Keeps a lease of `lease_ms` alive from now on; zero lets it run out.
    ///
    /// # Errors
    /// [`LinkError`] where the link ended.
    pub async fn hold_lease(&self, lease_ms: u16) -> Result<(), LinkError> {
        self.commands.send(Command::Hold { lease_ms }).await.map_err(|_| self.why_ended())
    }

    /// The next pose from the board.
    ///
    /// # Errors
    /// [`LinkError`] where the link ended, or no pose came for a while.
    pub async fn next_pose(&mut self) -> Result<PoseReport, LinkError> {
        const PATIENCE: Duration = Duration::from_secs(1);
        match timeout(PATIENCE, self.poses.changed()).await {
            Ok(Ok(())) => self.poses.borrow_and_update().clone().ok_or(LinkError::Silent(PATIENCE)),
            Ok(Err(_)) => Err(self.why_ended()),
            Err(_) => Err(LinkError::Silent(PATIENCE)),
        }
    }

    /// The next pulse of the camera trigger, however long it takes.
    ///
    /// # Errors
    /// [`LinkError`] where the link ended.
    pub async fn next_mark(&mut self) -> Result<FrameMark, LinkError> {
        match self.marks.recv().await {
            Some(mark) => Ok(mark),
            None => Err(self.why_ended()),
        }
    }

    /// Drops the pulses that wait to be taken.
    pub fn forget_marks(&mut self) {
        while self.marks.try_recv().is_ok() {}
    }

    /// The next bytes of the board's log, however long they take.
    ///
    /// # Errors
    /// [`LinkError`] where the link ended.
    pub async fn next_log(&mut self) -> Result<Vec<u8>, LinkError> {
        match self.logs.recv().await {
            Some(bytes) => Ok(bytes),
            None => Err(self.why_ended()),
        }
    }

    /// The pulses of the camera trigger, for whoever listens beside the one who moves; [`Self::next_mark`] hears none from
    /// then on.
    pub fn take_marks(&mut self) -> mpsc::Receiver<FrameMark> {
        std::mem::replace(&mut self.marks, mpsc::channel(1).1)
    }

    /// What the link has learned of the board's time and motion, for whoever listens beside the one who moves.
    #[must_use]
    pub fn knowledge(&self) -> BoardKnowledge {
        self.learned.clone()
    }

    /// The latest clock map.
    #[must_use]
    pub fn clock_map(&self) -> ClockMap {
        self.learned.clock_map()
    }

    /// How the link has been since it was opened.
    #[must_use]
    pub fn statistics(&self) -> HostStatistics {
        self.learned.statistics()
    }

    fn why_ended(&self) -> LinkError {
        self.end.borrow().clone().unwrap_or(LinkError::SessionLost)
    }
}

struct LinkTask {
    session: HostSession,
    clock: HostClock,
    inbox: mpsc::Receiver<Command>,
    poses: watch::Sender<Option<PoseReport>>,
    marks: mpsc::Sender<FrameMark>,
    logs: mpsc::Sender<Vec<u8>>,
    opened: Option<oneshot::Sender<Result<Compatibility, LinkError>>>,
    waiting: BTreeMap<Ticket, oneshot::Sender<Result<Report, LinkError>>>,
    learned: BoardKnowledge,
    /// The lease, and when the next heartbeat is due.
    heartbeat: Option<(u16, Microseconds)>,
    next_probe: Microseconds,
    probes: u32,
    received: u32,
}

impl LinkTask {
    /// Runs until the link ends or the client is dropped.
    async fn run(mut self, mut wire: OpenWire) -> LinkError {
        self.session.hello();
        let hello_deadline = Microseconds(self.clock.now().0 + HELLO_TIMEOUT.as_micros() as u64);
        let mut input = [0; 1024];
        loop {
            if let Err(error) = self.flush(&mut wire).await {
                return self.finish(LinkError::Closed(error.to_string()));
            }
            let wake = self.next_wake(hello_deadline);
            tokio::select! {
                read = wire.stream.read(&mut input) => {
                    let bytes = match read {
                        Ok(0) => return self.finish(LinkError::Closed("end of stream".into())),
                        Ok(length) => input.get(..length).unwrap_or_default(),
                        Err(error) => return self.finish(LinkError::Closed(error.to_string())),
                    };
                    if let Err(error) = self.hear(bytes) {
                        return self.finish(error);
                    }
                }
                command = self.inbox.recv() => match command {
                    Some(command) => self.obey(command),
                    None => {
                        let _ = self.flush(&mut wire).await;
                        return self.finish(LinkError::Closed("by this program".into()));
                    }
                },
                () = sleep_until(self.clock.instant(wake)) => {}
            }
            if self.opened.is_some() && self.clock.now() >= hello_deadline {
                let error =
                    if self.received > 0 { LinkError::Noise(self.received) } else { LinkError::Silent(HELLO_TIMEOUT) };
                return self.finish(error);
            }
        }
    }

    /// Tells everybody who waits why nothing more will come.
    fn finish(mut self, error: LinkError) -> LinkError {
        if let Some(opened) = self.opened.take() {
            let _ = opened.send(Err(error.clone()));
        }
        for reply in std::mem::take(&mut self.waiting).into_values() {
            let _ = reply.send(Err(error.clone()));
        }
        error
    }

    fn next_wake(&self, hello_deadline: Microseconds) -> Microseconds {
        let opening = self.opened.is_some();
        let deadlines = [
            self.session.next_wake(),
            opening.then_some(hello_deadline),
            (!opening).then_some(self.next_probe),
            self.heartbeat.map(|(_, due)| due),
        ];
        deadlines.into_iter().flatten().min().unwrap_or(hello_deadline)
    }

    /// Writes everything that is due now.
    async fn flush(&mut self, wire: &mut OpenWire) -> std::io::Result<()> {
        let now = self.clock.now();
        self.queue_heartbeat(now);
        self.queue_probe(now);
        let mut frame = [0; MAX_FRAME];
        while let Some(length) = self.session.transmit(self.clock.now(), &mut frame) {
            wire.stream.write_all(frame.get(..length).unwrap_or_default()).await?;
        }
        wire.stream.flush().await
    }

    fn queue_heartbeat(&mut self, now: Microseconds) {
        if let Some((lease_ms, due)) = self.heartbeat
            && now >= due
        {
            // Five beats to a lease: four may be lost. A full queue holds a beat already.
            self.heartbeat = Some((lease_ms, Microseconds(now.0 + u64::from(lease_ms) * 1000 / 5)));
            let _ = self.session.send_now(Request::Heartbeat { session: self.session.id(), lease_ms });
        }
    }

    fn queue_probe(&mut self, now: Microseconds) {
        if self.session.is_open() && now >= self.next_probe {
            let period = if self.probes < FAST_PROBES { PROBE_FAST_US } else { PROBE_SLOW_US };
            self.probes = self.probes.saturating_add(1);
            self.next_probe = Microseconds(now.0 + period);
            if self.session.send_now(Request::TimeProbe { t0: now }).is_ok() {
                self.learned.probe_sent();
            }
        }
    }

    fn obey(&mut self, command: Command) {
        let now = self.clock.now();
        match command {
            Command::Hold { lease_ms: 0 } => self.heartbeat = None,
            Command::Hold { lease_ms } => self.heartbeat = Some((lease_ms, now)),
            Command::Ask { request, reply } => {
                // A stop does not wait behind what is still unacknowledged.
                let sent = match request {
                    Request::Stop { .. } => self.session.send_now(request),
                    _ => self.session.submit(now, request),
                };
                match sent {
                    Ok(ticket) => {
                        self.waiting.insert(ticket, reply);
                    }
                    Err(error) => {
                        let _ = reply.send(Err(LinkError::Unsendable(error.to_string())));
                    }
                }
            }
        }
    }

    fn hear(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        self.received = self.received.saturating_add(u32::try_from(bytes.len()).unwrap_or(u32::MAX));
        let now = self.clock.now();
        let mut events = Vec::new();
        self.session.receive(now, bytes, |event| events.push(event));
        self.learned.note_statistics(self.session.statistics());
        for event in events {
            match event {
                HostEvent::Opened { compatibility, .. } => {
                    if let Some(opened) = self.opened.take() {
                        let _ = opened.send(Ok(compatibility));
                    }
                }
                HostEvent::Lost { .. } => return Err(LinkError::SessionLost),
                HostEvent::Reply { ticket, report } => {
                    if let Some(reply) = self.waiting.remove(&ticket) {
                        let _ = reply.send(Ok(report));
                    }
                }
                HostEvent::Report(report) => self.note(now, report),
                // Who does not listen misses it.
                HostEvent::Log(bytes) => drop(self.logs.try_send(bytes.to_vec())),
                HostEvent::Management(_) => {}
            }
        }
        Ok(())
    }

    fn note(&mut self, now: Microseconds, report: Report) {
        match report {
            Report::Pose(pose) => {
                self.learned.note_joints(JointSample { at: pose.at, counts: pose.counts.clone() });
                self.poses.send_replace(Some(pose));
            }
            Report::TimeReply { t0, t1, t2 } => {
                self.learned.note_exchange(Exchange { t0, t1, t2, t3: now });
            }
            // Numbered: who does not take them in time sees which are missing.
            Report::FrameMark(mark) => drop(self.marks.try_send(mark)),
            // MoveState and Fault are repeated in every pose.
            _ => {}
        }
    }
}
