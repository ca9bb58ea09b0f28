//! A random session: what a host asks, and what befalls the mechanics, drawn from a seed.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_protocol::{
    AxisMask, Jog, Micro, Mode, Move, MoveId, Permille, Request, SettingItem, SettingKey, StopKind, Trigger,
};

use super::mishap::Mishap;
use crate::stages::stages;

/// One act of a session.
#[derive(Clone, Debug, PartialEq)]
pub enum Act {
    /// Open a new session, with telemetry at this period in microseconds.
    Open(u32),
    /// Send a request in order, and wait so many ticks.
    Ask(Request, u32),
    /// Send a request outside the order.
    AskNow(Request),
    /// Arm for the open session.
    Arm,
    /// Wait so many ticks.
    Wait(u32),
    /// Wait until everything is at rest.
    Rest,
    /// Heartbeats stop for so many ticks.
    Silence(u32),
    /// Something happens to the mechanics.
    Mishap(Mishap),
    /// The next control tick comes so many microseconds late.
    LateTick(u64),
    /// An update with these bytes and a bad signature, and then a restart.
    Update(Vec<u8>),
    /// A whole update, which both boards accept.
    Install(Fate),
    /// The reset button is pressed.
    Reset,
    /// Mend the mechanics, clear a fault, arm, and home what has no reference: what a person would do.
    Recover,
    /// Read all recorded events.
    ReadEvents,
}

/// What becomes of an image that a board has accepted and started on trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fate {
    /// It is confirmed.
    Kept,
    /// It is not confirmed, and the next start goes back to the image before.
    Reverted,
    /// It is confirmed, and a rollback goes back to the image before.
    RolledBack,
}

/// One session.
#[derive(Clone, Debug, PartialEq)]
pub struct Session {
    /// The seed from which the session was drawn.
    pub seed: u64,
    /// What happens in it.
    pub acts: Vec<Act>,
    /// Positions of the stages at the start, in micro-units.
    pub positions: [f64; 2],
}

/// Periods of telemetry, in microseconds.
const PERIODS_US: [u32; 5] = [1_000, 2_000, 3_700, 5_000, 10_000];

/// Share of sessions with a whole update.
const INSTALLS: f64 = 0.03;

impl Session {
    /// Draws the session of a seed.
    #[must_use]
    pub fn of(seed: u64) -> Self {
        let mut draw = Draw { random: Pcg64Mcg::seed_from_u64(seed ^ 0xd1ff), acts: Vec::new(), moves: 0 };
        let positions = stages().map(|stage| {
            let low = f64::midpoint(stage.mechanics.home_switch, stage.mechanics.hard_limits[0]);
            let share: f64 = draw.random.random::<f64>().powi(4) * 0.3;
            low + share * (f64::from(stage.settings.max.0) - low)
        });
        draw.begin();
        for _ in 0..draw.random.random_range(1..=3) {
            draw.episode();
        }
        draw.install(seed);
        draw.end();
        Self { seed, acts: draw.acts, positions }
    }
}

struct Draw {
    random: Pcg64Mcg,
    acts: Vec<Act>,
    moves: u16,
}

impl Draw {
    fn happens(&mut self, probability: f64) -> bool {
        self.random.random_bool(probability)
    }

    fn ask(&mut self, request: Request) {
        let pause = self.random.random_range(5..30);
        self.acts.push(Act::Ask(request, pause));
    }

    fn wait(&mut self, ticks: std::ops::Range<u32>) {
        let ticks = self.random.random_range(ticks);
        self.acts.push(Act::Wait(ticks));
    }

    fn axis(&mut self) -> usize {
        self.random.random_range(0..2)
    }

    fn begin(&mut self) {
        let period = PERIODS_US[self.random.random_range(0..PERIODS_US.len())];
        self.acts.push(Act::Open(period));
        for _ in 0..self.random.random_range(0..4) {
            self.question();
        }
        if self.happens(0.3) {
            let order = self.target();
            self.ask(Request::MoveTo(order));
        }
        if self.happens(0.4) {
            self.settings();
        }
        if self.happens(0.8) {
            // So that homing is soon over.
            for (axis, value) in [(0, 1_000), (1, 12_000)] {
                self.ask(Request::SetSetting { key: SettingKey { item: SettingItem::HomeRetract, axis }, value });
            }
        }
        self.acts.push(Act::Arm);
        if self.happens(0.3) {
            let order = self.target();
            self.ask(Request::MoveTo(order));
        }
        if self.happens(0.4) {
            // Upwards: without a reference no limit is checked.
            let by = [2_000, 35_000].map(|most| Micro(self.random.random_range(0..most)));
            self.jog(by);
            self.acts.push(Act::Rest);
        }
        if self.happens(0.2) {
            let axes = AxisMask(self.random.random_range(0..5));
            self.ask(Request::Home { axes });
            if self.happens(0.5) {
                self.wait(20..900);
                self.stop();
            }
            self.acts.push(Act::Rest);
        }
        self.acts.push(Act::Recover);
    }

