//! Step pulses of one axis, made by an advanced timer alone: exactly as many as ordered, each at its time.
//!
//! The timer counts down at 10 MHz in one-pulse mode and its output is high for the last [`PULSE`] counts of each period
//! (RM0440, 28.3.17). The repetition counter holds the number of periods, so that the timer stops by itself after the last
//! step, whatever the processor does. At each rising edge the compare event makes DMA write the length of the next period
//! to the auto-reload register, which takes effect at the following underflow.

use core::sync::atomic::{Ordering, compiler_fence};

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, Level, Output, OutputType, Pin, Speed};
use embassy_stm32::pac::bdma::vals::{Dir, Pl, Size};
use embassy_stm32::pac::timer::TimAdv;
use embassy_stm32::pac::timer::vals::{self, Ocm};
use embassy_stm32::pac::{DMA1, DMAMUX1, TIM7, bdma, dmamux};
use embassy_stm32::peripherals;
use embassy_stm32::timer::low_level::Timer;
use embassy_stm32::timer::{AdvancedInstance4Channel, Ch1, Dma, TimerPin};
use vergence_control::{MAX_STEPS_PER_TICK, StepSchedule};

/// Timer counts in a microsecond.
const COUNTS_PER_US: u32 = 10;
/// Prescaler from the timers' 170 MHz to 10 MHz.
const PRESCALER: u16 = 16;
/// Length of a pulse in counts, and shortest pause after it: 2.5 us is enough for every common driver.
const PULSE: u32 = 25;
/// Counts between a change of direction and the rising edge of the first step.
const DIRECTION_SETUP: u32 = 50;
/// Delay of all steps in counts, which leaves time to load a list after the tick has begun and the last pulse of the
/// previous list is over.
const DELAY: u32 = 200;
/// Time in microseconds after the start of a tick by which the previous list must have ended: the controller takes a longer
/// delay for a fault.
const PATIENCE_US: u16 = 200;

/// A channel of DMA1.
pub trait StepDma {
    /// Number of the channel, from 0.
    const CHANNEL: usize;
}

macro_rules! channels {
    ($($channel:ident = $number:literal),*) => {
        $(impl StepDma for peripherals::$channel { const CHANNEL: usize = $number; })*
    };
}

// The serial line has the first two.
channels!(DMA1_CH3 = 2, DMA1_CH4 = 3, DMA1_CH5 = 4, DMA1_CH6 = 5, DMA1_CH7 = 6, DMA1_CH8 = 7);

/// The list ordered for the coming tick; its periods are in the back buffer.
#[derive(Clone, Copy, Default)]
struct Ordered {
    count: usize,
    forward: bool,
    /// Rising edge of the first step, in counts after the start of the tick.
    first: u32,
}

