//! What goes wrong, and when.

use std::fmt;

use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use vergence_plant::EncoderFault;

use crate::stages::stages;

/// The kinds by which scenarios are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FaultKind {
    /// Nothing goes wrong.
    None,
    /// Bytes are damaged, up to one in a thousand.
    ByteErrors,
    /// Frames, or their ends, are lost.
    Drops,
    /// Frames come twice.
    Duplicates,
    /// The line holds everything back for up to half a second.
    Stall,
    /// The line is cut for a while.
    Disconnect,
    /// The board restarts, mostly in mid-move.
    Reset,
    /// An encoder stands still.
    EncoderStuck,
    /// An encoder runs the wrong way.
    EncoderReversed,
    /// An encoder becomes noisy and dies.
    EncoderDying,
    /// A home switch chatters and catches spikes.
    SwitchBounce,
    /// A motor stands while it is stepped.
    MotorStall,
    /// A motor loses steps in bursts.
    LostSteps,
    /// A coupling slips.
    Slip,
    /// A load is wedged.
    BlockedLoad,
    /// The wires of the home switches have changed places.
    CrossedSwitches,
    /// The processor is kept from its control tick.
    LateTick,
    /// The emergency stop is pressed.
    EmergencyStop,
    /// The host's clock jumps.
    ClockJump,
    /// Two or three of these at once.
    Several,
}

impl FaultKind {
    /// All kinds.
    pub const ALL: [Self; 20] = [
        Self::None,
        Self::ByteErrors,
        Self::Drops,
        Self::Duplicates,
        Self::Stall,
        Self::Disconnect,
        Self::Reset,
        Self::EncoderStuck,
        Self::EncoderReversed,
        Self::EncoderDying,
        Self::SwitchBounce,
        Self::MotorStall,
        Self::LostSteps,
        Self::Slip,
        Self::BlockedLoad,
        Self::CrossedSwitches,
        Self::LateTick,
        Self::EmergencyStop,
        Self::ClockJump,
        Self::Several,
    ];

    /// Its name in lower case.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::ByteErrors => "byte_errors",
            Self::Drops => "drops",
            Self::Duplicates => "duplicates",
            Self::Stall => "stall",
            Self::Disconnect => "disconnect",
            Self::Reset => "reset",
            Self::EncoderStuck => "encoder_stuck",
            Self::EncoderReversed => "encoder_reversed",
            Self::EncoderDying => "encoder_dying",
            Self::SwitchBounce => "switch_bounce",
            Self::MotorStall => "motor_stall",
            Self::LostSteps => "lost_steps",
            Self::Slip => "slip",
            Self::BlockedLoad => "blocked_load",
            Self::CrossedSwitches => "crossed_switches",
            Self::LateTick => "late_tick",
            Self::EmergencyStop => "emergency_stop",
            Self::ClockJump => "clock_jump",
            Self::Several => "several",
        }
    }
}

impl fmt::Display for FaultKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// When a fault begins: so long after the host began a step of its script.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Onset {
    /// Index of the step.
    pub step: usize,
    /// Microseconds after it began.
    pub after_us: u64,
}

/// One fault. Those without onset last as long as the scenario.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// Both directions damage bytes with this probability.
    ByteErrors(f64),
    /// Both directions lose frames, or their ends, with this probability.
    Drops(f64),
    /// Both directions repeat frames with this probability.
    Duplicates(f64),
    /// The line delivers nothing for this many microseconds, and then everything.
    Stall(Onset, u64),
    /// The line loses everything for this many microseconds.
    Disconnect(Onset, u64),
    /// The board restarts.
    Reset(Onset),
    /// An encoder fails, for this many microseconds or for good.
    Encoder {
        /// When.
        onset: Onset,
        /// Whose.
        axis: usize,
        /// How.
        how: EncoderFault,
        /// For how long; a noisy encoder is dead afterwards.
        lasts_us: Option<u64>,
    },
    /// The home switch of an axis chatters for so many microseconds after each change and spikes with this probability.
    SwitchBounce {
        /// Whose.
        axis: usize,
        /// Chatter after each change, microseconds.
        chatter_us: u64,
        /// Probability of a wrong reading.
        spikes: f64,
    },
    /// The rotor of an axis stands for this many microseconds.
    MotorStall {
        /// When.
        onset: Onset,
        /// Whose.
        axis: usize,
        /// For how long.
        lasts_us: u64,
    },
    /// An axis loses so many steps at the onset and again after this many microseconds.
    LostSteps {
        /// When.
        onset: Onset,
        /// Whose.
        axis: usize,
        /// Steps of a motor that turns.
        steps: u32,
        /// Time to the second burst.
        again_us: u64,
    },
    /// The coupling of an axis slips by a share of every step for this many microseconds.
    Slip {
        /// When.
        onset: Onset,
        /// Whose.
        axis: usize,
        /// By how much of each step; below zero the load goes further than the motor.
        share: f64,
        /// For how long.
        lasts_us: u64,
    },
    /// The wires of the home switches have changed places from the first day on.
    CrossedSwitches,
    /// The next control tick comes so many microseconds late.
    LateTick(Onset, u64),
    /// The load of an axis is wedged for this many microseconds.
    BlockedLoad {
        /// When.
        onset: Onset,
        /// Whose.
        axis: usize,
        /// For how long.
        lasts_us: u64,
    },
    /// The emergency stop is pressed for this many microseconds.
    EmergencyStop(Onset, u64),
    /// The host's clock jumps by this many microseconds.
    ClockJump(Onset, i64),
}

