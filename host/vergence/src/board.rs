//! A connected board and what can be asked of it: arm under a lease, home, move, stop.

mod questions;
mod stream;
mod words;

use std::time::Duration;

use indicatif::ProgressBar;
use tokio::time::timeout;
use vergence_protocol::{
    AxisInfo, AxisMask, BoardInfo, Compatibility, ControllerState, FaultRecord, Jog, Mode, Move, MoveId, MovePhase,
    Permille, PoseReport, Refusal, Report, Request, SessionId, Status, StopKind,
};
use vergence_rig::{AxisPosition, HostInstant, Rig};

pub use self::words::{check_range, describe_fault, describe_pose, positions, staying};

use crate::failure::Failure;
use crate::link::{Client, LinkError};

/// Homing and moves of a bench take seconds; a board that needs longer than this is not doing what it says.
const MOTION_TIMEOUT: Duration = Duration::from_secs(120);

/// A board in a session, and the rig that it drives.
pub struct Board {
    client: Client,
    rig: Rig,
    info: BoardInfo,
    axes: Vec<AxisInfo>,
    pose: PoseReport,
    lease_ms: u16,
    latest_move: MoveId,
    progress: ProgressBar,
    stream_note: Option<String>,
}

impl From<LinkError> for Failure {
    fn from(error: LinkError) -> Self {
        match error {
            LinkError::Unsendable(_) => Self::device(error.to_string()),
            _ => Self::link(error.to_string()),
        }
    }
}

impl Board {
    /// Takes over a fresh client: checks versions and axes, and that poses come.
    ///
    /// # Errors
    /// Another protocol, another rig, or a link that ended.
    pub async fn new(client: Client, rig: Rig, lease_ms: u16, progress: ProgressBar) -> Result<Self, Failure> {
        let mut board = Self::open(client, rig, lease_ms, progress).await?;
        board.check_axes().await?;
        board.next_pose().await?;
        Ok(board)
    }

    /// The same with a board that may not fit the rig: it can be asked and set, and must not be moved.
    ///
    /// # Errors
    /// Another protocol, or a link that ended.
    pub async fn open(client: Client, rig: Rig, lease_ms: u16, progress: ProgressBar) -> Result<Self, Failure> {
        if let Compatibility::Incompatible { board } = client.compatibility() {
            let ours = vergence_protocol::PROTOCOL;
            return Err(Failure::protocol(format!(
                "the board speaks protocol {}.{} and this program {}.{}: update the firmware or use the matching vergence",
                board.major, board.minor, ours.major, ours.minor
            )));
        }
        let Report::Info { info, .. } = client.ask(Request::GetInfo).await? else {
            return Err(Failure::protocol("the board answered a question about itself with something else"));
        };
        let (axes, pose, latest_move) = (Vec::new(), empty_pose(), MoveId(0));
        let mut board = Self { client, rig, info, axes, pose, lease_ms, latest_move, progress, stream_note: None };
        board.follow_stream().await?;
        Ok(board)
    }

    /// Checks that the rig describes this board.
    ///
    /// # Errors
    /// Another number of axes, or other axes; a link that ended.
    pub async fn check_axes(&mut self) -> Result<(), Failure> {
        let (ours, theirs) = (self.rig.axes.len(), usize::from(self.info.axes));
        if ours != theirs {
            return Err(Failure::usage(format!(
                "rig '{}' has {ours} axes and the board {theirs}: name the right rig file with --rig",
                self.rig.name
            )));
        }
        for (axis, index) in self.rig.axes.iter().zip(0u8..) {
            let info = self.axis_info(index).await?;
            if let Some(contradiction) = axis.contradiction(&info) {
                return Err(Failure::usage(format!("{contradiction}: name the right rig file with --rig")));
            }
            self.axes.push(info);
        }
        Ok(())
    }

    async fn axis_info(&self, axis: u8) -> Result<AxisInfo, Failure> {
        match self.client.ask(Request::GetAxis { axis }).await? {
            Report::Axis { info, .. } => Ok(info),
            _ => Err(Failure::protocol(format!("the board does not describe its axis {axis}"))),
        }
    }

    /// The board.
    #[must_use]
    pub fn info(&self) -> &BoardInfo {
        &self.info
    }

    /// What the board said of each axis.
    #[must_use]
    pub fn axes(&self) -> &[AxisInfo] {
        &self.axes
    }

    /// The rig.
    #[must_use]
    pub fn rig(&self) -> &Rig {
        &self.rig
    }

    /// The link.
    #[must_use]
    pub fn client(&self) -> &Client {
        &self.client
    }

    /// The link, to take something from it.
    pub fn client_mut(&mut self) -> &mut Client {
        &mut self.client
    }

    /// The latest pose.
    #[must_use]
    pub fn pose(&self) -> &PoseReport {
        &self.pose
    }

