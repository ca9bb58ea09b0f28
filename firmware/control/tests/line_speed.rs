//! The speed of the line: on trial until a host is heard at it, and looked for where nobody is heard.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panic")]

use vergence_control::{BoardSettings, Delivered, Node, NodeIdentity, settings_store};
use vergence_plant::{NativeServices, Plant, bench_mechanics, bench_settings};
use vergence_protocol::{
    HostEvent, HostSession, MAX_FRAME, Microseconds, Refusal, Report, Request, ResetCause, SessionId, SettingItem,
    SettingKey, Status,
};

const FACTORY: u32 = 921_600;
const FAST: u32 = 2_000_000;
const BAUD: SettingKey = SettingKey { item: SettingItem::Baud, axis: 0 };

/// A board on a wire that garbles what is sent at another speed than the receiver's.
struct Line {
    node: Node,
    plant: Plant,
    services: NativeServices,
    host: HostSession,
    host_baud: u32,
    /// Whether nothing of the board reaches the host.
    is_deaf: bool,
    now: u64,
    answers: Vec<Report>,
}

impl Line {
    /// A board that has just started with this speed saved.
    fn with_saved(baud: u32) -> Self {
        let defaults = BoardSettings::new(&bench_settings()).unwrap();
        let mut services = NativeServices::default();
        settings_store::save(&mut services.settings, &BoardSettings { baud, ..defaults.clone() }).unwrap();
        let identity = NodeIdentity {
            board: "test".try_into().unwrap(),
            hardware: 0,
            firmware: [0; 3],
            oldest: [0; 3],
            build: 0,
            uid: [0; 12],
            reset: ResetCause::PowerOn,
        };
        let node = Node::new(&Delivered::for_bench(defaults), identity, 1, &mut services).unwrap();
        let plant = Plant::new(&bench_mechanics(), &[100_000.0, 500_000.0]);
        let (host, answers) = (HostSession::new(SessionId(1)), Vec::new());
        Self { node, plant, services, host, host_baud: baud, is_deaf: false, now: 0, answers }
    }

    fn open() -> Self {
        let mut line = Self::with_saved(FACTORY);
        line.host.hello();
        line.run(200_000);
        assert!(line.host.is_open());
        line
    }

    /// Lets time pass; the host speaks and listens each millisecond.
    fn run(&mut self, us: u64) {
        let end = self.now + us;
        while self.now < end {
            self.now += 1_000;
            let now = Microseconds(self.now);
            while self.node.wakes_at() <= now {
                let tick = self.node.wakes_at();
                self.plant.advance(tick);
                self.node.poll(tick, &mut self.plant);
            }
            self.exchange(now);
        }
    }

    fn exchange(&mut self, now: Microseconds) {
        let mut frame = [0; MAX_FRAME];
        while let Some(length) = self.host.transmit(now, &mut frame) {
            let garble = if self.node.baud() == self.host_baud { 0 } else { 0x5A };
            let bytes: Vec<u8> = frame[..length].iter().map(|byte| byte ^ garble).collect();
            self.node.receive(now, &bytes, &mut self.plant, &mut self.services);
        }
        let baud = self.node.baud();
        while let Some(length) = self.node.transmit(now, &mut frame) {
            if baud == self.host_baud && !self.is_deaf {
                self.host.receive(now, &frame[..length], |event| {
                    if let HostEvent::Reply { report, .. } = event {
                        self.answers.push(report);
                    }
                });
            }
        }
    }

    fn submit(&mut self, request: Request) {
        self.host.submit(Microseconds(self.now), request).unwrap();
    }

    fn ask(&mut self, request: Request) -> Report {
        self.submit(request);
        self.run(500_000);
        self.answers.pop().unwrap()
    }

    fn set(&mut self, baud: u32) -> Report {
        self.ask(Request::SetSetting { key: BAUD, value: baud.into() })
    }

    fn saved(&mut self) -> u32 {
        let defaults = BoardSettings::new(&bench_settings()).unwrap();
        settings_store::load(&mut self.services.settings, &Delivered::for_bench(defaults)).unwrap().unwrap().baud
    }
}

