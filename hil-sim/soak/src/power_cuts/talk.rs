//! A host on the serial line of a simulated board, in virtual time: management requests, and those of a session.

use vergence_mcu::{
    Bench, BenchWiring, ChipConfig, FlashCells, FlashOperation, Frame, Halt, LineFault, Machine, Picoseconds, Stops,
    UartId,
};
use vergence_plant::{Plant, bench_mechanics};
use vergence_protocol::management::{BootState, Identity, Management, ManagementReport, Outcome, RebootTo};
use vergence_protocol::update::{Upload, UploadState};
use vergence_protocol::{HostEvent, HostSession, MAX_FRAME, Microseconds, Report, Request, SessionId, Ticket};

use super::image::SignedImage;

const BAUD: u32 = 921_600;
/// Period at which the host polls the wire.
const STEP_US: u64 = 1_000;
/// Period at which the host repeats a request: less than a rollback takes, whose answer must come all the same.
const REPEAT_US: u64 = 100_000;
/// Longest wait: a swap and its undoing, three failed starts, and a margin.
const START_PATIENCE_US: u64 = 40_000_000;
const ANSWER_PATIENCE_US: u64 = 5_000_000;
const UPLOAD_PATIENCE_US: u64 = 60_000_000;
/// Positions of the stages, in micro-units.
const STAGES: [f64; 2] = [63_000.0, 40_000.0];

/// A board and its host.
pub struct Talk {
    machine: Machine<Bench>,
    host: HostSession,
    now: Microseconds,
    reports: Vec<ManagementReport>,
    replies: Vec<(Ticket, Report)>,
    /// Operations of the flash so far, where they are recorded.
    pub operations: Vec<FlashOperation>,
}

impl Talk {
    /// Starts a board with these contents of flash. Waiting for the flash is skipped.
    pub fn switched_on(cells: &FlashCells) -> Self {
        let plant = Plant::new(&bench_mechanics(), &STAGES);
        let mut machine = Machine::new(ChipConfig::default(), Bench::new(BenchWiring::nucleo_g474(), plant));
        machine.chip_mut().set_flash_cells(cells);
        machine.power_on();
        machine.set_skips_waiting(true);
        machine.track_pages();
        Self {
            machine,
            host: HostSession::new(SessionId(1)),
            now: Microseconds(0),
            reports: Vec::new(),
            replies: Vec::new(),
            operations: Vec::new(),
        }
    }

    /// Starts to record the flash operations.
    pub fn list_operations(&mut self) {
        self.machine.set_stops(Stops { flash_operations: true, ..Stops::default() });
    }

    /// The board.
    pub fn machine(&self) -> &Machine<Bench> {
        &self.machine
    }

    fn step(&mut self) -> Result<(), String> {
        self.now.0 += STEP_US;
        loop {
            match self.machine.run_until(Picoseconds::microseconds(self.now.0)) {
                Halt::Reached => break,
                Halt::FlashOperation(operation) => self.operations.push(operation),
                halt => return Err(halt.to_string()),
            }
        }
        let sent: Vec<u8> = self.machine.chip_mut().take_sent(UartId::LPUART1).iter().map(|sent| sent.byte).collect();
        let (reports, replies) = (&mut self.reports, &mut self.replies);
        self.host.receive(self.now, &sent, |event| match event {
            HostEvent::Management(report) => reports.push(report),
            HostEvent::Reply { ticket, report } => replies.push((ticket, report)),
            _ => {}
        });
        let mut frame = [0; MAX_FRAME];
        while let Some(length) = self.host.transmit(self.now, &mut frame) {
            let frames: Vec<Frame> =
                frame[..length].iter().map(|&byte| Frame { byte, baud: BAUD, fault: LineFault::None }).collect();
            self.machine.chip_mut().send(UartId::LPUART1, &frames);
        }
        Ok(())
    }

    /// Repeats a request until it is answered.
    fn ask_until<T>(
        &mut self,
        request: &Management,
        patience_us: u64,
        understand: impl Fn(&ManagementReport) -> Option<T>,
    ) -> Result<T, String> {
        let give_up = self.now.0 + patience_us;
        let mut next = self.now.0;
        while self.now.0 < give_up {
            if self.now.0 >= next {
                self.host.manage(request.clone()).map_err(|error| error.to_string())?;
                next = self.now.0 + REPEAT_US;
            }
            self.step()?;
            if let Some(answer) = std::mem::take(&mut self.reports).iter().find_map(&understand) {
                return Ok(answer);
            }
        }
        Err(format!("no answer to {request:?} in {patience_us} us, {}", self.machine.place()))
    }

