//! Makes faults happen at their times.

use vergence_plant::{AxisPlant, EncoderFault, Plant, SwitchNoise};
use vergence_protocol::Microseconds;

use crate::checker::Checker;
use crate::faults::{Fault, Onset};
use crate::journal::Journal;
use crate::line::Line;
use crate::promise::EncoderReading;
use crate::scenario::Scenario;

/// Everything that faults can act on.
pub struct World<'a> {
    pub now: Microseconds,
    /// The present step of the host's script, and since when.
    pub step: usize,
    pub in_step_us: u64,
    pub plant: &'a mut Plant,
    /// Delay of the next control tick.
    pub late_us: &'a mut u64,
    pub lines: [&'a mut Line; 2],
    pub host_offset: &'a mut i64,
    pub checker: &'a mut Checker,
    pub journal: &'a mut Journal,
}

#[derive(Clone, Copy, Debug)]
enum Progress {
    Pending,
    Lasting { until: u64 },
    Over,
}

/// The timed faults of a scenario.
#[derive(Debug)]
pub struct Injector {
    faults: Vec<(Fault, Progress)>,
    seed: u64,
}

impl Injector {
    pub fn new(scenario: &Scenario) -> Self {
        let faults = scenario.faults.iter().map(|&fault| (fault, Progress::Pending)).collect();
        Self { faults, seed: scenario.seed }
    }

    /// Begins and ends the faults that are due; returns whether the board restarts now.
    pub fn inject(&mut self, world: &mut World<'_>) -> bool {
        let mut restart = false;
        for (fault, progress) in &mut self.faults {
            *progress = match *progress {
                Progress::Pending if is_due(fault, world) => {
                    world.journal.note(world.now, format!("fault: {fault:?}"));
                    restart |= matches!(fault, Fault::Reset(_));
                    match begin(fault, self.seed, world) {
                        Some(lasts_us) => Progress::Lasting { until: world.now.0 + lasts_us },
                        None => Progress::Over,
                    }
                }
                Progress::Lasting { until } if world.now.0 >= until => {
                    world.journal.note(world.now, format!("over: {fault:?}"));
                    end(fault, world);
                    Progress::Over
                }
                same => same,
            };
        }
        restart
    }
}

fn is_due(fault: &Fault, world: &World<'_>) -> bool {
    let onset = match *fault {
        Fault::ByteErrors(_) | Fault::Drops(_) | Fault::Duplicates(_) => return false,
        Fault::RashJog(_) => return false,
        Fault::SwitchBounce { .. } | Fault::CrossedSwitches | Fault::DeadLimit(_) => return true,
        Fault::Stall(onset, _)
        | Fault::Disconnect(onset, _)
        | Fault::Reset(onset)
        | Fault::EncoderSupply(onset, _)
        | Fault::EmergencyStop(onset, _)
        | Fault::ClockJump(onset, _)
        | Fault::Encoder { onset, .. }
        | Fault::MotorStall { onset, .. }
        | Fault::LostSteps { onset, .. }
        | Fault::Slip { onset, .. }
        | Fault::LateTick(onset, _)
        | Fault::BlockedLoad { onset, .. } => onset,
    };
    let Onset { step, after_us } = onset;
    world.step > step || world.step == step && world.in_step_us >= after_us
}

/// Begins a fault; returns the time until its next change.
fn begin(fault: &Fault, seed: u64, world: &mut World<'_>) -> Option<u64> {
    match *fault {
        Fault::Stall(_, us) => {
            let until = Microseconds(world.now.0 + us);
            world.lines.iter_mut().for_each(|line| line.hold(until));
            None
        }
        Fault::Disconnect(_, us) => {
            let until = Microseconds(world.now.0 + us);
            world.lines.iter_mut().for_each(|line| line.cut(until));
            None
        }
        Fault::ClockJump(_, us) => {
            *world.host_offset += us;
            None
        }
        Fault::EmergencyStop(_, us) => {
            world.plant.press_emergency_stop(true);
            Some(us)
        }
        Fault::Encoder { axis, how, lasts_us, .. } => {
            fail_encoder(world, axis, Some(how));
            lasts_us
        }
        Fault::SwitchBounce { axis, chatter_us, spikes } => {
            let noise = SwitchNoise { chatter_us, spikes, seed };
            on_axis(world, axis, |axis| axis.disturb_home_switch(Some(noise)));
            None
        }
        Fault::MotorStall { axis, lasts_us, .. } => {
            on_axis(world, axis, |axis| axis.stall(true));
            Some(lasts_us)
        }
        Fault::LostSteps { axis, steps, again_us, .. } => {
            on_axis(world, axis, |axis| axis.lose_steps(steps));
            Some(again_us)
        }
        Fault::Slip { axis, share, lasts_us, .. } => {
            on_axis(world, axis, |axis| axis.slip(share));
            Some(lasts_us)
        }
        Fault::CrossedSwitches => {
            world.plant.cross_home_switches(0, 1);
            None
        }
        Fault::DeadLimit(axis) => {
            on_axis(world, axis, |axis| axis.fix_hard_limit(Some(false)));
            None
        }
        Fault::EncoderSupply(_, us) => {
            supply_encoders(world, false);
            Some(us)
        }
        Fault::LateTick(_, us) => {
            *world.late_us = us;
            None
        }
        Fault::BlockedLoad { axis, lasts_us, .. } => {
            on_axis(world, axis, |axis| axis.block(true));
            Some(lasts_us)
        }
        Fault::RashJog(_) | Fault::Reset(_) | Fault::ByteErrors(_) | Fault::Drops(_) | Fault::Duplicates(_) => None,
    }
}

fn end(fault: &Fault, world: &mut World<'_>) {
    match *fault {
        Fault::EmergencyStop(..) => world.plant.press_emergency_stop(false),
        Fault::Encoder { axis, how: EncoderFault::Noisy { .. }, .. } => {
            fail_encoder(world, axis, Some(EncoderFault::Dead));
        }
        Fault::Encoder { axis, .. } => fail_encoder(world, axis, None),
        Fault::MotorStall { axis, .. } => on_axis(world, axis, |axis| axis.stall(false)),
        Fault::LostSteps { axis, steps, .. } => on_axis(world, axis, |axis| axis.lose_steps(steps)),
        Fault::BlockedLoad { axis, .. } => on_axis(world, axis, |axis| axis.block(false)),
        Fault::Slip { axis, .. } => on_axis(world, axis, |axis| axis.slip(0.0)),
        Fault::EncoderSupply(..) => supply_encoders(world, true),
        _ => {}
    }
}

/// Cuts or restores the supply of all encoders.
fn supply_encoders(world: &mut World<'_>, on: bool) {
    for axis in 0..world.plant.loads().len() {
        if on {
            on_axis(world, axis, AxisPlant::mend_encoder);
            world.checker.encoder_shows(axis, EncoderReading::Clear);
        } else {
            fail_encoder(world, axis, Some(EncoderFault::Stuck));
        }
    }
}

fn fail_encoder(world: &mut World<'_>, axis: usize, how: Option<EncoderFault>) {
    on_axis(world, axis, |axis| axis.fail_encoder(how));
    let reading = match how {
        None => EncoderReading::Clear,
        Some(EncoderFault::Noisy { .. }) => EncoderReading::Blurred,
        Some(_) => EncoderReading::Lost,
    };
    world.checker.encoder_shows(axis, reading);
}

fn on_axis(world: &mut World<'_>, axis: usize, act: impl FnOnce(&mut AxisPlant)) {
    if let Some(axis) = world.plant.axis_mut(axis) {
        act(axis);
    }
}
