//! Step pulses of one axis, made by an advanced timer alone: exactly as many as ordered, each at its instant.
//!
//! The timer counts down at 10 MHz in one-pulse mode and its output is high for the last [`PULSE`] counts of each period
//! (RM0440, 28.3.17). The repetition counter holds how many periods there are, so that the timer stops by itself after
//! the last step, whatever the processor does. At each rising edge the compare event makes DMA write the length of the
//! next period to the auto-reload register, which takes effect at the following underflow.

use core::sync::atomic::{Ordering, compiler_fence};

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, Level, Output, OutputType, Pin, Speed};
use embassy_stm32::pac::bdma::vals::{Dir, Pl, Size};
use embassy_stm32::pac::timer::TimAdv;
use embassy_stm32::pac::timer::vals::{self, Ocm};
use embassy_stm32::pac::{DMA1, DMAMUX1, bdma, dmamux};
use embassy_stm32::timer::low_level::Timer;
use embassy_stm32::timer::{AdvancedInstance4Channel, Ch1, Dma, TimerPin};
use vergence_control::{MAX_STEPS_PER_TICK, StepSchedule};

/// Timer counts in a microsecond.
const COUNTS_PER_US: u32 = 10;
/// The timers run at 170 MHz.
const PRESCALER: u16 = 16;
/// Length of a pulse in counts, and the least pause after it: 2.5 us is enough for every common driver.
const PULSE: u32 = 25;
/// Counts between a change of direction and the rising edge of the first step.
const DIRECTION_SETUP: u32 = 50;
/// The last step rises before this count of its tick, so that its pulse is over before the next tick.
const LAST_RISE: u32 = 9_950;

/// A channel of DMA1 by its number, from 0.
pub trait StepDma {
    /// The number.
    const CHANNEL: usize;
}

/// The step output of one axis.
pub struct StepPulses {
    timer: TimAdv,
    dma: bdma::Ch,
    _step: Flex<'static>,
    direction: Output<'static>,
    forward: bool,
    ordered: StepSchedule,
    /// What DMA feeds to the timer: the length of each period but the first, less one.
    periods: [u16; MAX_STEPS_PER_TICK],
    running: usize,
    /// The raw step count before the running list.
    base: i32,
}

impl StepPulses {
    /// An output at rest.
    pub fn new<T: AdvancedInstance4Channel, D: Dma<T, Ch1> + StepDma>(
        timer: Peri<'static, T>,
        step: Peri<'static, impl TimerPin<T, Ch1>>,
        direction: Peri<'static, impl Pin>,
        dma: Peri<'static, D>,
    ) -> Self {
        let function = step.af_num();
        let mut step = Flex::new(step);
        step.set_as_af_unchecked(function, AfType::output(OutputType::PushPull, Speed::Medium));
        let owner = Timer::new(timer);
        let timer = owner.regs_advanced();
        // Dropped, it would stop the clock of the timer.
        core::mem::forget(owner);
        configure_timer(timer);
        configure_mux(DMAMUX1.ccr(D::CHANNEL), dma.request());
        Self {
            timer,
            dma: DMA1.ch(D::CHANNEL),
            _step: step,
            direction: Output::new(direction, Level::Low, Speed::Medium),
            forward: false,
            ordered: StepSchedule::default(),
            periods: [0; MAX_STEPS_PER_TICK],
            running: 0,
            base: 0,
        }
    }

    /// Takes the list for the coming tick.
    pub fn order(&mut self, steps: &StepSchedule) {
        self.ordered.clone_from(steps);
    }

    /// Begins the ordered list in a tick that began `late_us` ago. Returns whether the list before was over in time.
    pub fn begin_tick(&mut self, late_us: u32) -> bool {
        let in_time = self.wait_for_the_last();
        self.settle();
        if !self.ordered.at_ns.is_empty() {
            let turned = self.ordered.forward != self.forward;
            if turned {
                self.forward = self.ordered.forward;
                self.direction.set_level(if self.forward { Level::High } else { Level::Low });
            }
            let ready_at = late_us * COUNTS_PER_US + if turned { DIRECTION_SETUP } else { 0 };
            let first = self.fill_periods(late_us * COUNTS_PER_US, ready_at);
            self.start(first);
            self.ordered.at_ns.clear();
        }
        in_time
    }

