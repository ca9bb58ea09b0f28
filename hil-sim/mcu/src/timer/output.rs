//! Compare outputs (RM0440 §28.3.9 to §28.3.16).

use super::{MOE, Timer, UIF};
use crate::peripheral::{Refused, Reply};

/// The mode of an output channel (CCMRx.OCxM).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum OutputMode {
    Frozen,
    ActiveOnMatch,
    InactiveOnMatch,
    Toggle,
    ForcedInactive,
    ForcedActive,
    Pwm1,
    Pwm2,
}

impl Timer {
    fn channel_bits(&self, channel: usize) -> u32 {
        self.ccmr[channel / 2] >> (8 * (channel % 2))
    }

    /// The channel is a capture input (CCxS is not zero).
    pub(super) fn is_input(&self, channel: usize) -> bool {
        self.channel_bits(channel) & 3 != 0
    }

    /// The compare value waits for an update (OCxPE).
    pub(super) fn preloads(&self, channel: usize) -> bool {
        !self.is_input(channel) && self.channel_bits(channel) >> 3 & 1 == 1
    }

    fn mode_number(&self, channel: usize) -> u32 {
        let bits = self.channel_bits(channel);
        bits >> 4 & 7 | bits >> 13 & 8
    }

    fn output_mode(&self, channel: usize) -> OutputMode {
        match self.mode_number(channel) {
            1 => OutputMode::ActiveOnMatch,
            2 => OutputMode::InactiveOnMatch,
            3 => OutputMode::Toggle,
            4 => OutputMode::ForcedInactive,
            5 => OutputMode::ForcedActive,
            6 => OutputMode::Pwm1,
            7 => OutputMode::Pwm2,
            _ => OutputMode::Frozen,
        }
    }

    /// Refuses modes that the channels do not implement.
    pub(super) fn check_channel(&self, channel: usize) -> Reply<()> {
        if self.is_input(channel) {
            return Ok(());
        }
        let mode = self.mode_number(channel);
        if mode > 7 {
            return Err(Refused(format!("output mode {mode} of channel {} is not modelled", channel + 1)));
        }
        if self.channel_bits(channel) >> 7 & 1 == 1 {
            return Err("clearing an output by ETRF is not modelled".into());
        }
        if self.ccer >> (4 * channel + 2) & 1 == 1 && self.bdtr & 0xFF != 0 {
            return Err("dead time is not modelled".into());
        }
        Ok(())
    }

    /// Modes with a level that depends on what happened before.
    pub(super) fn keeps_levels(&self) -> bool {
        (0..self.variant.channels)
            .any(|channel| !self.is_input(channel) && self.output_mode(channel) == OutputMode::Toggle)
    }

    pub(super) fn apply_forced_level(&mut self, channel: usize) {
        if self.is_input(channel) {
            return;
        }
        match self.output_mode(channel) {
            OutputMode::ForcedInactive => self.held[channel] = false,
            OutputMode::ForcedActive => self.held[channel] = true,
            OutputMode::Pwm1 | OutputMode::Pwm2 => self.held[channel] = self.reference(channel),
            _ => {}
        }
    }

    /// OCxREF: high is active.
    pub(super) fn reference(&self, channel: usize) -> bool {
        match self.output_mode(channel) {
            OutputMode::Pwm1 => self.is_before_match(channel),
            OutputMode::Pwm2 => !self.is_before_match(channel),
            _ => self.held[channel],
        }
    }

    /// Where PWM mode 1 is active: below the compare value counting up, up to it counting down (§28.4.8, OC1M).
    fn is_before_match(&self, channel: usize) -> bool {
        let (count, compare) = (self.counter.count, self.compare[channel]);
        if self.counter.counts_down { count <= compare } else { count < compare }
    }

    /// The level on CHx; `None` where the timer does not drive it.
    pub fn output(&self, channel: usize) -> Option<bool> {
        if channel >= self.variant.channels || self.is_input(channel) {
            return None;
        }
        let bits = self.ccer >> (4 * channel);
        self.drives(bits & 1 == 1, 8 + 2 * channel, || self.reference(channel) != (bits >> 1 & 1 == 1))
    }

    /// The level on CHxN; `None` where the timer does not drive it.
    pub fn complement(&self, channel: usize) -> Option<bool> {
        if channel >= self.variant.channels || self.is_input(channel) {
            return None;
        }
        let bits = self.ccer >> (4 * channel);
        // With CHx disabled the complement follows OCxREF itself (table of complementary outputs).
        let inverted = bits & 1 == 1;
        let level = || (self.reference(channel) != inverted) != (bits >> 3 & 1 == 1);
        self.drives(bits >> 2 & 1 == 1, 9 + 2 * channel, level)
    }

    /// The level without the main output switch: the idle level where OSSI is set, else the output floats.
    fn drives(&self, enabled: bool, idle_bit: usize, level: impl Fn() -> bool) -> Option<bool> {
        const OSSI: u32 = 1 << 10;
        if !enabled {
            return None;
        }
        if !self.variant.has_main_switch || self.bdtr & MOE != 0 {
            return Some(level());
        }
        (self.bdtr & OSSI != 0).then(|| self.cr2 >> idle_bit & 1 == 1)
    }

    /// Lets the count pass every value from `first` to `last`.
    pub(super) fn matches_in(&mut self, first: u64, last: u64) {
        for channel in 0..self.variant.channels {
            let target = u64::from(self.compare[channel]);
            if target < first || target > last || self.is_input(channel) {
                continue;
            }
            self.raise(2 << channel);
            match self.output_mode(channel) {
                OutputMode::ActiveOnMatch => self.held[channel] = true,
                OutputMode::InactiveOnMatch => self.held[channel] = false,
                OutputMode::Toggle => self.held[channel] = !self.held[channel],
                _ => {}
            }
            self.outputs_changed = true;
            if self.cr2 >> 4 & 7 == 3 && channel == 0 || self.reference_triggers(channel) {
                self.triggers += 1;
            }
        }
    }

    /// A compare value beyond the reload value raises its flag on overflow (§28.4.5, CC1IF).
    pub(super) fn matches_beyond_reload(&mut self) {
        for channel in 0..self.variant.channels {
            if self.compare[channel] > self.counter.reload && !self.is_input(channel) {
                self.raise(2 << channel);
            }
        }
    }

    /// OCxREF is the trigger output (CR2.MMS 4 to 7) and rises at the match in PWM mode 2, counting up.
    fn reference_triggers(&self, channel: usize) -> bool {
        (self.cr2 >> 4 & 7) as usize == channel + 4 && self.output_mode(channel) == OutputMode::Pwm2
    }

    /// The flags that go with pulses of the trigger output.
    pub(super) fn trigger_flags(&self) -> u32 {
        match self.cr2 >> 4 & 7 {
            2 => UIF,
            3 => 2,
            reference @ 4..=7 => 2 << (reference - 4),
            _ => 0,
        }
    }
}