    /// Where the axes are by the latest pose.
    #[must_use]
    pub fn positions(&self) -> Vec<AxisPosition> {
        positions(&self.rig, &self.pose)
    }

    /// When the latest pose was, on the host's clock; `None` before the first clock exchange.
    #[must_use]
    pub fn pose_on_host_clock(&self) -> Option<HostInstant> {
        self.client.clock_map().host_at(self.pose.at)
    }

    /// Where the axes stay that are not to move.
    #[must_use]
    pub fn standing(&self) -> Vec<AxisPosition> {
        self.rig.axes.iter().zip(self.positions()).map(|(axis, present)| staying(axis, present)).collect()
    }

    /// Waits until the board's clock is known well, or as well as half a second on this link allows.
    ///
    /// # Errors
    /// Where the link ended.
    pub async fn compare_clocks(&mut self) -> Result<(), Failure> {
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

    /// Waits for a pose.
    ///
    /// # Errors
    /// Where the link ended.
    pub async fn next_pose(&mut self) -> Result<&PoseReport, Failure> {
        self.pose = self.client.next_pose().await?;
        self.progress.set_message(describe_pose(&self.rig, &self.pose));
        self.progress.tick();
        Ok(&self.pose)
    }

    /// Asks for something that is done or refused.
    ///
    /// # Errors
    /// A refusal in words, or a link that ended.
    pub async fn ask(&self, request: Request) -> Result<(), Failure> {
        self.request(request).await?.map_err(|refusal| self.refused(refusal))
    }

    /// The same, where a refusal is an answer like another.
    async fn request(&self, request: Request) -> Result<Result<(), Refusal>, Failure> {
        match self.client.ask(request).await? {
            Report::Ack { status: Status::Accepted, .. } => Ok(Ok(())),
            Report::Ack { status: Status::Refused(refusal), .. } => Ok(Err(refusal)),
            _ => Err(Failure::protocol("the board answered a command with something else")),
        }
    }

    /// A refusal in words.
    #[must_use]
    pub fn refused(&self, refusal: Refusal) -> Failure {
        let latched = match (refusal, self.pose.fault) {
            (Refusal::Latched, Some(fault)) => format!(" ({})", describe_fault(&self.rig, &fault)),
            _ => String::new(),
        };
        let message = format!("the board refuses: {refusal}{latched}");
        match refusal {
            Refusal::ReadOnly => Failure::protocol(message),
            Refusal::OutsideLimits { .. } | Refusal::Invalid | Refusal::BadSetting | Refusal::NoSetting => {
                Failure::usage(message)
            }
            _ => Failure::device(message),
        }
    }

    /// Arms, does `work` under a live lease, and disarms whatever became of it. Ctrl-C stops the stages first.
    ///
    /// # Errors
    /// Those of `work`; a refusal to arm; an interruption.
    pub async fn armed<T>(&mut self, work: impl AsyncFnOnce(&mut Self) -> Result<T, Failure>) -> Result<T, Failure> {
        self.client.hold_lease(self.lease_ms).await?;
        self.ask(Request::Arm { session: self.client.session() }).await?;
        let outcome = tokio::select! {
            outcome = async { self.take_hold().await?; work(self).await } => outcome,
            _ = tokio::signal::ctrl_c() => Err(Failure::device("interrupted: the stages were told to stop")),
        };
        let disarmed = self.release().await;
        // A latched fault cannot be disarmed; the first failure is the one to tell.
        let value = outcome?;
        disarmed.map(|()| value)
    }

    /// Waits for a pose from after the arming: from then on nobody else can move the board, and its move is the one before
    /// our next.
    async fn take_hold(&mut self) -> Result<(), Failure> {
        self.wait_until(|pose| pose.state == ControllerState::Ready).await?;
        self.latest_move = self.pose.move_id;
        Ok(())
    }

    /// Disarms and waits until the board is idle; in motion it brakes first.
    ///
    /// # Errors
    /// A refusal, or a link that ended.
    pub async fn disarm(&mut self) -> Result<(), Failure> {
        self.ask(Request::Disarm).await?;
        self.wait_until(|pose| pose.state == ControllerState::Idle).await
    }

    /// Disarms where a motion was given up in the middle: it brakes first, and no lease is held any more.
    ///
    /// # Errors
    /// A refusal, or a link that ended.
    pub async fn release(&mut self) -> Result<(), Failure> {
        let disarmed = self.disarm().await;
        self.client.hold_lease(0).await?;
        disarmed
    }

    /// Finds the reference of all axes. The board must be armed.
    ///
    /// # Errors
    /// The fault that ended it, or a refusal.
    pub async fn home(&mut self) -> Result<(), Failure> {
        let axes = AxisMask::first(self.rig.axes.len());
        self.ask(Request::Home { axes }).await?;
        // A pose that was already on its way still shows the old reference.
        self.wait_until(|pose| pose.state == ControllerState::Homing).await?;
        self.wait_until(|pose| pose.state != ControllerState::Homing && pose.referenced == axes).await
    }

    /// Moves all axes and waits until the encoders confirm it. The board must be armed.
    ///
    /// # Errors
    /// A target out of range, the fault that ended the move, a refusal, or a stop.
    pub async fn move_to(&mut self, mode: Mode, targets: &[AxisPosition]) -> Result<(), Failure> {
        check_range(&self.rig, targets)?;
        let (id, targets) = (self.next_move_id(), self.rig.wire_targets(targets));
        self.ask(Request::MoveTo(Move { id, mode, targets, speed: Permille::FULL })).await?;
        self.wait_for_move(id).await
    }

    /// Moves all axes by a distance from where they stand, and waits until the encoders confirm it. Works without
    /// reference, at homing speed. The board must be armed.
    ///
    /// # Errors
    /// The fault that ended the move, a refusal, or a stop.
    pub async fn move_by(&mut self, distances: &[AxisPosition]) -> Result<(), Failure> {
        let (id, by) = (self.next_move_id(), self.rig.wire_targets(distances));
        self.ask(Request::Jog(Jog { id, by, speed: Permille::FULL })).await?;
        self.wait_for_move(id).await
    }

    /// Another than the board's last one: a pose on its way while the move is ordered still tells of that. Zero means "no
    /// move yet".
    fn next_move_id(&mut self) -> MoveId {
        self.latest_move = MoveId(self.latest_move.0.wrapping_add(1).max(1));
        self.latest_move
    }

    async fn wait_for_move(&mut self, id: MoveId) -> Result<(), Failure> {
        self.wait_until(|pose| pose.move_id == id && matches!(pose.phase, MovePhase::Settled | MovePhase::Stopped))
            .await?;
        if self.pose.phase == MovePhase::Stopped {
            return Err(Failure::device("the move was stopped by another command: the stages stand where they are"));
        }
        Ok(())
    }

    /// Stops every motion and waits until all is at rest.
    ///
    /// # Errors
    /// Where the link ended.
    pub async fn stop(&mut self) -> Result<(), Failure> {
        self.ask(Request::Stop { kind: StopKind::Decelerate }).await?;
        let moving = [ControllerState::Moving, ControllerState::Homing, ControllerState::Stopping];
        self.wait_until(|pose| !moving.contains(&pose.state)).await
    }

    /// Stays armed for `duration`, or for ever, as long as nothing goes wrong.
    ///
    /// # Errors
    /// The fault that ended it, or a link that ended.
    pub async fn hold(&mut self, duration: Option<Duration>) -> Result<(), Failure> {
        let watched = self.wait_for(duration, |_| false).await;
        watched.unwrap_or(Ok(()))
    }

    /// Clears the latched fault and returns it; `None` where nothing is latched.
    ///
    /// # Errors
    /// A refusal, such as a cause that persists, or a link that ended.
    pub async fn clear(&mut self) -> Result<Option<FaultRecord>, Failure> {
        let Some(fault) = self.pose.fault else { return Ok(None) };
        self.ask(Request::ClearFault { seen: fault.seq }).await?;
        self.wait_until(|pose| pose.fault.is_none()).await?;
        Ok(Some(fault))
    }

    /// Waits for poses until one satisfies `done`; a fault that was not latched before ends the wait.
    async fn wait_until(&mut self, done: impl Fn(&PoseReport) -> bool) -> Result<(), Failure> {
        self.wait_for(Some(MOTION_TIMEOUT), done).await.unwrap_or_else(|| {
            Err(Failure::device(format!("the board was still not done after {} s", MOTION_TIMEOUT.as_secs())))
        })
    }

    /// The same for at most `patience`, then `None`.
    async fn wait_for(
        &mut self,
        patience: Option<Duration>,
        done: impl Fn(&PoseReport) -> bool,
    ) -> Option<Result<(), Failure>> {
        let latched_before = self.pose.fault;
        let waited = async {
            loop {
                self.next_pose().await?;
                match self.pose.fault {
                    Some(fault) if latched_before.is_none() => {
                        return Err(Failure::device(describe_fault(&self.rig, &fault)));
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

/// A session id that no other connection has: never zero.
///
/// # Errors
/// Where the operating system has no randomness to give.
pub fn fresh_session() -> Result<SessionId, Failure> {
    use rand::TryRng;
    let random = rand::rngs::SysRng
        .try_next_u32()
        .map_err(|error| Failure::device(format!("the operating system gives no random numbers: {error}")))?;
    Ok(SessionId(random.max(1)))
}