/// The step output of one axis.
pub struct StepPulses {
    timer: TimAdv,
    dma: bdma::Ch,
    _step: Flex<'static>,
    direction: Output<'static>,
    forward: bool,
    ordered: Ordered,
    /// Lengths of periods less one, which DMA feeds to the timer: of the running list and of the ordered one.
    periods: [[u16; MAX_STEPS_PER_TICK]; 2],
    /// Index of the buffer of the running list.
    front: usize,
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
        // Forgotten, because dropping it would stop the timer's clock.
        core::mem::forget(owner);
        configure_timer(timer);
        configure_mux(DMAMUX1.ccr(D::CHANNEL), dma.request());
        Self {
            timer,
            dma: DMA1.ch(D::CHANNEL),
            _step: step,
            direction: Output::new(direction, Level::Low, Speed::Medium),
            forward: false,
            ordered: Ordered::default(),
            periods: [[0; MAX_STEPS_PER_TICK]; 2],
            front: 0,
            running: 0,
            base: 0,
        }
    }

    /// Orders the steps of the coming tick.
    pub fn order(&mut self, steps: &StepSchedule) {
        let counts = |at_ns: &u32| at_ns * COUNTS_PER_US / 1_000;
        let mut instants = steps.at_ns.iter().map(counts);
        let first = instants.next().unwrap_or(0);
        let mut last = first;
        let mut periods = self.periods[1 - self.front].iter_mut();
        for (at, period) in instants.zip(&mut periods) {
            *period = (at.saturating_sub(last).max(2 * PULSE) - 1) as u16;
            last = at;
        }
        // DMA moves a word for the last step as well, so that steps can be counted; no period follows it.
        if let Some(after) = periods.next() {
            *after = u16::MAX;
        }
        self.ordered = Ordered { count: steps.at_ns.len(), forward: steps.forward, first };
    }

    /// Whether the previous list has ended, or [`PATIENCE_US`] of the tick have passed.
    pub fn is_ready(&self) -> bool {
        !self.runs() || TIM7.cnt().read().cnt() > PATIENCE_US
    }

    /// Starts the ordered list in a tick that has begun. Returns whether the previous list had ended; one that had not is cut
    /// short.
    pub fn begin_tick(&mut self) -> bool {
        let in_time = !self.runs();
        self.settle();
        let ordered = core::mem::take(&mut self.ordered);
        if ordered.count > 0 {
            let turned = ordered.forward != self.forward;
            if turned {
                self.forward = ordered.forward;
                self.direction.set_level(if self.forward { Level::High } else { Level::Low });
            }
            self.front = 1 - self.front;
            let least = if turned { DIRECTION_SETUP } else { COUNTS_PER_US };
            // An interrupt between the look at the clock and the start would delay the list: by 4 us where it was the serial
            // line's, which is a jump of speed at each end of the tick.
            critical_section::with(|_| {
                let now = u32::from(TIM7.cnt().read().cnt()) * COUNTS_PER_US;
                let rise = (DELAY + ordered.first).saturating_sub(now).max(least);
                self.start(rise + PULSE, ordered.count);
            });
        }
        in_time
    }

    /// Drops every step not made yet; a pulse that has begun is cut short.
    pub fn abort(&mut self) {
        self.timer.cr1().modify(|w| w.set_cen(false));
        self.settle();
        self.ordered = Ordered::default();
        // Down-counting, an update event puts the counter at the auto-reload value: the output falls.
        self.timer.arr().write(|w| w.set_arr(u16::MAX));
        self.timer.egr().write(|w| w.set_ug(true));
    }

    /// The raw step count reached so far.
    pub fn count(&self) -> i32 {
        let made = i32::try_from(self.made()).unwrap_or(i32::MAX);
        self.base.wrapping_add(if self.forward { made } else { -made })
    }

    /// Number of steps of the running list made so far: DMA moves one word for each.
    fn made(&self) -> usize {
        self.running.saturating_sub(usize::from(self.dma.ndtr().read().ndt()))
    }

    fn runs(&self) -> bool {
        self.timer.cr1().read().cen()
    }

    /// Adds the steps made by the running list to the count, and stops the list.
    fn settle(&mut self) {
        self.base = self.count();
        self.dma.cr().modify(|w| w.set_en(false));
        self.running = 0;
    }

    /// Starts `count` periods, the first of `first` counts, the others as in the front buffer.
    fn start(&mut self, first: u32, count: usize) {
        let timer = self.timer;
        timer.arr().write(|w| w.set_arr(u16::try_from(first - 1).unwrap_or(u16::MAX)));
        timer.rcr().write(|w| w.set_rep(u16::try_from(count - 1).unwrap_or(u16::MAX)));
        // Loads counter, prescaler and repetition counter.
        timer.egr().write(|w| w.set_ug(true));
        timer.sr().write(|_| {});
        // A request that was pending when the list before was dropped would be served for this one, and counted as a step:
        // the timer holds it until its enable is withdrawn.
        timer.dier().write(|_| {});
        timer.dier().write(|w| w.set_ccde(0, true));
        self.dma.ndtr().write(|w| w.set_ndt(u16::try_from(count).unwrap_or(0)));
        self.dma.par().write_value(timer.arr().as_ptr() as u32);
        self.dma.mar().write_value(self.periods[self.front].as_ptr() as u32);
        compiler_fence(Ordering::SeqCst);
        self.dma.cr().write(|w| {
            w.set_dir(Dir::FROM_MEMORY);
            w.set_minc(true);
            w.set_msize(Size::BITS16);
            // The register takes a word; DMA fills the upper half with zeros.
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
