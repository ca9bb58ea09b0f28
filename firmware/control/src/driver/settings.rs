//! Settings of the motor driver of one axis.

/// Kind of a motor driver.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DriverKind {
    /// Step and direction inputs only; its current is set on its own board.
    #[default]
    Plain,
    /// A TMC2209 with its serial line; its address is the number of the axis.
    Tmc2209,
    /// A servo on the bus of a robot's joints.
    Servo,
}

/// Settings of a motor driver. A plain driver uses none of them but its kind.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriverSettings {
    /// Kind of the driver.
    pub kind: DriverKind,
    /// Resistors that measure the current, in milliohms.
    pub sense_mohm: u32,
    /// Current of the motor in motion: effective value, in milliamperes. Of a servo its largest current.
    pub run_ma: u32,
    /// Current of the motor at rest: effective value, in milliamperes.
    pub hold_ma: u32,
    /// Time at rest until the current falls, in microseconds.
    pub hold_delay_us: u32,
    /// Microsteps that the driver makes of a full step, a power of two; the scale of the motor counts these.
    pub microsteps: u32,
    /// Whether the driver regulates the voltage (quiet) instead of the current (more torque at speed).
    pub stealth_chop: bool,
    /// When the driver reports a stall at its output DIAG; `None` for never.
    pub stall: Option<StallLimits>,
    /// Number of a servo on its bus.
    pub servo_id: u32,
}

/// Smallest rate of full steps a second at which StallGuard works: a turn a second of a motor with 200 full steps. Below,
/// the voltage that the turning rotor induces is too small (section 11.4 of the datasheet).
pub(crate) const LEAST_FULL_STEPS: u64 = 200;
/// Clock of the chip in hertz.
const CLOCK: u64 = 12_000_000;
/// Largest value of TCOOLTHRS.
const LONGEST_TSTEP: u64 = (1 << 20) - 1;

/// When a driver reports a stall (section 11 of the datasheet).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StallLimits {
    /// SGTHRS: the driver reports a stall where SG_RESULT is at most twice this.
    pub threshold: u32,
    /// TCOOLTHRS: longest time of 1/256 of a full step, in clocks of 12 MHz, at which it reports one.
    pub longest_tstep: u32,
}

impl StallLimits {
    /// Limits that hold from so many steps a second on; `None` for none at all.
    pub(crate) fn at(steps_per_second: u64, microsteps: u32, threshold: u32) -> Option<Self> {
        let longest = (CLOCK * u64::from(microsteps)).checked_div(steps_per_second * 256)?;
        Some(Self { threshold, longest_tstep: longest.min(LONGEST_TSTEP) as u32 })
    }
}

impl Default for DriverSettings {
    /// A plain driver. The other values suit the usual driver modules and a small motor.
    fn default() -> Self {
        Self {
            kind: DriverKind::Plain,
            sense_mohm: 110,
            run_ma: 800,
            hold_ma: 400,
            hold_delay_us: 500_000,
            microsteps: 8,
            stealth_chop: true,
            stall: None,
            servo_id: 1,
        }
    }
}

/// Range of the sense voltage (section 9 of the datasheet).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Range {
    /// Whether it is the lower one, with the finer steps of current.
    pub is_low: bool,
    /// Largest sense voltage in millivolts.
    millivolts: f32,
}

const LOW: Range = Range { is_low: true, millivolts: 180.0 };
const HIGH: Range = Range { is_low: false, millivolts: 325.0 };
/// What the chip adds to the sense resistor, in milliohms.
const INNER_MOHM: f32 = 20.0;
/// Largest effective current that the chip stands, in milliamperes.
const CHIP_MA: u32 = 2_000;

impl Range {
    /// Effective current at the end of the range, in milliamperes.
    fn full_ma(self, sense_mohm: u32) -> f32 {
        self.millivolts * 1e3 / (sense_mohm as f32 + INNER_MOHM) / core::f32::consts::SQRT_2
    }

    /// The current scale nearest to an effective current: n stands for n + 1 of 32 parts of the range.
    fn scale(self, sense_mohm: u32, current_ma: u32) -> u32 {
        let parts = current_ma as f32 * 32.0 / self.full_ma(sense_mohm);
        ((parts + 0.5) as u32).clamp(1, 32) - 1
    }
}

impl DriverSettings {
    /// Smallest and largest run current that the sense resistors allow, in milliamperes: a quarter of the lower range, below
    /// which microsteps become coarse, and the whole higher range or what the chip stands.
    pub(crate) fn currents(&self) -> [u32; 2] {
        let [low, high] = [LOW, HIGH].map(|range| range.full_ma(self.sense_mohm) as u32);
        [low / 4 + 1, high.min(CHIP_MA)]
    }

    /// The range, and the current scales of motion and rest in it.
    pub(super) fn current_scale(&self) -> (Range, u32, u32) {
        let range = if self.run_ma as f32 <= LOW.full_ma(self.sense_mohm) { LOW } else { HIGH };
        let scale = |current| range.scale(self.sense_mohm, current);
        (range, scale(self.run_ma), scale(self.hold_ma))
    }
}