    /// In few sessions a whole update, which takes as long as all else. Drawn apart from the rest of the session.
    fn install(&mut self, seed: u64) {
        let mut random = Pcg64Mcg::seed_from_u64(seed ^ 0x1a57);
        if random.random_bool(INSTALLS) {
            let fates = [Fate::Kept, Fate::Reverted, Fate::RolledBack];
            let fate = fates[random.random_range(0..fates.len())];
            self.acts.push(Act::Ask(Request::Disarm, 20));
            self.acts.extend([Act::Rest, Act::Install(fate), Act::Recover]);
            self.go();
        }
    }

    fn end(&mut self) {
        self.acts.push(Act::Recover);
        self.acts.push(Act::ReadEvents);
        self.ask(Request::GetStatistics);
        self.ask(Request::Disarm);
        self.acts.push(Act::Rest);
    }

    fn question(&mut self) {
        let [item, axis] = [self.random.random_range(0..SettingItem::ALL.len()), self.axis()];
        let request = match self.random.random_range(0..6) {
            0 => Request::GetAxis { axis: self.random.random_range(0..3) },
            1 => Request::GetStatistics,
            2 => Request::GetEvents { first: self.random.random_range(0..40) },
            3 => return self.acts.push(Act::AskNow(Request::TimeProbe { t0: Default::default() })),
            4 => return self.acts.push(Act::AskNow(Request::GetInfo)),
            _ => Request::GetSetting(SettingKey { item: SettingItem::ALL[item], axis: axis as u8 }),
        };
        self.ask(request);
    }

    /// Changes settings while disarmed, reads them back, and may save or restore them.
    fn settings(&mut self) {
        for _ in 0..self.random.random_range(1..4) {
            let (key, value) = self.setting();
            self.ask(Request::SetSetting { key, value });
            self.ask(Request::GetSetting(key));
        }
        if self.happens(0.3) {
            self.acts.push(Act::Ask(Request::SaveSettings, 80));
        }
        if self.happens(0.3) {
            self.ask(Request::RestoreSettings);
        }
    }

    fn setting(&mut self) -> (SettingKey, i64) {
        let axis = self.axis();
        let settings = stages()[axis].settings;
        let share = self.random.random_range(0.4..1.0);
        let part = |value: u32| (f64::from(value) * share) as i64;
        let (item, value) = match self.random.random_range(0..10) {
            0 => (SettingItem::Speed, part(settings.speed)),
            1 => (SettingItem::Acceleration, part(settings.acceleration)),
            2 => (SettingItem::Jerk, part(settings.jerk)),
            3 => (SettingItem::Backlash, part([400, 10_000][axis])),
            4 => (SettingItem::HomeSeekSpeed, part(settings.homing.seek_speed)),
            5 => (SettingItem::FollowingError, part(settings.following_error.0.unsigned_abs())),
            6 => (SettingItem::HomeRetract, part(settings.homing.retract.0.unsigned_abs())),
            7 => (SettingItem::Max, part(settings.max.0.unsigned_abs()).max(i64::from(settings.min.0) + 50_000)),
            8 => (SettingItem::StreamPeriod, self.random.random_range(0..20_000)),
            // Most of these are refused.
            _ => {
                let item = SettingItem::ALL[self.random.random_range(0..SettingItem::Baud as usize)];
                (item, self.random.random_range(-3..3))
            }
        };
        (SettingKey { item, axis: if item.is_of_axis() { axis as u8 } else { 0 } }, value)
    }

    fn name_move(&mut self) -> MoveId {
        self.moves += 1;
        MoveId(self.moves)
    }

    /// A target in the range; few are beyond it or otherwise refused.
    fn target(&mut self) -> Move {
        let mut targets = stages().map(|stage| {
            let [min, max] = [stage.settings.min.0, stage.settings.max.0];
            Micro(self.random.random_range(min..=min + (max - min) / 2))
        });
        if self.happens(0.08) {
            let axis = self.axis();
            targets[axis].0 += stages()[axis].settings.max.0;
        }
        let speed = if self.happens(0.04) { Permille(0) } else { Permille(self.random.random_range(300..=1000)) };
        let (id, mode) = (self.name_move(), Mode(self.random.random_range(0..4)));
        Move { id, mode, targets: targets.into_iter().collect(), speed }
    }

    fn jog(&mut self, by: [Micro; 2]) {
        let (id, speed) = (self.name_move(), Permille(self.random.random_range(200..=1000)));
        self.ask(Request::Jog(Jog { id, by: by.into_iter().collect(), speed }));
    }

