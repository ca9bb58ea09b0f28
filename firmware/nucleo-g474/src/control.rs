//! The node in its interrupt: one kilohertz tick and one doorbell, above the executor and below the drivers' interrupts.
//!
//! Everything that decides anything runs here, in one place at one priority, so nothing has to be locked: the link's
//! tasks hand bytes over through [`link::RECEIVED`] and [`link::TO_SEND`] and ring the doorbell.

use core::cell::RefCell;
use core::sync::atomic::{AtomicU32, Ordering};

use critical_section::Mutex;
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::pac::TIM7;
use embassy_stm32::timer::low_level::Timer;
use embassy_stm32::{Peri, peripherals};
use embassy_time::Instant;
use static_cell::StaticCell;
use vergence_control::{Node, TICK_US};
use vergence_nucleo_common::Services;
use vergence_protocol::{MAX_FRAME, Microseconds};

use crate::rig::Rig;
use crate::{link, log, memory};

/// Below the interrupts of time, DMA and serial line, which are short, and above the executor's thread.
const PRIORITY: Priority = Priority::P8;
/// The tick timer counts microseconds.
const PRESCALER: u16 = 169;

/// How long a tick lasts where something is to be done, and the first one: microseconds.
const PERIOD: u16 = TICK_US as u16;
/// The timer cannot be told to end a tick sooner than so many microseconds from now.
const NOTICE_US: u16 = 3;

/// How many ticks there have been: the watchdog's witness.
pub static TICKS: AtomicU32 = AtomicU32::new(0);

static CONTROL: StaticCell<Control> = StaticCell::new();
static HANDOVER: Mutex<RefCell<Option<&'static mut Control>>> = Mutex::new(RefCell::new(None));

/// The node and the mechanics it drives.
pub struct Control {
    node: Node,
    rig: Rig,
    services: Services,
    /// When the running tick began.
    tick: Microseconds,
    /// How long it lasts: what the timer is set to, in microseconds.
    length: u16,
    /// Kept, for to clear them in every tick would take a quarter of one at rest.
    received: [u8; 64],
    frame: [u8; MAX_FRAME],
}

/// Starts the tick; from now on node, rig and services belong to the interrupt.
pub fn start(node: Node, rig: Rig, services: Services, timer: Peri<'static, peripherals::TIM7>) {
    // Dropped, it would stop the clock of the timer.
    core::mem::forget(Timer::new(timer));
    TIM7.psc().write_value(PRESCALER);
    set_length(PERIOD);
    TIM7.egr().write(|w| w.set_ug(true));
    TIM7.sr().write(|_| {});
    let tick = Microseconds(Instant::now().as_micros());
    let control =
        CONTROL.init(Control { node, rig, services, tick, length: PERIOD, received: [0; 64], frame: [0; MAX_FRAME] });
    critical_section::with(|cs| HANDOVER.borrow_ref_mut(cs).replace(control));
    TIM7.dier().write(|w| w.set_uie(true));
    TIM7.cr1().write(|w| w.set_cen(true));
    interrupt::TIM7_DAC.set_priority(PRIORITY);
    // SAFETY: the handler has what it needs; nothing relies on this interrupt being masked.
    #[allow(unsafe_code, reason = "unmasking an interrupt")]
    unsafe {
        interrupt::TIM7_DAC.enable();
    }
}

/// Makes the node look at the link.
pub fn ring() {
    interrupt::TIM7_DAC.pend();
}

#[interrupt]
fn TIM7_DAC() {
    static mut MINE: Option<&'static mut Control> = None;
    if MINE.is_none() {
        *MINE = critical_section::with(|cs| HANDOVER.borrow_ref_mut(cs).take());
    }
    if let Some(control) = MINE {
        control.run();
    }
}

/// Sets how long the running tick lasts, a whole number of periods; where it has lasted longer, one period more than that.
/// Returns what was set.
fn set_length(length: u16) -> u16 {
    critical_section::with(|_| {
        // Behind the counter's back the end would come after 65 ms.
        let least = (TIM7.cnt().read().cnt() + NOTICE_US).next_multiple_of(PERIOD);
        let length = length.max(least);
        TIM7.arr().write(|w| w.set_arr(length - 1));
        length
    })
}

impl Control {
    fn run(&mut self) {
        if TIM7.sr().read().uif() {
            TIM7.sr().write(|w| w.set_uif(false));
            self.begin_tick();
        }
        self.receive();
        self.transmit();
        self.follow();
    }

    /// Ticks are a whole number of periods apart, whatever the interrupt's latency: both timers run on one clock. Those
    /// missed while the flash was busy are gone, and the controller sees the gap.
    fn begin_tick(&mut self) {
        let began = Instant::now().as_micros() - u64::from(TIM7.cnt().read().cnt());
        let since = u32::try_from(began.saturating_sub(self.tick.0)).unwrap_or(u32::MAX);
        let ticks = since.saturating_add(u32::from(PERIOD / 2)) / u32::from(PERIOD);
        self.tick.0 += u64::from(ticks) * TICK_US;
        if !self.rig.begin_tick() {
            defmt::warn!("steps cut short at {=u64}", self.tick.0);
        }
        self.node.poll(self.tick, &mut self.rig);
        TICKS.fetch_add(1, Ordering::Relaxed);
    }

    /// Makes the timer end the running tick when the node wants to run again.
    fn follow(&mut self) {
        let length = self.node.wakes_at().0.saturating_sub(self.tick.0);
        let length = u16::try_from(length).unwrap_or(PERIOD);
        if length != self.length {
            self.length = set_length(length);
        }
    }

    fn receive(&mut self) {
        while let Ok(count) = link::RECEIVED.try_read(&mut self.received) {
            self.take(count);
        }
    }

    /// Not inlined, or its preparations would be made in every tick, whether or not a byte came.
    #[inline(never)]
    fn take(&mut self, count: usize) {
        let now = Microseconds(Instant::now().as_micros());
        // At once: what the node makes of the bytes may take until then.
        self.node.wake(now);
        self.follow();
        self.node.receive(now, &self.received[..count], &mut self.rig, &mut self.services);
    }

    /// Keeps at most one frame waiting behind the one on the wire, so that the next is chosen as late as possible.
    fn transmit(&mut self) {
        log::forward(|entry| self.node.log(entry));
        while link::TO_SEND.is_empty() {
            if !self.send_frame() {
                self.reboot();
                return;
            }
        }
    }

    /// Returns whether there was one. Not inlined, for the same reason as [`Self::take`].
    #[inline(never)]
    fn send_frame(&mut self) -> bool {
        let now = Microseconds(Instant::now().as_micros());
        let Some(length) = self.node.transmit(now, &mut self.frame) else { return false };
        link::queue(&self.frame[..length]);
        true
    }

    /// Where the host wants another start, the link makes it when the last frame is out.
    fn reboot(&mut self) {
        if let Some(to) = self.node.take_reboot() {
            memory::prepare_reboot(to);
            link::REBOOT.store(true, Ordering::Relaxed);
        }
    }
}