    /// Forgets every step not made yet; a pulse that has begun is cut short.
    pub fn abort(&mut self) {
        self.timer.cr1().modify(|w| w.set_cen(false));
        self.settle();
        self.ordered.at_ns.clear();
        // Down-counting, an update event puts the counter at the auto-reload value: the output falls.
        self.timer.arr().write(|w| w.set_arr(u16::MAX));
        self.timer.egr().write(|w| w.set_ug(true));
    }

    /// The raw step count reached so far.
    pub fn count(&self) -> i32 {
        let made = i32::try_from(self.made()).unwrap_or(i32::MAX);
        self.base.wrapping_add(if self.forward { made } else { -made })
    }

    /// How many steps of the running list have been made: each one moves one word by DMA.
    fn made(&self) -> usize {
        self.running.saturating_sub(usize::from(self.dma.ndtr().read().ndt()))
    }

    /// Lists end before their tick does, unless the tick came early against its clock.
    fn wait_for_the_last(&self) -> bool {
        // A pulse is at most 425 cycles long.
        (0..100).any(|_| !self.timer.cr1().read().cen())
    }

    /// Adds what the running list has made to the count, and stops it.
    fn settle(&mut self) {
        self.base = self.count();
        self.dma.cr().modify(|w| w.set_en(false));
        self.running = 0;
    }

    /// Turns instants into periods; returns the first, in counts from now, `now` counts into the tick.
    fn fill_periods(&mut self, now: u32, ready_at: u32) -> u32 {
        // A period ends PULSE counts after its step has risen, and a step may rise no earlier than one count from now.
        let mut end = now;
        let mut earliest_rise = ready_at + COUNTS_PER_US;
        let mut first = 0;
        for (index, &at_ns) in self.ordered.at_ns.iter().enumerate() {
            let rise = (at_ns * COUNTS_PER_US / 1_000).min(LAST_RISE).max(earliest_rise);
            let length = rise + PULSE - end;
            match index.checked_sub(1).and_then(|before| self.periods.get_mut(before)) {
                Some(period) => *period = u16::try_from(length - 1).unwrap_or(u16::MAX),
                None => first = length,
            }
            end = rise + PULSE;
            earliest_rise = end + PULSE;
        }
        first
    }

    fn start(&mut self, first: u32) {
        let count = self.ordered.at_ns.len();
        let Some(last) = count.checked_sub(1) else { return };
        // The last step moves a word as well, for the count; nothing follows it.
        self.periods[last] = u16::MAX;
        let timer = self.timer;
        timer.arr().write(|w| w.set_arr(u16::try_from(first - 1).unwrap_or(u16::MAX)));
        timer.rcr().write(|w| w.set_rep(u16::try_from(last).unwrap_or(u16::MAX)));
        // Loads counter, prescaler and repetition counter.
        timer.egr().write(|w| w.set_ug(true));
        timer.sr().write(|_| {});
        self.dma.ndtr().write(|w| w.set_ndt(u16::try_from(count).unwrap_or(0)));
        self.dma.par().write_value(timer.arr().as_ptr() as u32);
        self.dma.mar().write_value(self.periods.as_ptr() as u32);
        compiler_fence(Ordering::SeqCst);
        self.dma.cr().write(|w| {
            w.set_dir(Dir::FROM_MEMORY);
            w.set_minc(true);
            w.set_msize(Size::BITS16);
            // The register takes a word, and DMA fills up with zeros.
            w.set_psize(Size::BITS32);
            w.set_pl(Pl::VERY_HIGH);
            w.set_en(true);
        });
        self.running = count;
        timer.cr1().write(|w| {
            w.set_dir(vals::Dir::DOWN);
            w.set_opm(true);
            w.set_cen(true);
        });
    }
}

fn configure_timer(timer: TimAdv) {
    timer.cr1().write(|w| {
        w.set_dir(vals::Dir::DOWN);
        w.set_opm(true);
    });
    timer.psc().write_value(PRESCALER);
    timer.arr().write(|w| w.set_arr(u16::MAX));
    timer.ccmr_output(0).write(|w| w.set_ocm(0, Ocm::PWM_MODE1));
    timer.ccr(0).write(|w| w.set_ccr((PULSE - 1) as u16));
    timer.egr().write(|w| w.set_ug(true));
    timer.ccer().write(|w| w.set_cce(0, true));
    timer.dier().write(|w| w.set_ccde(0, true));
    timer.bdtr().write(|w| w.set_moe(true));
}

fn configure_mux(
    channel: embassy_stm32::pac::common::Reg<dmamux::regs::Ccr, embassy_stm32::pac::common::RW>,
    request: u8,
) {
    channel.write(|w| w.set_dmareq_id(request));
}
