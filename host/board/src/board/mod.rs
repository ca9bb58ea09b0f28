//! A connected board: its description, the poses that it sends, and requests to it.

mod motion;
mod questions;
mod report;
mod stream;
mod ways;
mod words;

use std::time::Duration;

use tokio::time::timeout;
use vergence_protocol::{
    AxisInfo, AxisMask, BoardInfo, Compatibility, ControllerState, Mode, MoveId, MovePhase, PoseReport, Refusal,
    Report, Request, SessionId, Status,
};
use vergence_rig::{AxisPosition, HostInstant, Rig};

pub use self::questions::RecordedEvents;
pub use self::report::{clock_json, describe_clock, mark_json, mark_line, pose_json, pose_line, pose_with_times_json};
pub use self::ways::{Way, straight_ways};
pub use self::words::{check_range, describe_fault, describe_pose, event_in_words, positions, staying};

use crate::error::BoardError;
use crate::link::{Client, Continuity, OpenWire};
use crate::serve::{Served, Shared, spawn_in_process};

/// Longest wait for the end of a motion. Homing and moves of a bench take seconds.
const MOTION_TIMEOUT: Duration = Duration::from_secs(120);

/// Longest self-test that is waited for, in microseconds of the board's clock. Boards take some 0.2 s.
const LONGEST_SELF_TEST_US: u64 = 3_000_000;

/// Called with every pose that arrives.
type PoseObserver = Box<dyn FnMut(&Rig, &PoseReport) + Send>;

/// A board in an open session, and the rig that it drives.
pub struct Board {
    client: Client,
    rig: Rig,
    info: BoardInfo,
    axes: Vec<AxisInfo>,
    pose: PoseReport,
    lease_ms: u16,
    latest_move: MoveId,
    observer: Option<PoseObserver>,
    stream_note: Option<String>,
}

impl Board {
    /// Takes over a client that was just connected: checks protocol version and axes, and waits for the first pose.
    /// `lease_ms` is the lease under which motion is armed, in milliseconds.
    ///
    /// # Errors
    /// [`BoardError`]: another protocol, another rig, or a link that ended.
    pub async fn new(client: Client, rig: Rig, lease_ms: u16) -> Result<Self, BoardError> {
        let mut board = Self::open(client, rig, lease_ms).await?;
        board.check_axes().await?;
        board.next_pose().await?;
        Ok(board)
    }

