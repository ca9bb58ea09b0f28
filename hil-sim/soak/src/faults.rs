//! The faults of a scenario, and when they begin.

use std::fmt;

use rand::RngExt;
use rand_pcg::Pcg64Mcg;
use vergence_plant::EncoderFault;
use vergence_protocol::Micro;

use crate::stages::stages;

/// Kind of fault by which scenarios are counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FaultKind {
    /// No fault.
    None,
    /// Bytes are damaged, up to one in a thousand.
    ByteErrors,
    /// Frames, or their ends, are lost.
    Drops,
    /// Frames come twice.
    Duplicates,
    /// The line delays everything by up to half a second.
    Stall,
    /// The line is cut for a while.
    Disconnect,
    /// The board restarts, mostly in mid-move.
    Reset,
    /// An encoder no longer counts.
    EncoderStuck,
    /// An encoder counts in the wrong direction.
    EncoderReversed,
    /// An encoder becomes noisy and dies.
    EncoderDying,
    /// A home switch chatters and catches spikes.
    SwitchBounce,
    /// A motor stalls while steps are made.
    MotorStall,
    /// A motor loses steps in bursts.
    LostSteps,
    /// A coupling slips.
    Slip,
    /// A load is blocked.
    BlockedLoad,
    /// The wires of the home switches are swapped.
    CrossedSwitches,
    /// The hard limit of an axis never opens.
    DeadLimit,
    /// The supply of the encoders fails for a while.
    EncoderSupply,
    /// The host jogs far before homing, toward a limit.
    RashJog,
    /// The control tick of the processor is delayed.
    LateTick,
    /// The emergency stop is pressed.
    EmergencyStop,
    /// The host's clock jumps.
    ClockJump,
    /// Two or three of these faults at once.
    Several,
}

impl FaultKind {
    /// All kinds.
    pub const ALL: [Self; 23] = [
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
        Self::DeadLimit,
        Self::EncoderSupply,
        Self::RashJog,
        Self::LateTick,
        Self::EmergencyStop,
        Self::ClockJump,
        Self::Several,
    ];

    /// The name of the kind in lower case.
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
            Self::DeadLimit => "dead_limit",
            Self::EncoderSupply => "encoder_supply",
            Self::RashJog => "rash_jog",
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

/// When a fault begins: a time after the host began a step of its script.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Onset {
    /// Index of the step of the script.
    pub step: usize,
    /// Microseconds after the step began.
    pub after_us: u64,
}

/// One fault. A fault without onset lasts for the whole scenario.
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
        /// When the fault begins.
        onset: Onset,
        /// Index of the axis.
        axis: usize,
        /// Kind of failure of the encoder.
        how: EncoderFault,
        /// Duration in microseconds; a noisy encoder is dead afterwards.
        lasts_us: Option<u64>,
    },
    /// The home switch of an axis chatters after each change and spikes with a probability.
    SwitchBounce {
        /// Index of the axis.
        axis: usize,
        /// Duration of the chatter after each change, in microseconds.
        chatter_us: u64,
        /// Probability of a wrong reading.
        spikes: f64,
    },
    /// The rotor of an axis stalls for a while.
    MotorStall {
        /// When the fault begins.
        onset: Onset,
        /// Index of the axis.
        axis: usize,
        /// Duration in microseconds.
        lasts_us: u64,
    },
    /// An axis loses steps in two bursts.
    LostSteps {
        /// When the fault begins.
        onset: Onset,
        /// Index of the axis.
        axis: usize,
        /// Number of steps lost while the motor turns.
        steps: u32,
        /// Time from the first to the second burst, in microseconds.
        again_us: u64,
    },
    /// The coupling of an axis slips by a share of every step for a while.
    Slip {
        /// When the fault begins.
        onset: Onset,
        /// Index of the axis.
        axis: usize,
        /// Share of each step; below zero the load goes further than the motor.
        share: f64,
        /// Duration in microseconds.
        lasts_us: u64,
    },
    /// The wires of the home switches are swapped from the start.
    CrossedSwitches,
    /// The hard limit of this axis never opens.
    DeadLimit(usize),
    /// All encoders are without supply for this many microseconds: they miss what is moved meanwhile.
    EncoderSupply(Onset, u64),
    /// The script has a jog by so much before homing. One beyond the longest search must be refused.
    RashJog([Micro; 2]),
    /// The next control tick comes late by this many microseconds.
    LateTick(Onset, u64),
    /// The load of an axis is blocked for a while.
    BlockedLoad {
        /// When the fault begins.
        onset: Onset,
        /// Index of the axis.
        axis: usize,
        /// Duration in microseconds.
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
            // Uniform in the logarithm, up to 10⁻³.
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
                // Some boards are wired this way from the start.
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
            FaultKind::DeadLimit => Self::DeadLimit(axis),
            // From a dip of a millisecond to a connector that is put back.
            FaultKind::EncoderSupply => Self::EncoderSupply(onset, 10_f64.powf(random.random_range(3.0..6.5)) as u64),
            FaultKind::RashJog => {
                let mut by = [Micro(0); 2];
                let travel = stages()[axis].settings.homing.travel.0;
                by[axis] = Micro(random.random_range(-travel..=travel) / 4 * 5);
                Self::RashJog(by)
            }
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
