//! A quadrature encoder on a 32-bit timer: the hardware counts every edge of both lines; its counter is the raw count.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, Pull};
use embassy_stm32::pac::timer::TimGp32;
use embassy_stm32::pac::timer::vals::{CcmrInputCcs, FilterValue, Sms};
use embassy_stm32::timer::low_level::Timer;
use embassy_stm32::timer::{Ch1, Ch2, GeneralInstance32bit4Channel, TimerPin};

/// The counter of one encoder.
pub struct Encoder {
    timer: TimGp32,
    _lines: [Flex<'static>; 2],
}

impl Encoder {
    /// Starts to count from zero. The lines are pulled up, for encoders with open-collector outputs.
    pub fn new<T: GeneralInstance32bit4Channel>(
        timer: Peri<'static, T>,
        a: Peri<'static, impl TimerPin<T, Ch1>>,
        b: Peri<'static, impl TimerPin<T, Ch2>>,
    ) -> Self {
        let (function_a, function_b) = (a.af_num(), b.af_num());
        let mut lines = [Flex::new(a), Flex::new(b)];
        lines[0].set_as_af_unchecked(function_a, AfType::input(Pull::Up));
        lines[1].set_as_af_unchecked(function_b, AfType::input(Pull::Up));
        let owner = Timer::new(timer);
        let timer = owner.regs_gp32();
        // Forgotten, because dropping it would stop the timer's clock.
        core::mem::forget(owner);
        timer.ccmr_input(0).write(|w| {
            for channel in 0..2 {
                w.set_ccs(channel, CcmrInputCcs::TI4);
                // Four equal samples at 170 MHz: pulses shorter than 24 ns are ignored.
                w.set_icf(channel, FilterValue::FCK_INT_N4);
            }
        });
        timer.smcr().write(|w| w.set_sms(Sms::ENCODER_MODE_3));
        timer.arr().write_value(u32::MAX);
        timer.cr1().write(|w| w.set_cen(true));
        Self { timer, _lines: lines }
    }

    /// The raw count.
    pub fn count(&self) -> i32 {
        self.timer.cnt().read().cast_signed()
    }
}
