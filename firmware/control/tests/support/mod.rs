//! An ideal rig for tests, and a host that talks to the controller between ticks.
#![allow(dead_code, unused_imports, reason = "each test file uses its own part")]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panic")]

mod ideal_rig;
mod watch;

use vergence_control::{
    AxisSettings, Controller, DriverSettings, EncoderSettings, HomingSettings, RigIo, SwitchSettings,
};
use vergence_protocol::{
    AxisKind, AxisMask, ControllerState, FaultRecord, Jog, Micro, Microseconds, Mode, Move, MoveId, Permille,
    PoseReport, Request, SessionId, Status,
};

pub use ideal_rig::{HomeSwitch, IdealRig};
pub use watch::{Watch, commanded};

pub const TICK_US: u64 = 1_000;
pub const HOST: SessionId = SessionId(0x5e55_1011);
pub const OTHER: SessionId = SessionId(0x0bad_cafe);
pub const LEASE_MS: u16 = 100;
const BEAT_US: u64 = 20_000;

/// A quick linear axis in micrometres; steps so fine that they hide nothing of the command.
pub fn linear() -> AxisSettings {
    AxisSettings {
        kind: AxisKind::Linear,
        min: Micro(60_000),
        max: Micro(220_000),
        speed: 200_000,
        acceleration: 1_500_000,
        jerk: 40_000_000,
        steps_per_unit: 500_000,
        counts_per_unit: 2_000_000,
        steps_reversed: false,
        counts_reversed: false,
        following_error: Micro(1_000),
        tolerance: Micro(20),
        backlash: Micro(0),
        correction: Micro(0),
        homing: HomingSettings {
            switch_at: Micro(58_000),
            seek_speed: 100_000,
            approach_speed: 5_000,
            retract: Micro(3_000),
            travel: Micro(200_000),
            repeatability: Micro(300),
        },
        driver: DriverSettings::default(),
        switches: SwitchSettings::default(),
        feedback: EncoderSettings::default(),
    }
}

/// A quick rotary axis in microradians.
pub fn rotary() -> AxisSettings {
    AxisSettings {
        kind: AxisKind::Rotary,
        min: Micro(0),
        max: Micro(2_268_928),
        speed: 2_500_000,
        acceleration: 12_000_000,
        jerk: 200_000_000,
        steps_per_unit: 250_000,
        counts_per_unit: 100_000,
        steps_reversed: false,
        counts_reversed: false,
        following_error: Micro(17_453),
        tolerance: Micro(349),
        backlash: Micro(0),
        correction: Micro(0),
        homing: HomingSettings {
            switch_at: Micro(-26_180),
            seek_speed: 1_000_000,
            approach_speed: 60_000,
            retract: Micro(34_907),
            travel: Micro(2_792_527),
            repeatability: Micro(3_000),
        },
        driver: DriverSettings::default(),
        switches: SwitchSettings::default(),
        feedback: EncoderSettings::default(),
    }
}

/// Longest time to rest from any state within the limits, in microseconds: v/a + 2a/j. The second a/j takes back
/// an acceleration that is still speeding the axis up.
pub fn longest_stop_us(axis: &AxisSettings) -> u64 {
    let [v, a, j] = [axis.speed, axis.acceleration, axis.jerk].map(f64::from);
    ((v / a + 2.0 * a / j) * 1e6).ceil() as u64
}

/// Controller, rig and a host in virtual time.
pub struct World {
    pub controller: Controller,
    pub rig: IdealRig,
    pub watch: Watch,
    pub now: Microseconds,
    next_tick: u64,
    next_beat: u64,
    /// Whether the host sends heartbeats.
    pub alive: bool,
    /// Whether plans are made as soon as their tick comes; else the test makes them.
    pub plans_itself: bool,
    move_id: u16,
}

impl World {
    /// A disarmed controller of both axes; the loads stand at `loads`, the host is alive.
    pub fn new(loads: [f64; 2]) -> Self {
        Self::with([linear(), rotary()], loads)
    }

    pub fn with(settings: [AxisSettings; 2], loads: [f64; 2]) -> Self {
        let controller = Controller::new(&settings).unwrap();
        let mut world = Self {
            controller,
            rig: IdealRig::new(&settings, &loads),
            watch: Watch::new(&settings),
            now: Microseconds(0),
            next_tick: 0,
            next_beat: 137,
            alive: true,
            plans_itself: true,
            move_id: 0,
        };
        world.wait(2 * BEAT_US);
        world
    }

