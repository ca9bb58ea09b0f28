//! The task behind a client: it owns the wire and the protocol session, sends heartbeats and clock probes, and sorts what
//! arrives.

use std::collections::BTreeMap;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::sync::{mpsc, oneshot, watch};
use tokio::time::sleep_until;
use vergence_protocol::{
    Compatibility, ControllerState, HostEvent, HostSession, MAX_FRAME, Microseconds, PoseReport, Report, Request,
    SessionId, Ticket, TriggerMark,
};
use vergence_rig::Exchange;

use super::attention::Attention;
use super::clock::HostClock;
use super::error::LinkError;
use super::follow::{Broadcaster, Followed};
use super::knowledge::{BoardKnowledge, BoardNews};
use super::open::OpenWire;
use super::repeated_stop::RepeatedStop;

/// Periods of the clock probes: fast at first, then slow. They are odd so that they do not keep step with the latency timer
/// of a USB bridge.
const PROBE_FAST_US: u64 = 98_390;
const PROBE_SLOW_US: u64 = 983_900;
const FAST_PROBES: u32 = 10;

/// What the client asks of the task.
pub(super) enum Command {
    /// Send this request reliably and hand back the reply.
    Ask { request: Request, reply: oneshot::Sender<Result<Report, LinkError>> },
    /// Send heartbeats with this lease from now on; zero stops them.
    Hold { lease_ms: u16 },
}

/// Where the task puts what the board sends unasked.
pub(super) struct Outlets {
    pub(super) poses: watch::Sender<Option<PoseReport>>,
    pub(super) marks: mpsc::Sender<TriggerMark>,
    pub(super) logs: mpsc::Sender<Vec<u8>>,
    pub(super) followers: Option<Broadcaster>,
}

/// The task that owns the wire and the protocol session.
pub(super) struct LinkTask {
    session: HostSession,
    clock: HostClock,
    inbox: mpsc::Receiver<Command>,
    outlets: Outlets,
    /// Receives the outcome of the first Hello; `None` once it was sent.
    opened: Option<oneshot::Sender<Result<Compatibility, LinkError>>>,
    waiting: BTreeMap<Ticket, oneshot::Sender<Result<Report, LinkError>>>,
    /// Stops that the board has not answered yet.
    stops: Vec<(RepeatedStop, oneshot::Sender<Result<Report, LinkError>>)>,
    knowledge: BoardKnowledge,
    attention: Attention,
    /// State of the board in the latest pose.
    state: ControllerState,
    /// The lease in milliseconds, and when the next heartbeat is due.
    heartbeat: Option<(u16, Microseconds)>,
    next_probe: Microseconds,
    probes: u32,
    /// Bytes that have arrived.
    received: u32,
}

impl LinkTask {
    pub(super) fn new(
        session: SessionId,
        clock: HostClock,
        inbox: mpsc::Receiver<Command>,
        outlets: Outlets,
        opened: oneshot::Sender<Result<Compatibility, LinkError>>,
        (knowledge, attention): (BoardKnowledge, Attention),
    ) -> Self {
        Self {
            session: HostSession::new(session),
            clock,
            inbox,
            outlets,
            opened: Some(opened),
            waiting: BTreeMap::new(),
            stops: Vec::new(),
            knowledge,
            attention,
            state: ControllerState::Idle,
            heartbeat: None,
            next_probe: Microseconds(0),
            probes: 0,
            received: 0,
        }
    }

    /// Runs until the link ends or the client is dropped.
    pub(super) async fn run(mut self, mut wire: OpenWire) -> LinkError {
        self.session.hello();
        let patience = wire.patience.reply;
        let hello_deadline = Microseconds(self.clock.now().0 + patience.as_micros() as u64);
        let mut input = [0; 1024];
        loop {
            if let Err(error) = self.flush(&mut wire).await {
                return self.lose(LinkError::Closed(error.to_string()));
            }
            let wake = self.next_wake(hello_deadline);
            tokio::select! {
                read = wire.stream.read(&mut input) => {
                    let bytes = match read {
                        Ok(0) => return self.lose(LinkError::Closed("end of stream".into())),
                        Ok(length) => input.get(..length).unwrap_or_default(),
                        Err(error) => return self.lose(LinkError::Closed(error.to_string())),
                    };
                    if let Err(error) = self.receive(bytes) {
                        return self.lose(error);
                    }
                }
                command = self.inbox.recv() => match command {
                    Some(command) => self.carry_out(command),
                    None => {
                        let _ = self.flush(&mut wire).await;
                        return self.finish(LinkError::Closed("by this program".into()));
                    }
                },
                () = sleep_until(self.clock.instant(wake)) => {}
            }
            if self.opened.is_some() && self.clock.now() >= hello_deadline {
                let error =
                    if self.received > 0 { LinkError::Noise(self.received) } else { LinkError::Silent(patience) };
                return self.lose(error);
            }
        }
    }

    /// The link ended, and not because this program closed it.
    fn lose(self, error: LinkError) -> LinkError {
        if self.opened.is_none() {
            self.knowledge.note(&BoardNews::LinkEnded);
        }
        self.finish(error)
    }

