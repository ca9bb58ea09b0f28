//! The node in its interrupt, which the 1 kHz tick and the doorbell raise: above the executor, below the drivers'
//! interrupts.
//!
//! All decisions are made here, in one place at one priority, so nothing has to be locked: the link's tasks hand bytes
//! over through [`exchange`] and ring its doorbell.

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
use vergence_control::{MovePlanner, Node, TICK_US};
use vergence_nucleo_common::Services;
use vergence_protocol::{MAX_FRAME, Microseconds};

use crate::rig::Rig;
use crate::{exchange, log, memory, planning};

/// Priority below the short interrupts of time, DMA and serial line, and above the executor.
const PRIORITY: Priority = Priority::P8;
/// Prescaler of the tick timer, which counts microseconds.
const PRESCALER: u16 = 169;

/// Length of a tick in microseconds while there is something to do.
const PERIOD: u16 = TICK_US as u16;
/// Shortest time in microseconds from now to the end of a tick that the timer can be set to.
const NOTICE_US: u16 = 3;

/// Counts the ticks: shows the watchdog that they go on.
pub static TICKS: AtomicU32 = AtomicU32::new(0);

static CONTROL: StaticCell<Control> = StaticCell::new();
static HANDOVER: Mutex<RefCell<Option<&'static mut Control>>> = Mutex::new(RefCell::new(None));

/// The node, and the mechanics that it drives.
pub struct Control {
    node: &'static mut Node,
    rig: Rig,
    services: Services,
    /// Speed of the line as it was last passed on, in baud.
    baud: u32,
    /// The plan that waits for its tick.
    plan: Option<&'static mut MovePlanner>,
    /// Start of the running tick.
    tick: Microseconds,
    /// Length of the running tick, as the timer is set, in microseconds.
    length: u16,
    /// Reused: clearing it every tick would cost a quarter of an idle tick.
    received: [u8; 64],
    frame: [u8; MAX_FRAME],
}

/// Starts the tick. From now on node, rig and services belong to the interrupt.
pub fn start(node: &'static mut Node, rig: Rig, services: Services, timer: Peri<'static, peripherals::TIM7>) {
    // Forgotten, because dropping it would stop the timer's clock.
    core::mem::forget(Timer::new(timer));
    TIM7.psc().write_value(PRESCALER);
    set_length(PERIOD);
    TIM7.egr().write(|w| w.set_ug(true));
    TIM7.sr().write(|_| {});
    let control = CONTROL.init(Control {
        baud: node.baud(),
        node,
        rig,
        services,
        plan: None,
        tick: Microseconds(0),
        length: PERIOD,
        received: [0; 64],
        frame: [0; MAX_FRAME],
    });
    TIM7.dier().write(|w| w.set_uie(true));
    TIM7.cr1().write(|w| w.set_cen(true));
    // Not before the counter runs: moving everything to its place takes some time.
    control.tick = Microseconds(Instant::now().as_micros());
    critical_section::with(|cs| HANDOVER.borrow_ref_mut(cs).replace(control));
    interrupt::TIM7_DAC.set_priority(PRIORITY);
    // SAFETY: the handler has what it needs; nothing relies on this interrupt being masked.
    #[allow(unsafe_code, reason = "unmasking an interrupt")]
    unsafe {
        interrupt::TIM7_DAC.enable();
    }
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

/// Sets the length of the running tick to `length`, a whole number of periods, or to the end of the present period if that
/// is later. Returns the length set, in microseconds.
fn set_length(length: u16) -> u16 {
    critical_section::with(|_| {
        // An end before the counter's present value would come only after 65 ms.
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
        planning::exchange(self.node, &mut self.plan);
        self.transmit();
        self.follow();
    }

    /// Begins a tick. Ticks are whole periods apart, whatever the interrupt's latency, because both timers run on one clock.
    /// Ticks missed while the flash was busy are left out, and the controller notices the gap.
    fn begin_tick(&mut self) {
        self.rig.latch_encoders();
        let due = self.tick.0 + u64::from(self.length);
        let began = Instant::now().as_micros() - u64::from(TIM7.cnt().read().cnt());
        let since = u32::try_from(began.saturating_sub(self.tick.0)).unwrap_or(u32::MAX);
        let ticks = since.saturating_add(u32::from(PERIOD / 2)) / u32::from(PERIOD);
        self.tick.0 += u64::from(ticks) * TICK_US;
        // While a debugger halts the core, the time of the executor loses periods of 65.5 ms.
        if self.tick.0.abs_diff(began) > u64::from(PERIOD / 4) {
            self.tick.0 = began;
        }
        // A tick that is too late makes no steps.
        self.judge_delay(due);
        if !self.rig.begin_tick() {
            defmt::warn!("steps cut short at {=u64}", self.tick.0);
        }
        // After the wait for the steps of the tick before, so that steps cut short are a delay as well; with the ticks left out.
        self.judge_delay(due);
        self.node.poll(self.tick, &mut self.rig);
        self.rig.release_encoders();
        TICKS.fetch_add(1, Ordering::Relaxed);
    }

    /// Lets the node judge how late it is in the tick that was due at `due`.
    fn judge_delay(&mut self, due: u64) {
        let late = Instant::now().as_micros().saturating_sub(due);
        self.node.allow_delay(self.tick, late, &mut self.rig);
    }

    /// Sets the timer to the time at which the node wants to run again.
    fn follow(&mut self) {
        let length = self.node.wakes_at().0.saturating_sub(self.tick.0);
        let length = u16::try_from(length).unwrap_or(PERIOD);
        if length != self.length {
            self.length = set_length(length);
        }
    }

    fn receive(&mut self) {
        while let Ok(count) = exchange::RECEIVED.try_read(&mut self.received) {
            self.take(count);
        }
    }

    /// Gives `count` received bytes to the node. Not inlined: its stack set-up would otherwise cost time in every tick.
    #[inline(never)]
    fn take(&mut self, count: usize) {
        let now = Microseconds(Instant::now().as_micros());
        // Set the timer first: handling the bytes may take until the next tick.
        self.node.wake(now);
        self.follow();
        self.node.receive(now, &self.received[..count], &mut self.rig, &mut self.services);
    }

    /// Keeps at most one frame waiting behind the one on the wire, so that the node chooses the next as late as possible.
    fn transmit(&mut self) {
        log::forward(|entry| self.node.log(entry));
        while exchange::TO_SEND.is_empty() {
            if !self.send_frame() {
                self.change_speed();
                self.reboot();
                return;
            }
        }
    }

    /// Queues the node's next frame; returns whether there was one. Not inlined, for the reason given at [`Self::take`].
    #[inline(never)]
    fn send_frame(&mut self) -> bool {
        let now = Microseconds(Instant::now().as_micros());
        let Some(length) = self.node.transmit(now, &mut self.frame) else { return false };
        exchange::queue(&self.frame[..length]);
        true
    }

    /// Passes on another speed of the line: the link takes it after all frames before.
    fn change_speed(&mut self) {
        let baud = self.node.baud();
        if baud != core::mem::replace(&mut self.baud, baud) {
            exchange::BAUD.signal(baud);
        }
    }

    /// Passes on the host's wish to reboot: the link restarts the chip when the last frame is sent.
    fn reboot(&mut self) {
        if let Some(to) = self.node.take_reboot() {
            memory::prepare_reboot(to);
            exchange::request_reboot();
        }
    }
}
