//! A connected board: what it says of itself, the poses that it sends, and how it is asked.

mod motion;
mod questions;
mod stream;
mod words;

use std::time::Duration;

use indicatif::ProgressBar;
use tokio::time::timeout;
use vergence_protocol::{
    AxisInfo, AxisMask, BoardInfo, Compatibility, ControllerState, Mode, MoveId, MovePhase, PoseReport, Refusal,
    Report, Request, SessionId, Status,
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
        let more = match (refusal, self.pose.fault) {
            (Refusal::Latched, Some(fault)) => format!(" ({})", describe_fault(&self.rig, &fault)),
            (Refusal::NotReferenced { axis } | Refusal::OutsideLimits { axis }, _) => {
                let known = self.rig.axes.get(usize::from(axis));
                known.map(|known| format!(" (axis {axis} is {})", known.name)).unwrap_or_default()
            }
            _ => String::new(),
        };
        let message = format!("the board refuses: {refusal}{more}");
        match refusal {
            Refusal::ReadOnly => Failure::protocol(message),
            Refusal::OutsideLimits { .. } | Refusal::Invalid | Refusal::BadSetting | Refusal::NoSetting => {
                Failure::usage(message)
            }
            _ => Failure::device(message),
        }
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