impl Fault {
    /// Draws faults of `kind` for a script of `steps` steps.
    pub(crate) fn draw(kind: FaultKind, steps: usize, random: &mut Pcg64Mcg) -> Vec<Self> {
        let onset = Onset { step: random.random_range(1..steps), after_us: random.random_range(0..3_000_000) };
        let axis = random.random_range(0..stages().len());
        let lasts_us = random.random_range(5_000..1_500_000);
        vec![match kind {
            FaultKind::None => return Vec::new(),
            // Evenly over the orders of magnitude, to 10⁻³.
            FaultKind::ByteErrors => Self::ByteErrors(10_f64.powf(random.random_range(-5.0..-3.0))),
            FaultKind::Drops => Self::Drops(random.random_range(0.01..0.15)),
            FaultKind::Duplicates => Self::Duplicates(random.random_range(0.01..0.3)),
            FaultKind::Stall => Self::Stall(onset, random.random_range(50_000..=500_000)),
            FaultKind::Disconnect => Self::Disconnect(onset, random.random_range(50_000..3_000_000)),
            FaultKind::Reset => Self::Reset(onset),
            FaultKind::EncoderStuck => {
                let lasts_us = random.random_bool(0.3).then_some(lasts_us);
                Self::Encoder { onset, axis, how: EncoderFault::Stuck, lasts_us }
            }
            FaultKind::EncoderReversed => {
                // Some are wired so from the first day on.
                let onset = if random.random_bool(0.3) { Onset { step: 0, after_us: 0 } } else { onset };
                Self::Encoder { onset, axis, how: EncoderFault::Reversed, lasts_us: None }
            }
            FaultKind::EncoderDying => {
                let noisy = EncoderFault::Noisy { amplitude: random.random_range(1..3_000), seed: random.random() };
                Self::Encoder { onset, axis, how: noisy, lasts_us: Some(lasts_us) }
            }
            FaultKind::SwitchBounce => {
                let spikes = if random.random_bool(0.5) { random.random_range(0.0..0.01) } else { 0.0 };
                Self::SwitchBounce { axis, chatter_us: random.random_range(1_000..8_000), spikes }
            }
            FaultKind::MotorStall => Self::MotorStall { onset, axis, lasts_us },
            FaultKind::LostSteps => {
                let steps = random.random_range(1..3_000);
                Self::LostSteps { onset, axis, steps, again_us: lasts_us }
            }
            FaultKind::Slip => Self::Slip { onset, axis, share: random.random_range(-0.5..0.9), lasts_us },
            FaultKind::CrossedSwitches => Self::CrossedSwitches,
            FaultKind::LateTick => Self::LateTick(onset, random.random_range(100..3_000)),
            FaultKind::BlockedLoad => Self::BlockedLoad { onset, axis, lasts_us },
            FaultKind::EmergencyStop => Self::EmergencyStop(onset, lasts_us),
            FaultKind::ClockJump => Self::ClockJump(onset, random.random_range(-3_000_000..3_000_000)),
            FaultKind::Several => return several(steps, random),
        }]
    }
}

fn several(steps: usize, random: &mut Pcg64Mcg) -> Vec<Fault> {
    let single = &FaultKind::ALL[1..FaultKind::ALL.len() - 1];
    let count = random.random_range(2..=3);
    (0..count).flat_map(|_| Fault::draw(single[random.random_range(0..single.len())], steps, random)).collect()
}