    fn go(&mut self) {
        let order = self.target();
        self.ask(Request::MoveTo(order));
    }

    fn stop(&mut self) {
        let kind = if self.happens(0.6) { StopKind::Decelerate } else { StopKind::TorqueOff };
        self.acts.push(Act::AskNow(Request::Stop { kind }));
    }

    /// Something that a host does, or that befalls the board.
    fn episode(&mut self) {
        match self.random.random_range(0..18) {
            0..3 => self.go(),
            3..6 => {
                self.go();
                for _ in 0..self.random.random_range(1..4) {
                    self.wait(1..500);
                    self.go();
                }
            }
            6 => {
                self.go();
                self.wait(1..700);
                self.stop();
            }
            7 => {
                let by = [30_000, 400_000].map(|most| Micro(self.random.random_range(-most..most)));
                self.jog(by);
                self.wait(1..300);
                self.question();
            }
            8 => {
                self.go();
                self.wait(1..500);
                self.ask(Request::Disarm);
                self.acts.push(Act::Rest);
                self.settings();
            }
            9 => {
                self.go();
                self.wait(1..400);
                let ticks = self.random.random_range(10..400);
                self.acts.push(Act::Silence(ticks));
            }
            10 => self.trigger(),
            11 => {
                self.go();
                self.wait(20..500);
                let late = if self.happens(0.6) {
                    self.random.random_range(10..185)
                } else {
                    self.random.random_range(215..1_500)
                };
                self.acts.push(Act::LateTick(late));
            }
            12 => {
                self.go();
                self.wait(1..500);
                self.acts.push(Act::Reset);
                let period = PERIODS_US[self.random.random_range(0..PERIODS_US.len())];
                self.acts.push(Act::Open(period));
            }
            13 => self.nonsense(),
            14 => {
                self.ask(Request::Disarm);
                let length = self.random.random_range(1..2_500);
                let image = (0..length).map(|_| self.random.random()).collect();
                self.acts.push(Act::Update(image));
                self.acts.push(Act::Open(PERIODS_US[3]));
            }
            _ => self.mishap(),
        }
        self.acts.push(Act::Rest);
        self.acts.push(Act::Recover);
    }

    fn trigger(&mut self) {
        let moving = self.happens(0.7);
        if moving {
            self.go();
            self.wait(1..200);
        }
        let trigger = match self.random.random_range(0..4) {
            0 | 1 => Trigger::Once,
            2 => Trigger::Every { period_us: self.random.random_range(5_000..60_000) },
            _ => Trigger::Every { period_us: self.random.random_range(0..6_000) },
        };
        self.ask(Request::SetTrigger(trigger));
        self.wait(20..200);
        self.ask(Request::SetTrigger(Trigger::Off));
    }

    /// Requests that are refused, or change nothing.
    fn nonsense(&mut self) {
        for _ in 0..3 {
            let session = vergence_protocol::SessionId(self.random.random_range(1..9));
            let number = self.random.random_range(0..4);
            match self.random.random_range(0..6) {
                0 => self.ask(Request::Arm { session }),
                1 => self.ask(Request::ClearFault { seen: number }),
                2 => self.ask(Request::Home { axes: AxisMask(number.to_le_bytes()[0] + 4) }),
                3 => self.ask(Request::SaveSettings),
                4 => self.acts.push(Act::AskNow(Request::Heartbeat { session, lease_ms: 500 })),
                _ => self.jog([Micro(1_000_000), Micro(0)]),
            }
        }
    }

    fn mishap(&mut self) {
        if self.happens(0.25) {
            self.ask(Request::Home { axes: AxisMask::first(2) });
        } else {
            self.go();
        }
        self.wait(1..400);
        let axis = self.axis();
        let (steps, share) = (self.random.random_range(1..3_000), self.random.random_range(-0.5..0.9));
        let mishap = match self.random.random_range(0..9) {
            0 => Mishap::EncoderStuck(axis),
            1 => Mishap::EncoderReversed(axis),
            2 => Mishap::Stalled(axis),
            3 => Mishap::StepsLost(axis, steps),
            4 => Mishap::Slips(axis, share),
            5 => Mishap::Blocked(axis),
            6 => Mishap::EmergencyStop,
            7 => Mishap::SwitchesCrossed,
            _ => return self.bounce(axis),
        };
        self.acts.push(Act::Mishap(mishap));
        self.wait(5..600);
    }

    /// A home switch whose contact bounces.
    fn bounce(&mut self, axis: usize) {
        for _ in 0..self.random.random_range(1..6) {
            let reading = self.happens(0.5);
            self.acts.push(Act::Mishap(Mishap::SwitchReads(axis, Some(reading))));
            self.wait(1..12);
            self.acts.push(Act::Mishap(Mishap::SwitchReads(axis, None)));
            self.wait(1..12);
        }
    }
}
