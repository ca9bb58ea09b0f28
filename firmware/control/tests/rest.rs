//! A board with nothing to do ticks seldom, and is awake when somebody speaks.
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

use vergence_control::{BoardSettings, Delivered, Node, NodeIdentity, REST_US, TICK_US};
use vergence_plant::{NativeServices, Plant, bench_mechanics, bench_settings};
use vergence_protocol::{
    AxisMask, ControllerState, HostSession, MAX_FRAME, Microseconds, Request, ResetCause, SessionId, Trigger,
};

const HOST: SessionId = SessionId(1);

struct Board {
    node: Node,
    plant: Plant,
    services: NativeServices,
    host: HostSession,
    now: u64,
    ticks: u32,
}

impl Board {
    /// After its self-test, in a session without telemetry, and long silent.
    fn at_rest() -> Self {
        let settings = BoardSettings::new(&bench_settings()).unwrap();
        let identity = NodeIdentity {
            board: "test".try_into().unwrap(),
            hardware: 0,
            firmware: [0; 3],
            oldest: [0; 3],
            build: 0,
            uid: [0; 12],
            reset: ResetCause::PowerOn,
        };
        let mut services = NativeServices::default();
        let node = Node::new(&Delivered::for_bench(settings), identity, 1, &mut services).unwrap();
        let plant = Plant::new(&bench_mechanics(), &[100_000.0, 500_000.0]);
        let mut board = Self { node, plant, services, host: HostSession::new(HOST), now: 0, ticks: 0 };
        board.host.hello();
        board.talk();
        board.ask(Request::SetStream { period_us: 0 });
        board.run_to(500_000);
        board
    }

    /// Ticks up to an instant, then waits for it.
    fn run_to(&mut self, us: u64) {
        while self.node.wakes_at().0 <= us {
            let now = self.node.wakes_at();
            self.plant.advance(now);
            self.node.poll(now, &mut self.plant);
            assert!(self.node.wakes_at() > now);
            self.ticks += 1;
        }
        self.now = us;
    }

    fn ticks_in(&mut self, us: u64) -> u32 {
        self.ticks = 0;
        self.run_to(self.now + us);
        self.ticks
    }

    /// Frames go to the board and back, all now.
    fn talk(&mut self) {
        let (now, mut frame) = (Microseconds(self.now), [0; MAX_FRAME]);
        while let Some(length) = self.host.transmit(now, &mut frame) {
            self.node.receive(now, &frame[..length], &mut self.plant, &mut self.services);
            while let Some(length) = self.node.transmit(now, &mut frame) {
                self.host.receive(now, &frame[..length], |_| {});
            }
        }
    }

    fn ask(&mut self, request: Request) {
        self.host.submit(Microseconds(self.now), request).unwrap();
        self.talk();
    }

    fn state(&self) -> ControllerState {
        self.node.controller().state()
    }
}

#[test]
fn a_silent_board_ticks_at_the_pace_of_rest() {
    let mut board = Board::at_rest();
    assert_eq!(board.state(), ControllerState::Idle);
    assert_eq!(u64::from(board.ticks_in(1_000_000)), 1_000_000 / REST_US);
}

#[test]
fn telemetry_a_running_trigger_and_drivers_keep_it_awake() {
    let full = (1_000_000 / TICK_US) as u32;
    let wakers: [(Request, Request); 2] = [
        (Request::SetStream { period_us: 10_000 }, Request::SetStream { period_us: 0 }),
        (Request::SetTrigger(Trigger::Every { period_us: 50_000 }), Request::SetTrigger(Trigger::Off)),
    ];
    for (on, off) in wakers {
        let mut board = Board::at_rest();
        board.ask(on);
        assert!(board.ticks_in(1_000_000).abs_diff(full) <= 1);
        board.ask(off);
        assert!(board.ticks_in(1_000_000) < full / 10);
    }
    let mut board = Board::at_rest();
    board.host.send_now(Request::Heartbeat { session: HOST, lease_ms: 1_000 }).unwrap();
    board.ask(Request::Arm { session: HOST });
    assert_eq!(board.state(), ControllerState::Ready);
    assert!(board.ticks_in(1_000_000).abs_diff(full) <= 1);
}

#[test]
fn a_switch_that_changes_is_watched_closely_until_it_is_sure() {
    let mut board = Board::at_rest();
    let before = board.node.wakes_at().0;
    board.plant.axis_mut(0).unwrap().fix_home_switch(Some(true));
    let pace = |board: &mut Board| {
        board.run_to(board.node.wakes_at().0);
        board.node.wakes_at().0 - board.now
    };
    // The tick that sees it, and four more of the five that make it sure.
    assert_eq!([0; 5].map(|_| pace(&mut board)), [TICK_US, TICK_US, TICK_US, TICK_US, REST_US]);
    assert_eq!(board.now, before + 4 * TICK_US);
}

#[test]
fn whenever_somebody_speaks_the_next_tick_is_the_next_of_the_grid_and_none_was_missed() {
    for after in (0..2 * REST_US).step_by(77) {
        let mut board = Board::at_rest();
        let grid = board.node.wakes_at().0 % TICK_US;
        board.run_to(board.now + after);
        board.host.send_now(Request::Heartbeat { session: HOST, lease_ms: 1_000 }).unwrap();
        board.host.submit(Microseconds(board.now), Request::Arm { session: HOST }).unwrap();
        board.host.submit(Microseconds(board.now), Request::Home { axes: AxisMask::first(2) }).unwrap();
        board.talk();
        let next = board.node.wakes_at().0;
        assert_eq!(next % TICK_US, grid);
        // Not so soon that a board could not set its timer.
        assert!(next > board.now && next - board.now <= TICK_US + 20, "{after}");
        board.run_to(board.now + 50_000);
        assert_eq!(board.state(), ControllerState::Homing, "{after}");
    }
}