    /// Opens a session.
    pub fn open(&mut self) -> Result<(), String> {
        self.host.hello();
        let give_up = self.now.0 + START_PATIENCE_US;
        while !self.host.is_open() {
            if self.now.0 > give_up {
                return Err(format!("no session opens, {}", self.machine.place()));
            }
            self.step()?;
        }
        Ok(())
    }

    /// Makes a request in the session, and waits for its answer.
    pub fn ask_session(&mut self, request: &Request) -> Result<Report, String> {
        let ticket = self.host.submit(self.now, request.clone()).map_err(|error| error.to_string())?;
        let give_up = self.now.0 + ANSWER_PATIENCE_US;
        while self.now.0 < give_up {
            self.step()?;
            if let Some(index) = self.replies.iter().position(|(answered, _)| *answered == ticket) {
                return Ok(self.replies.swap_remove(index).1);
            }
        }
        Err(format!("no answer to {request:?}, {}", self.machine.place()))
    }

    /// The identity of the program that answers first.
    pub fn identify(&mut self) -> Result<Identity, String> {
        self.identify_as(|_| true)
    }

    /// Waits until the board is in the state asked for.
    fn identify_as(&mut self, is_it: impl Fn(&Identity) -> bool) -> Result<Identity, String> {
        self.ask_until(&Management::Identify, START_PATIENCE_US, |report| match report {
            ManagementReport::Identity(identity) if is_it(identity) => Some(*identity),
            _ => None,
        })
    }

    fn ask(&mut self, request: &Management) -> Result<(), String> {
        let outcome = self.ask_until(request, ANSWER_PATIENCE_US, |report| match report {
            ManagementReport::Progress { outcome, .. } => Some(*outcome),
            ManagementReport::Identity(_) => None,
        })?;
        if outcome == Outcome::Done { Ok(()) } else { Err(format!("{request:?} is refused: {outcome}")) }
    }

    /// Makes a whole update: confirms an image on trial, sends the new one, starts and confirms it.
    pub fn update(&mut self, image: &SignedImage) -> Result<(), String> {
        self.start_on_trial(image)?;
        self.ask(&Management::Confirm)?;
        let build = image.seal.header.build;
        self.identify_as(|now| now.boot == BootState::Confirmed && now.build == build).map(|_| ())
    }

    /// Makes an update without confirmation, and a new start: the board goes back.
    pub fn try_and_go_back(&mut self, image: &SignedImage) -> Result<(), String> {
        self.start_on_trial(image)?;
        self.reboot()?;
        self.identify_as(|now| now.boot == BootState::Reverted).map(|_| ())
    }

    /// Gives up the confirmed image for `image`, the one before it.
    pub fn roll_back(&mut self, image: &SignedImage) -> Result<(), String> {
        self.identify()?;
        self.ask(&Management::Rollback)?;
        self.reboot()?;
        let build = image.seal.header.build;
        self.identify_as(|now| now.boot == BootState::Reverted && now.build == build).map(|_| ())
    }

    fn start_on_trial(&mut self, image: &SignedImage) -> Result<(), String> {
        if self.identify()?.boot == BootState::Trial {
            self.ask(&Management::Confirm)?;
        }
        self.send(image)?;
        self.reboot()?;
        let build = image.seal.header.build;
        self.identify_as(|now| now.boot == BootState::Trial && now.build == build).map(|_| ())
    }

    /// Restarts the board once: an image on trial that starts twice goes back.
    fn reboot(&mut self) -> Result<(), String> {
        let asked = self.host.manage(Management::Reboot(RebootTo::Application));
        asked.map(|_| ()).map_err(|error| error.to_string())
    }

    fn send(&mut self, image: &SignedImage) -> Result<(), String> {
        let mut upload = Upload::new(&image.bytes, image.seal.header, image.seal.signature)
            .ok_or("the image is not as long as its header says")?;
        let give_up = self.now.0 + UPLOAD_PATIENCE_US;
        while self.now.0 < give_up {
            upload.transmit(self.now, &mut self.host);
            self.step()?;
            for report in std::mem::take(&mut self.reports) {
                upload.receive(self.now, &report);
            }
            match upload.state() {
                UploadState::Done => return Ok(()),
                UploadState::Failed(outcome) => return Err(format!("the image is refused: {outcome}")),
                _ => {}
            }
        }
        Err(format!("the upload stands at {:?}", upload.progress()))
    }
}