    /// Ends every waiting request with the reason for which the link ended.
    fn finish(mut self, error: LinkError) -> LinkError {
        if let Some(opened) = self.opened.take() {
            let _ = opened.send(Err(error.clone()));
        }
        let stops = std::mem::take(&mut self.stops).into_iter().map(|(_, reply)| reply);
        for reply in std::mem::take(&mut self.waiting).into_values().chain(stops) {
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
            self.stops.iter().map(|(stop, _)| stop.due()).min(),
        ];
        deadlines.into_iter().flatten().min().unwrap_or(hello_deadline)
    }

    /// Writes everything that is due now.
    async fn flush(&mut self, wire: &mut OpenWire) -> std::io::Result<()> {
        let now = self.clock.now();
        self.queue_heartbeat(now);
        self.queue_probe(now);
        self.queue_stops(now);
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
            // Five heartbeats per lease: four may be lost. A full queue already holds one.
            self.heartbeat = Some((lease_ms, Microseconds(now.0 + u64::from(lease_ms) * 1000 / 5)));
            if !self.attention.is_paid(now, self.state) {
                return;
            }
            let _ = self.session.send_now(Request::Heartbeat { session: self.session.id(), lease_ms });
        }
    }

    /// Sends stops again that are not answered; those that nobody waits for any more are dropped.
    fn queue_stops(&mut self, now: Microseconds) {
        self.stops.retain(|(_, reply)| !reply.is_closed());
        for (stop, _) in &mut self.stops {
            // A full queue already holds one.
            let _ = stop.send(now, &mut self.session);
        }
    }

    fn queue_probe(&mut self, now: Microseconds) {
        if self.session.is_open() && now >= self.next_probe {
            let period = if self.probes < FAST_PROBES { PROBE_FAST_US } else { PROBE_SLOW_US };
            self.probes = self.probes.saturating_add(1);
            self.next_probe = Microseconds(now.0 + period);
            if self.session.send_now(Request::TimeProbe { t0: now }).is_ok() {
                self.knowledge.note(&BoardNews::ProbeSent);
            }
        }
    }

    fn carry_out(&mut self, command: Command) {
        let now = self.clock.now();
        match command {
            Command::Hold { lease_ms: 0 } => self.heartbeat = None,
            Command::Hold { lease_ms } => self.heartbeat = Some((lease_ms, now)),
            // A stop must not wait until earlier requests are acknowledged.
            Command::Ask { request: Request::Stop { kind }, reply } => {
                self.stops.push((RepeatedStop::new(kind, now), reply));
            }
            Command::Ask { request, reply } => match self.session.submit(now, request) {
                Ok(ticket) => {
                    self.waiting.insert(ticket, reply);
                }
                Err(error) => {
                    let _ = reply.send(Err(LinkError::Unsendable(error.to_string())));
                }
            },
        }
    }

    fn receive(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        self.received = self.received.saturating_add(u32::try_from(bytes.len()).unwrap_or(u32::MAX));
        let now = self.clock.now();
        let mut events = Vec::new();
        self.session.receive(now, bytes, |event| events.push(event));
        self.knowledge.note_statistics(self.session.statistics());
        for event in events {
            match event {
                HostEvent::Opened { compatibility, .. } => {
                    if let Some(opened) = self.opened.take() {
                        if self.knowledge.has_ended() {
                            self.knowledge.note(&BoardNews::LinkBack);
                        }
                        let _ = opened.send(Ok(compatibility));
                    }
                }
                HostEvent::Lost { .. } => return Err(LinkError::SessionLost),
                HostEvent::Reply { ticket, report } => {
                    let stop = self.stops.iter().position(|(stop, _)| stop.is_answered_by(ticket));
                    let stop = stop.map(|index| self.stops.swap_remove(index).1);
                    if let Some(reply) = stop.or_else(|| self.waiting.remove(&ticket)) {
                        let _ = reply.send(Ok(report));
                    }
                }
                HostEvent::Report(report) => self.note(now, report),
                // Log that nobody takes is lost.
                HostEvent::Log(bytes) => {
                    self.pass_on(|| Followed::Log(bytes.to_vec()));
                    drop(self.outlets.logs.try_send(bytes.to_vec()));
                }
                HostEvent::Management(_) => {}
            }
        }
        Ok(())
    }

    /// Passes a report on to the followers of this port.
    fn pass_on(&self, report: impl FnOnce() -> Followed) {
        if let Some(followers) = &self.outlets.followers {
            followers.send(report);
        }
    }

    fn note(&mut self, now: Microseconds, report: Report) {
        match report {
            Report::Pose(pose) => {
                self.state = pose.state;
                self.knowledge.note(&BoardNews::Pose(pose.clone()));
                self.pass_on(|| Followed::Pose(pose.clone()));
                self.outlets.poses.send_replace(Some(pose));
            }
            Report::TimeReply { t0, t1, t2 } => {
                self.knowledge.note(&BoardNews::Exchange(Exchange { t0, t1, t2, t3: now }));
            }
            // Marks are numbered: a reader that is too slow sees which are missing.
            Report::TriggerMark(mark) => drop(self.outlets.marks.try_send(mark)),
            // MoveState and Fault need no outlet: every pose repeats them.
            _ => {}
        }
    }
}
