//! Management requests over any wire. They need no session and no protocol version, and survive a link that ends and comes
//! back.

use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::time::{sleep, sleep_until, timeout};
use vergence_protocol::management::{Identity, Management, ManagementReport, Outcome};
use vergence_protocol::update::{Upload, UploadState};
use vergence_protocol::{HostEvent, HostSession, MAX_FRAME, Microseconds};

use super::clock::HostClock;
use super::error::{LinkError, OpenError};
use super::open::{OpenWire, Port, open};
use super::session_id::fresh_session;

/// Time after which an unanswered request is sent again.
const REPEAT: Duration = Duration::from_millis(300);
/// Longest wait for the answer of a running board. Erasing its state page and writing to flash takes some 50 ms.
const PATIENCE: Duration = Duration::from_secs(3);
/// Longest silence of the board in an update: longer than its restart.
const UPDATE_PATIENCE: Duration = Duration::from_secs(12);
/// Time between two attempts to open a port that disappeared.
const REOPEN: Duration = Duration::from_millis(250);

/// The source of wires: a new one after each loss.
enum WireSource {
    Port(Port, u32),
    InProcess(Box<dyn FnMut() -> OpenWire + Send>),
}

impl WireSource {
    async fn open(&mut self) -> Result<OpenWire, OpenError> {
        match self {
            Self::Port(port, baud) => open(port, *baud, false).await,
            Self::InProcess(wire) => Ok(wire()),
        }
    }
}

/// A link for management requests.
pub struct ManagementLink {
    source: WireSource,
    wire: OpenWire,
    session: HostSession,
    clock: HostClock,
}

impl ManagementLink {
    /// Opens the port. Sends nothing yet.
    ///
    /// # Errors
    /// [`OpenError`] where the port cannot be opened.
    pub async fn open(port: Port, baud: u32) -> Result<Self, OpenError> {
        Self::through(WireSource::Port(port, baud)).await
    }

    /// Connects to a board in this process; `wire` makes the first wire, and another one after each loss.
    ///
    /// # Errors
    /// [`OpenError`] where the system gives no random numbers.
    pub async fn in_process(wire: impl FnMut() -> OpenWire + Send + 'static) -> Result<Self, OpenError> {
        Self::through(WireSource::InProcess(Box::new(wire))).await
    }

    async fn through(mut source: WireSource) -> Result<Self, OpenError> {
        let wire = source.open().await?;
        Ok(Self { source, wire, session: HostSession::new(fresh_session()?), clock: HostClock::start() })
    }

    /// Asks the board for its identity: hardware, firmware version and boot state.
    ///
    /// # Errors
    /// [`LinkError`] where no board answers within three seconds.
    pub async fn identify(&mut self) -> Result<Identity, LinkError> {
        self.identify_within(PATIENCE).await
    }

    /// Asks for the board's identity until a board answers, for at most `patience`.
    ///
    /// # Errors
    /// [`LinkError`] where no board answers in time.
    pub async fn identify_within(&mut self, patience: Duration) -> Result<Identity, LinkError> {
        self.repeat(&Management::Identify, patience, |report, _| match report {
            ManagementReport::Identity(identity) => Some(*identity),
            ManagementReport::Progress { .. } => None,
        })
        .await
    }

    /// Sends a request until the board answers. Only for requests that may be carried out twice.
    ///
    /// # Errors
    /// [`LinkError`] where no board answers within three seconds.
    pub async fn ask(&mut self, request: &Management) -> Result<Outcome, LinkError> {
        self.repeat(request, PATIENCE, outcome_of).await
    }

    /// Sends a request once, because it must not be carried out twice. `None` where no answer came: the board may have carried
    /// it out.
    ///
    /// # Errors
    /// [`LinkError`] where the link ended.
    pub async fn ask_once(&mut self, request: &Management) -> Result<Option<Outcome>, LinkError> {
        let asked = self.submit(request)?;
        self.answer(&[asked], REPEAT, &outcome_of).await
    }