    /// Connects by the real protocol to a simulated board that is served in this process; `drawn` is what the host believes
    /// of the rig. A seeded `session` keeps even that the same in every run.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub async fn in_process<B: Served + Send + 'static>(
        simulated: Shared<B>,
        drawn: Rig,
        session: SessionId,
        lease_ms: u16,
    ) -> Result<Self, BoardError> {
        let wire = OpenWire::in_process(spawn_in_process(simulated));
        Self::new(Client::connect(wire, session, Continuity::begin(None)).await?, drawn, lease_ms).await
    }

    /// Takes over a client of a board that may not fit the rig: the board can be asked and set, and must not be moved.
    ///
    /// # Errors
    /// [`BoardError`]: another protocol, or a link that ended.
    pub async fn open(client: Client, rig: Rig, lease_ms: u16) -> Result<Self, BoardError> {
        if let Compatibility::Incompatible { board } = client.compatibility() {
            let ours = vergence_protocol::PROTOCOL;
            return Err(BoardError::Incompatible { board, ours });
        }
        let Report::Info { info, .. } = client.ask(Request::GetInfo).await? else {
            return Err(BoardError::OtherAnswer("a question about itself"));
        };
        let (axes, pose, latest_move) = (Vec::new(), empty_pose(), MoveId(0));
        let mut board =
            Self { client, rig, info, axes, pose, lease_ms, latest_move, observer: None, stream_note: None };
        board.follow_stream().await?;
        board.wait_for_self_test().await?;
        Ok(board)
    }

    /// Waits until the board has tested itself: before, it refuses settings and motion.
    async fn wait_for_self_test(&mut self) -> Result<(), BoardError> {
        let begun = self.next_pose().await?.at.0;
        let tests = |pose: &PoseReport| matches!(pose.state, ControllerState::Boot | ControllerState::SelfTest);
        while tests(&self.pose) && self.pose.at.0.saturating_sub(begun) < LONGEST_SELF_TEST_US {
            self.next_pose().await?;
        }
        Ok(())
    }

    /// Calls `observer` with every pose that arrives from now on, to show progress.
    #[must_use]
    pub fn observed(mut self, observer: impl FnMut(&Rig, &PoseReport) + Send + 'static) -> Self {
        self.observer = Some(Box::new(observer));
        self
    }

    /// Closes the link and waits until its port is free.
    pub async fn close(self) {
        self.client.close().await;
    }

    /// Checks that the rig describes this board.
    ///
    /// # Errors
    /// [`BoardError`]: another number of axes, other axes, or a link that ended.
    pub async fn check_axes(&mut self) -> Result<(), BoardError> {
        let (ours, theirs) = (self.rig.axes.len(), usize::from(self.info.axes));
        if ours != theirs {
            return Err(BoardError::AxisCount { rig: self.rig.name.clone(), ours, theirs });
        }
        for (axis, index) in self.rig.axes.iter().zip(0u8..) {
            let info = self.axis_info(index).await?;
            if let Some(contradiction) = axis.contradiction(&info) {
                return Err(BoardError::OtherAxis(contradiction));
            }
            self.axes.push(info);
        }
        Ok(())
    }

    async fn axis_info(&self, axis: u8) -> Result<AxisInfo, BoardError> {
        match self.client.ask(Request::GetAxis { axis }).await? {
            Report::Axis { info, .. } => Ok(info),
            _ => Err(BoardError::NoAxis(axis)),
        }
    }

    /// The board's description of itself.
    #[must_use]
    pub fn info(&self) -> &BoardInfo {
        &self.info
    }

    /// The board's description of each axis; empty for a board that was only opened.
    #[must_use]
    pub fn axes(&self) -> &[AxisInfo] {
        &self.axes
    }

    /// The rig that the board drives.
    #[must_use]
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The session with the board.
    #[must_use]
    pub fn client(&self) -> &Client {
        &self.client
    }

    /// The session with the board, to take streams from it.
    pub fn client_mut(&mut self) -> &mut Client {
        &mut self.client
    }

    /// The latest pose that was waited for.
    #[must_use]
    pub fn pose(&self) -> &PoseReport {
        &self.pose
    }

    /// Whether all axes have their reference in the latest pose.
    #[must_use]
    pub fn is_referenced(&self) -> bool {
        self.pose.referenced == AxisMask::first(self.rig.axes.len())
    }

    /// Position of each axis in the latest pose.
    #[must_use]
    pub fn positions(&self) -> Vec<AxisPosition> {
        positions(&self.rig, &self.pose)
    }

    /// Time of the latest pose on the host's clock; `None` before the first clock exchange.
    #[must_use]
    pub fn pose_on_host_clock(&self) -> Option<HostInstant> {
        self.client.clock_map().host_at(self.pose.at)
    }

    /// The target for each axis that keeps it where it stands, within the range of the axis.
    #[must_use]
    pub fn standing(&self) -> Vec<AxisPosition> {
        self.rig.axes.iter().zip(self.positions()).map(|(axis, present)| staying(axis, present)).collect()
    }

    /// Waits until the board's clock is known to 0.2 ms, for at most half a second.
    ///
    /// # Errors
    /// [`BoardError::Link`] where the link ended.
    pub async fn compare_clocks(&mut self) -> Result<(), BoardError> {
        const PATIENCE: Duration = Duration::from_millis(500);
        const WELL_US: f64 = 200.0;
        let compared = async {
            while self.pose_on_host_clock().is_none_or(|at| at.error_us > WELL_US) {
                self.next_pose().await?;
            }
            Ok(())
        };
        timeout(PATIENCE, compared).await.unwrap_or(Ok(()))
    }

    /// Waits for the next pose.
    ///
    /// # Errors
    /// [`BoardError::Link`] where the link ended.
    pub async fn next_pose(&mut self) -> Result<&PoseReport, BoardError> {
        self.pose = self.client.next_pose().await?;
        if let Some(observer) = &mut self.observer {
            observer(&self.rig, &self.pose);
        }
        Ok(&self.pose)
    }

    /// Sends a request that the board carries out or refuses.
    ///
    /// # Errors
    /// [`BoardError::Refused`], or [`BoardError::Link`] where the link ended.
    pub async fn ask(&self, request: Request) -> Result<(), BoardError> {
        self.request(request).await?.map_err(|refusal| self.refused(refusal))
    }

    /// Sends a request that the board carries out or refuses; a refusal is a value here.
    async fn request(&self, request: Request) -> Result<Result<(), Refusal>, BoardError> {
        match self.client.ask(request).await? {
            Report::Ack { status: Status::Accepted, .. } => Ok(Ok(())),
            Report::Ack { status: Status::Refused(refusal), .. } => Ok(Err(refusal)),
            _ => Err(BoardError::OtherAnswer("a command")),
        }
    }

    /// A refusal as an error that names the latched fault or the axis concerned.
    #[must_use]
    pub fn refused(&self, refusal: Refusal) -> BoardError {
        // A board with a latched fault is not idle, and cannot be disarmed either: the fault must be cleared.
        let refusal = match (refusal, self.pose.fault) {
            (Refusal::NotIdle, Some(_)) => Refusal::Latched,
            _ => refusal,
        };
        let more = match (refusal, self.pose.fault) {
            (Refusal::Latched, Some(fault)) => format!(" ({})", describe_fault(&self.rig, &fault)),
            (
                Refusal::NotReferenced { axis }
                | Refusal::OutsideLimits { axis }
                | Refusal::DriverNotReady { axis, .. }
                | Refusal::HomeSwitchAside { axis }
                | Refusal::EncoderNotReady { axis, .. },
                _,
            ) => {
                let known = self.rig.axes.get(usize::from(axis));
                known.map(|known| format!(" (axis {axis} is {})", known.name)).unwrap_or_default()
            }
            _ => String::new(),
        };
        BoardError::Refused { refusal, more }
    }

    /// Waits for poses until one satisfies `done`; a fault that was not latched before ends the wait.
    async fn wait_until(&mut self, done: impl Fn(&PoseReport) -> bool) -> Result<(), BoardError> {
        self.wait_for(Some(MOTION_TIMEOUT), done).await.unwrap_or(Err(BoardError::NotDone(MOTION_TIMEOUT)))
    }

    /// Waits for poses until one satisfies `done`, for at most `patience`, then `None`; for ever where `patience` is `None`.
    async fn wait_for(
        &mut self,
        patience: Option<Duration>,
        done: impl Fn(&PoseReport) -> bool,
    ) -> Option<Result<(), BoardError>> {
        let latched_before = self.pose.fault;
        let waited = async {
            loop {
                self.next_pose().await?;
                match self.pose.fault {
                    Some(fault) if latched_before.is_none() => {
                        return Err(BoardError::Fault(describe_fault(&self.rig, &fault)));
                    }
                    _ if done(&self.pose) => return Ok(()),
                    _ => {}
                }
            }
        };
        match patience {
            Some(patience) => timeout(patience, waited).await.ok(),
            None => Some(waited.await),
        }
    }
}

/// The pose before the first one has arrived.
fn empty_pose() -> PoseReport {
    PoseReport {
        at: vergence_protocol::Microseconds(0),
        seq: 0,
        counts: vergence_protocol::AxisList::new(),
        referenced: AxisMask::default(),
        state: ControllerState::Idle,
        mode: Mode(0),
        move_id: MoveId(0),
        phase: MovePhase::None,
        fault: None,
    }
}
