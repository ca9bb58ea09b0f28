//! A quadrature encoder on a timer: the hardware counts every edge of both lines; its counter is the raw count. Where the
//! counter has 16 bits, the count is the one nearest to that read before: a stage moves on by less than 32 768 counts
//! between two ticks, which are at most 20 ms apart.

use core::cell::Cell;

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, Pull};
use embassy_stm32::pac::timer::vals::{CcmrInputCcs, Ckd, FilterValue, Sms};
use embassy_stm32::pac::timer::{TimGp16, TimGp32};
use embassy_stm32::timer::low_level::Timer;
use embassy_stm32::timer::{Ch1, Ch2, GeneralInstance4Channel, GeneralInstance32bit4Channel, TimerPin};

/// Filters of the lines (RM0440, 29.5.9, IC1F) and the pulses that they swallow, in nanoseconds, with the sampling clock at a
/// quarter of 170 MHz.
const FILTERS: [(FilterValue, u32); 8] = [
    (FilterValue::FDTS_DIV32_N8, 6_024),
    (FilterValue::FDTS_DIV32_N5, 3_765),
    (FilterValue::FDTS_DIV16_N6, 2_259),
    (FilterValue::FDTS_DIV8_N8, 1_506),
    (FilterValue::FDTS_DIV4_N8, 753),
    (FilterValue::FDTS_DIV2_N8, 376),
    (FilterValue::FCK_INT_N8, 47),
    (FilterValue::FCK_INT_N4, 24),
];

/// The counter of a timer.
#[derive(Clone, Copy)]
pub enum Counter {
    /// 32 bits.
    Whole(TimGp32),
    /// 16 bits.
    Half(TimGp16),
}

impl Counter {
    /// Its value.
    pub fn read(self) -> u32 {
        match self {
            Self::Whole(timer) => timer.cnt().read(),
            Self::Half(timer) => timer.cnt().read().cnt().into(),
        }
    }
}

/// One encoder.
pub struct Encoder {
    timer: TimGp16,
    counter: Counter,
    /// The count that was read last.
    count: Cell<i32>,
    _lines: [Flex<'static>; 2],
}

impl Encoder {
    /// Starts to count from zero, with 32 bits. The lines are pulled up, for encoders with open-collector outputs.
    pub fn new<T: GeneralInstance32bit4Channel>(
        timer: Peri<'static, T>,
        a: Peri<'static, impl TimerPin<T, Ch1>>,
        b: Peri<'static, impl TimerPin<T, Ch2>>,
    ) -> Self {
        let owner = Timer::new(timer);
        let counter = owner.regs_gp32();
        counter.arr().write_value(u32::MAX);
        Self::start(owner, Counter::Whole(counter), a, b)
    }

    /// The same on a timer with 16 bits.
    #[cfg_attr(
        not(feature = "three-axes"),
        expect(dead_code, reason = "this wiring has timers of 32 bits for all encoders")
    )]
    pub fn of_16_bits<T: GeneralInstance4Channel>(
        timer: Peri<'static, T>,
        a: Peri<'static, impl TimerPin<T, Ch1>>,
        b: Peri<'static, impl TimerPin<T, Ch2>>,
    ) -> Self {
        let owner = Timer::new(timer);
        let counter = owner.regs_gp16();
        counter.arr().write(|w| w.set_arr(u16::MAX));
        Self::start(owner, Counter::Half(counter), a, b)
    }

    fn start<T: GeneralInstance4Channel>(
        owner: Timer<'static, T>,
        counter: Counter,
        a: Peri<'static, impl TimerPin<T, Ch1>>,
        b: Peri<'static, impl TimerPin<T, Ch2>>,
    ) -> Self {
        let (function_a, function_b) = (a.af_num(), b.af_num());
        let mut lines = [Flex::new(a), Flex::new(b)];
        lines[0].set_as_af_unchecked(function_a, AfType::input(Pull::Up));
        lines[1].set_as_af_unchecked(function_b, AfType::input(Pull::Up));
        let timer = owner.regs_gp16();
        // Forgotten, because dropping it would stop the timer's clock.
        core::mem::forget(owner);
        timer.ccmr_input(0).write(|w| (0..2).for_each(|channel| w.set_ccs(channel, CcmrInputCcs::TI4)));
        timer.cr1().write(|w| w.set_ckd(Ckd::DIV4));
        timer.smcr().write(|w| w.set_sms(Sms::ENCODER_MODE_3));
        timer.cr1().modify(|w| w.set_cen(true));
        Self { timer, counter, count: Cell::new(0), _lines: lines }
    }

    /// Swallows pulses that are shorter than an eighth of the time between two counts at `per_second`: counts are late by no
    /// more, and a stage may be pushed by hand eight times as fast.
    pub fn expect(&mut self, per_second: u32) {
        let longest = 125_000_000 / per_second.max(1);
        let fits = FILTERS.iter().find(|(_, swallowed)| *swallowed <= longest);
        let filter = fits.map_or(FilterValue::FCK_INT_N4, |(filter, _)| *filter);
        self.timer.ccmr_input(0).modify(|w| (0..2).for_each(|channel| w.set_icf(channel, filter)));
    }

    /// The raw count.
    pub fn count(&self) -> i32 {
        let count = self.extended(self.counter.read());
        self.count.set(count);
        count
    }

    /// The counter that it counts with.
    pub fn counter(&self) -> Counter {
        self.counter
    }

    /// The raw count for a value of the counter that was read some milliseconds ago at most.
    pub fn extended(&self, value: u32) -> i32 {
        match self.counter {
            Counter::Whole(_) => value.cast_signed(),
            Counter::Half(_) => {
                let last = self.count.get();
                last.wrapping_add(i32::from((value as u16).wrapping_sub(last as u16).cast_signed()))
            }
        }
    }
}