fn status(report: &Report) -> Status {
    let Report::Ack { status, .. } = report else { panic!("{report:?}") };
    *status
}

#[test]
fn a_speed_that_nobody_uses_goes_back_after_five_seconds() {
    let mut line = Line::open();
    assert_eq!(status(&line.set(FAST)), Status::Accepted);
    assert_eq!((line.node.baud(), line.node.settings().baud), (FAST, FAST));
    line.run(4_400_000);
    assert_eq!(line.node.baud(), FAST);
    line.run(200_000);
    assert_eq!((line.node.baud(), line.node.settings().baud), (FACTORY, FACTORY));
    assert_eq!(status(&line.ask(Request::SaveSettings)), Status::Accepted);
    assert_eq!(line.saved(), FACTORY);
}

#[test]
fn a_request_to_save_in_the_same_breath_is_refused() {
    let mut line = Line::open();
    line.submit(Request::SetSetting { key: BAUD, value: FAST.into() });
    line.submit(Request::SaveSettings);
    line.run(100_000);
    let statuses: Vec<_> = line.answers.iter().map(status).collect();
    assert_eq!(statuses, [Status::Accepted, Status::Refused(Refusal::LineOnTrial)]);
    assert_eq!(line.saved(), FACTORY);
}

#[test]
fn a_frame_at_the_new_speed_settles_it() {
    let mut line = Line::open();
    line.set(FAST);
    line.host_baud = FAST;
    assert_eq!(status(&line.ask(Request::SaveSettings)), Status::Accepted);
    assert_eq!(line.saved(), FAST);
    for _ in 0..20 {
        line.ask(Request::GetSetting(BAUD));
    }
    assert_eq!((line.node.baud(), line.node.settings().baud), (FAST, FAST));
}

/// One direction of the line does not prove the other.
#[test]
fn a_host_that_does_not_hear_the_board_settles_nothing() {
    let mut line = Line::open();
    line.set(FAST);
    (line.host_baud, line.is_deaf) = (FAST, true);
    line.host = HostSession::new(SessionId(2));
    line.host.hello();
    line.run(4_800_000);
    assert_eq!((line.node.baud(), line.node.settings().baud), (FACTORY, FACTORY));
}

#[test]
fn a_frame_that_was_sent_before_the_change_does_not_settle_it() {
    let mut line = Line::open();
    line.submit(Request::SetSetting { key: BAUD, value: FAST.into() });
    line.run(1_000);
    assert_eq!(line.node.baud(), FAST);
    // It waited in a buffer: the bytes are good.
    line.host_baud = FAST;
    line.submit(Request::GetSetting(BAUD));
    line.run(2_000);
    line.host_baud = FACTORY;
    line.run(5_100_000);
    assert_eq!(line.node.baud(), FACTORY);
}

#[test]
fn a_board_that_hears_nobody_listens_at_both_speeds_in_turn() {
    let mut line = Line::with_saved(FAST);
    let mut heard = Vec::new();
    for _ in 0..6 {
        line.run(500_000);
        heard.push(line.node.baud());
        line.run(500_000);
    }
    assert_eq!(heard, [FAST, FACTORY, FAST, FACTORY, FAST, FACTORY]);
    line.host_baud = FACTORY;
    line.host.hello();
    line.run(2_000_000);
    assert!(line.host.is_open());
    // Whoever speaks keeps the line as it is.
    for _ in 0..20 {
        line.ask(Request::GetSetting(BAUD));
        assert_eq!((line.node.baud(), line.node.settings().baud), (FACTORY, FAST));
    }
    // A host that goes leaves the board to whoever comes next.
    line.run(6_600_000);
    assert_eq!(line.node.baud(), FAST);
}

#[test]
fn at_the_speed_of_the_factory_there_is_nothing_to_look_for() {
    let mut line = Line::with_saved(FACTORY);
    for _ in 0..10 {
        line.run(1_000_000);
        assert_eq!(line.node.baud(), FACTORY);
    }
}