    /// Sends the part of an image that the board lacks, and calls `progress` after each report of the board.
    ///
    /// # Errors
    /// [`LinkError`] where the link ended or the board went silent; the upload can be resumed.
    pub async fn upload(
        &mut self,
        upload: &mut Upload<'_>,
        mut progress: impl FnMut(&Upload<'_>),
    ) -> Result<(), LinkError> {
        let mut last_report = self.clock.now();
        while !matches!(upload.state(), UploadState::Done | UploadState::Failed(_)) {
            let give_up = after(last_report, UPDATE_PATIENCE);
            if self.clock.now() >= give_up {
                return Err(LinkError::Silent(UPDATE_PATIENCE));
            }
            upload.transmit(self.clock.now(), &mut self.session);
            let wake = upload.next_wake().map_or(give_up, |wake| wake.min(give_up));
            for report in self.exchange(wake).await? {
                last_report = self.clock.now();
                upload.receive(last_report, &report);
            }
            progress(upload);
        }
        Ok(())
    }

    /// Closes the port and opens it again, trying for at most `patience`.
    ///
    /// # Errors
    /// [`OpenError`] of the last attempt.
    pub async fn reopen(&mut self, patience: Duration) -> Result<(), OpenError> {
        // The lock in the old wire would make the port look taken.
        let (nowhere, _) = tokio::io::duplex(1);
        self.wire = OpenWire::in_process(nowhere);
        self.session = HostSession::new(fresh_session()?);
        let deadline = tokio::time::Instant::now() + patience;
        loop {
            match self.source.open().await {
                Ok(wire) => {
                    self.wire = wire;
                    return Ok(());
                }
                Err(error) if tokio::time::Instant::now() >= deadline => return Err(error),
                Err(_) => sleep(REOPEN).await,
            }
        }
    }

    async fn repeat<T>(
        &mut self,
        request: &Management,
        patience: Duration,
        understand: impl Fn(&ManagementReport, &[u8]) -> Option<T>,
    ) -> Result<T, LinkError> {
        let deadline = after(self.clock.now(), patience);
        let mut asked = Vec::new();
        while self.clock.now() < deadline {
            asked.push(self.submit(request)?);
            if let Some(answer) = self.answer(&asked, REPEAT, &understand).await? {
                return Ok(answer);
            }
        }
        let silent = LinkError::Silent(patience);
        Err(match &self.source {
            WireSource::Port(port, _) => silent.behind(port),
            WireSource::InProcess(_) => silent,
        })
    }

    /// The first report that `understand` accepts as an answer; `None` where none came within `patience`.
    async fn answer<T>(
        &mut self,
        asked: &[u8],
        patience: Duration,
        understand: &impl Fn(&ManagementReport, &[u8]) -> Option<T>,
    ) -> Result<Option<T>, LinkError> {
        let wake = after(self.clock.now(), patience);
        while self.clock.now() < wake {
            let reports = self.exchange(wake).await?;
            if let Some(answer) = reports.iter().find_map(|report| understand(report, asked)) {
                return Ok(Some(answer));
            }
        }
        Ok(None)
    }

    fn submit(&mut self, request: &Management) -> Result<u8, LinkError> {
        self.session.manage(request.clone()).map_err(|error| LinkError::Unsendable(error.to_string()))
    }

    /// Sends all queued frames, then returns the reports of the next bytes that arrive; none where no bytes arrive before `wake`.
    async fn exchange(&mut self, wake: Microseconds) -> Result<Vec<ManagementReport>, LinkError> {
        let closed = |error: std::io::Error| LinkError::Closed(error.to_string());
        let mut frame = [0; MAX_FRAME];
        while let Some(length) = self.session.transmit(self.clock.now(), &mut frame) {
            // A wire that nobody reads would block for ever.
            let written = self.wire.stream.write_all(frame.get(..length).unwrap_or_default());
            timeout(PATIENCE, written).await.map_err(|_| LinkError::Silent(PATIENCE))?.map_err(closed)?;
        }
        self.wire.stream.flush().await.map_err(closed)?;
        let mut input = [0; 1024];
        let length = tokio::select! {
            read = self.wire.stream.read(&mut input) => match read.map_err(closed)? {
                0 => return Err(LinkError::Closed("end of stream".into())),
                length => length,
            },
            () = sleep_until(self.clock.instant(wake)) => 0,
        };
        let mut reports = Vec::new();
        self.session.receive(self.clock.now(), input.get(..length).unwrap_or_default(), |event| {
            if let HostEvent::Management(report) = event {
                reports.push(report);
            }
        });
        Ok(reports)
    }
}

/// The outcome of one of the requests `asked`.
fn outcome_of(report: &ManagementReport, asked: &[u8]) -> Option<Outcome> {
    match report {
        ManagementReport::Progress { to, outcome, .. } if asked.contains(to) => Some(*outcome),
        _ => None,
    }
}

fn after(now: Microseconds, wait: Duration) -> Microseconds {
    Microseconds(now.0 + wait.as_micros() as u64)
}
