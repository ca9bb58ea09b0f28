//! The camera trigger: a pulse of TIM4 in one-pulse mode, whose compare register times the rising edge. The edge's
//! interrupt has the highest priority and latches the encoders.

use core::cell::RefCell;

use critical_section::Mutex;
use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, OutputType, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::pac::TIM4;
use embassy_stm32::pac::timer::vals::Ocm;
use embassy_stm32::peripherals;
use embassy_stm32::timer::low_level::Timer;
use embassy_stm32::timer::{Ch1, TimerPin};
use embassy_time::Instant;
use heapless::Deque;
use vergence_protocol::Microseconds;

use crate::encoder::Counter;
use crate::wiring;

/// Prescaler of the timer, which counts microseconds.
const PRESCALER: u16 = 169;
/// Length of the pulse in microseconds.
const PULSE_US: u16 = 100;
/// Pulses further ahead than this, in microseconds, wait in software: the counter has 16 bits.
const HORIZON_US: u64 = 10_000;

/// Number of encoders.
const AXES: usize = wiring::AXES.len();

/// An edge: its time, and the counters of all encoders.
pub type Edge = (Microseconds, [u32; AXES]);

/// What the interrupt reads and writes.
struct Shared {
    counters: Option<[Counter; AXES]>,
    edges: Deque<Edge, 4>,
}

static SHARED: Mutex<RefCell<Shared>> = Mutex::new(RefCell::new(Shared { counters: None, edges: Deque::new() }));

/// The trigger output.
pub struct Trigger {
    _pin: Flex<'static>,
    due: Option<Microseconds>,
}

impl Trigger {
    /// Sets up the output, low. At each edge it reads these counters.
    pub fn new(
        timer: Peri<'static, peripherals::TIM4>,
        pin: Peri<'static, impl TimerPin<peripherals::TIM4, Ch1>>,
        counters: [Counter; AXES],
    ) -> Self {
        critical_section::with(|cs| SHARED.borrow_ref_mut(cs).counters = Some(counters));
        let function = pin.af_num();
        let mut pin = Flex::new(pin);
        pin.set_as_af_unchecked(function, AfType::output(OutputType::PushPull, Speed::Medium));
        // Forgotten, because dropping it would stop the timer's clock.
        core::mem::forget(Timer::new(timer));
        TIM4.psc().write_value(PRESCALER);
        TIM4.egr().write(|w| w.set_ug(true));
        TIM4.sr().write(|_| {});
        // In PWM mode 2 the output is high from this count on (RM0440, OC1M of TIMx_CCMR1). With the zero of a reset it would be high at
        // once, until the first pulse: an edge that fires the cameras at each start.
        TIM4.ccr(0).write(|w| w.set_ccr(u16::MAX));
        TIM4.ccmr_output(0).write(|w| w.set_ocm(0, Ocm::PWM_MODE2));
        TIM4.ccer().write(|w| w.set_cce(0, true));
        TIM4.dier().write(|w| w.set_ccie(0, true));
        interrupt::TIM4.set_priority(Priority::P0);
        // SAFETY: the handler is complete; nothing relies on this interrupt being masked.
        #[allow(unsafe_code, reason = "unmasking an interrupt")]
        unsafe {
            interrupt::TIM4.enable();
        }
        Self { _pin: pin, due: None }
    }

    /// Orders a pulse at `at`; it replaces one that has not begun.
    pub fn fire(&mut self, at: Microseconds) {
        self.due = Some(at);
    }

    /// Starts the timer if a pulse is due soon. Call it in every tick and after [`Self::fire`].
    pub fn poll(&mut self) {
        let Some(at) = self.due else { return };
        let ahead = at.0.saturating_sub(Instant::now().as_micros());
        if ahead > HORIZON_US || TIM4.cr1().read().cen() {
            return;
        }
        self.due = None;
        let delay = u16::try_from(ahead).unwrap_or(u16::MAX).max(1);
        TIM4.ccr(0).write(|w| w.set_ccr(delay));
        TIM4.arr().write(|w| w.set_arr(delay.saturating_add(PULSE_US - 1)));
        TIM4.cr1().write(|w| {
            w.set_opm(true);
            w.set_cen(true);
        });
    }

    /// Takes the oldest edge.
    pub fn take_edge(&mut self) -> Option<Edge> {
        critical_section::with(|cs| SHARED.borrow_ref_mut(cs).edges.pop_front())
    }
}

#[interrupt]
fn TIM4() {
    let at = Microseconds(Instant::now().as_micros());
    critical_section::with(|cs| {
        let mut shared = SHARED.borrow_ref_mut(cs);
        let counts = shared.counters.map(|counters| counters.map(Counter::read));
        TIM4.sr().write(|_| {});
        if let Some(counts) = counts {
            // A tick brings at most one edge; an edge that does not fit is lost, like a lost pose.
            let _ = shared.edges.push_back((at, counts));
        }
    });
}