    /// The processor restarts in whatever it is doing.
    pub fn restart(&mut self) {
        let settings = self.watch.settings();
        self.controller = Controller::new(&settings).unwrap();
        self.rig.set_drivers(false);
        self.watch = Watch::new(&settings);
        self.next_tick = self.now.0;
    }

    /// Armed, homed and at the low end of both ranges.
    pub fn homed(settings: [AxisSettings; 2]) -> Self {
        let mut world = Self::with(settings, [61_000.0, 3_000.0]);
        assert_eq!(world.arm(), Status::Accepted);
        assert_eq!(world.home(AxisMask::first(2)), Status::Accepted);
        world.wait_for(ControllerState::Ready);
        world
    }

    /// Lets `us` pass: heartbeats and ticks, each on its instant.
    pub fn wait(&mut self, us: u64) {
        let until = self.now.0 + us;
        loop {
            let next = self.next_tick.min(self.next_beat);
            if next > until {
                break;
            }
            self.reach(next);
            if next == self.next_beat {
                self.beat();
            } else {
                self.tick();
            }
        }
        self.reach(until);
    }

    /// Waits until `state`, ten seconds at most.
    pub fn wait_for(&mut self, state: ControllerState) {
        for _ in 0..10_000 {
            if self.controller.state() == state {
                return;
            }
            self.wait(TICK_US);
        }
        panic!("{state} not reached: {:?}", self.pose());
    }

    fn reach(&mut self, us: u64) {
        self.now = Microseconds(us);
        self.rig.reach(self.now);
    }

    fn beat(&mut self) {
        if self.alive {
            self.controller.heartbeat(self.now, HOST, LEASE_MS);
            self.watch.heartbeat(self.now, HOST, LEASE_MS);
        }
        self.next_beat += BEAT_US;
    }

    fn tick(&mut self) {
        let next = self.controller.poll(self.now, &mut self.rig);
        if self.plans_itself {
            self.controller.plan_at_once();
        }
        assert_eq!(next.0, self.now.0 + TICK_US);
        self.next_tick = next.0;
        self.watch.tick(self.now, &self.controller, &mut self.rig);
    }

    /// A heartbeat of another host.
    pub fn other_beats(&mut self) {
        self.controller.heartbeat(self.now, OTHER, LEASE_MS);
        self.watch.heartbeat(self.now, OTHER, LEASE_MS);
    }

    /// Asks the controller now, between two ticks.
    pub fn ask(&mut self, session: SessionId, request: &Request) -> Status {
        let status = self.controller.handle(self.now, session, request, &mut self.rig);
        self.watch.asked(self.now, (session, request, status), &self.controller, &self.rig);
        status
    }

    pub fn arm(&mut self) -> Status {
        self.ask(HOST, &Request::Arm { session: HOST })
    }

    pub fn home(&mut self, axes: AxisMask) -> Status {
        self.ask(HOST, &Request::Home { axes })
    }

    /// Asks for a move of `session`; the mode is its id's low byte.
    pub fn move_by(&mut self, session: SessionId, targets: [i32; 2], speed: u16) -> Status {
        self.move_id += 1;
        let targets = targets.into_iter().map(Micro).collect();
        let (id, mode) = (MoveId(self.move_id), Mode(1 + (self.move_id % 200) as u8));
        self.ask(session, &Request::MoveTo(Move { id, mode, targets, speed: Permille(speed) }))
    }

    pub fn move_to(&mut self, targets: [i32; 2]) -> Status {
        self.move_by(HOST, targets, 1000)
    }

    /// Asks for a jog at full speed.
    pub fn jog(&mut self, by: [i32; 2]) -> Status {
        self.move_id += 1;
        let by = by.into_iter().map(Micro).collect();
        self.ask(HOST, &Request::Jog(Jog { id: MoveId(self.move_id), by, speed: Permille::FULL }))
    }

    pub fn clear(&mut self) -> Status {
        let seen = self.pose().fault.map_or(0, |fault| fault.seq);
        self.ask(HOST, &Request::ClearFault { seen })
    }

    /// The latched fault; there must be one.
    pub fn fault(&self) -> FaultRecord {
        self.pose().fault.unwrap()
    }

    pub fn pose(&self) -> PoseReport {
        self.controller.pose(self.now, 0, &self.rig)
    }
}
