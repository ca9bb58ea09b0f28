//! Management of a board over any wire: no session, no protocol version, and a link that may go away and come back.

use std::time::Duration;

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::time::{sleep, sleep_until, timeout};
use vergence_protocol::management::{Identity, Management, ManagementReport, Outcome};
use vergence_protocol::update::{Upload, UploadState};
use vergence_protocol::{HostEvent, HostSession, MAX_FRAME, Microseconds};

use super::clock::HostClock;
use super::error::LinkError;
use super::open::{OpenWire, Port, open};
use crate::board::fresh_session;
use crate::failure::Failure;

/// When a request is sent again.
const REPEAT: Duration = Duration::from_millis(300);
/// How long a board that runs may take to answer. Erasing its state page and moving to flash takes some 50 ms.
const PATIENCE: Duration = Duration::from_secs(3);
/// How long the board may be silent in an update: longer than it takes to start again.
const UPDATE_PATIENCE: Duration = Duration::from_secs(12);
/// How often a port that went away is tried.
const REOPEN: Duration = Duration::from_millis(250);

/// Where a wire comes from, each time anew.
enum Door {
    Port(Port, u32),
    InProcess(Box<dyn FnMut() -> OpenWire + Send>),
}

impl Door {
    async fn open(&mut self) -> Result<OpenWire, Failure> {
        match self {
            Self::Port(port, baud) => open(port, *baud, false).await,
            Self::InProcess(wire) => Ok(wire()),
        }
    }
}

/// A link for management requests.
pub struct ManagementLink {
    door: Door,
    wire: OpenWire,
    session: HostSession,
    clock: HostClock,
}

impl ManagementLink {
    /// Opens the port. Nothing is sent yet.
    ///
    /// # Errors
    /// A port that cannot be opened.
    pub async fn open(port: Port, baud: u32) -> Result<Self, Failure> {
        Self::through(Door::Port(port, baud)).await
    }

    /// A link to a board in this process; `wire` gives another wire when one has ended.
    ///
    /// # Errors
    /// Where the system gives no random numbers.
    pub async fn in_process(wire: impl FnMut() -> OpenWire + Send + 'static) -> Result<Self, Failure> {
        Self::through(Door::InProcess(Box::new(wire))).await
    }

    async fn through(mut door: Door) -> Result<Self, Failure> {
        let wire = door.open().await?;
        Ok(Self { door, wire, session: HostSession::new(fresh_session()?), clock: HostClock::start() })
    }

    /// Who is there.
    ///
    /// # Errors
    /// [`LinkError`] where nobody answers.
    pub async fn identify(&mut self) -> Result<Identity, LinkError> {
        self.identify_within(PATIENCE).await
    }

    /// Who is there, once somebody is.
    ///
    /// # Errors
    /// [`LinkError`] where nobody answers in time.
    pub async fn identify_within(&mut self, patience: Duration) -> Result<Identity, LinkError> {
        self.repeat(&Management::Identify, patience, |report, _| match report {
            ManagementReport::Identity(identity) => Some(*identity),
            ManagementReport::Progress { .. } => None,
        })
        .await
    }

    /// Asks for something that does no harm when it is done twice.
    ///
    /// # Errors
    /// [`LinkError`] where nobody answers.
    pub async fn ask(&mut self, request: &Management) -> Result<Outcome, LinkError> {
        self.repeat(request, PATIENCE, outcome_of).await
    }

    /// Asks once, for something that must not be done twice. `None` where no answer came: it may have been done.
    ///
    /// # Errors
    /// [`LinkError`] where the link ended.
    pub async fn ask_once(&mut self, request: &Management) -> Result<Option<Outcome>, LinkError> {
        let asked = self.submit(request)?;
        self.answer(&[asked], REPEAT, &outcome_of).await
    }

    /// Sends an image, or what the board lacks of it. `progress` is shown how it goes.
    ///
    /// # Errors
    /// [`LinkError`] where the link ended or the board went silent: it can go on later.
    pub async fn upload(&mut self, upload: &mut Upload<'_>, progress: impl Fn(&Upload<'_>)) -> Result<(), LinkError> {
        let mut heard = self.clock.now();
        while !matches!(upload.state(), UploadState::Done | UploadState::Failed(_)) {
            let give_up = after(heard, UPDATE_PATIENCE);
            if self.clock.now() >= give_up {
                return Err(LinkError::Silent(UPDATE_PATIENCE));
            }
            upload.transmit(self.clock.now(), &mut self.session);
            let wake = upload.next_wake().map_or(give_up, |wake| wake.min(give_up));
            for report in self.exchange(wake).await? {
                heard = self.clock.now();
                upload.hear(heard, &report);
            }
            progress(upload);
        }
        Ok(())
    }

    /// Opens the port anew, as soon as it is there.
    ///
    /// # Errors
    /// Why it could not be opened for so long.
    pub async fn reopen(&mut self, patience: Duration) -> Result<(), Failure> {
        // Our own lock would keep us out.
        let (nowhere, _) = tokio::io::duplex(1);
        self.wire = OpenWire::in_process(nowhere);
        self.session = HostSession::new(fresh_session()?);
        let deadline = tokio::time::Instant::now() + patience;
        loop {
            match self.door.open().await {
                Ok(wire) => {
                    self.wire = wire;
                    return Ok(());
                }
                Err(failure) if tokio::time::Instant::now() >= deadline => return Err(failure),
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
        Err(LinkError::Silent(patience))
    }

    /// The first answer that `understand` takes.
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

    /// Sends what waits, and hears what comes first; nothing where it does not come before `wake`.
    async fn exchange(&mut self, wake: Microseconds) -> Result<Vec<ManagementReport>, LinkError> {
        let closed = |error: std::io::Error| LinkError::Closed(error.to_string());
        let mut frame = [0; MAX_FRAME];
        while let Some(length) = self.session.transmit(self.clock.now(), &mut frame) {
            // A wire that nobody empties must not hold us for ever.
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

/// What became of one of the requests `asked`.
fn outcome_of(report: &ManagementReport, asked: &[u8]) -> Option<Outcome> {
    match report {
        ManagementReport::Progress { to, outcome, .. } if asked.contains(to) => Some(*outcome),
        _ => None,
    }
}

fn after(now: Microseconds, wait: Duration) -> Microseconds {
    Microseconds(now.0 + wait.as_micros() as u64)
}
