//! The index lines of the encoders, read at each of their edges in an interrupt of the highest priority.

use core::cell::RefCell;

use critical_section::Mutex;
use embassy_stm32::gpio::{Input, Pull};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::pac::gpio::vals::Idr;
use embassy_stm32::{Peri, pac, peripherals, rcc};
use vergence_control::{IndexEdge, IndexEdges};

use crate::encoder::Counter;

/// The lines of EXTI that the index pins have, and the port of both: B.
const INDEX_LINES: [usize; 2] = [11, 12];
const PORT_B: u8 = 1;
/// Edges of the index lines in the running tick.
static SHARED: Mutex<RefCell<Shared>> =
    Mutex::new(RefCell::new(Shared { counters: [None; 2], edges: [IndexEdges::new(), IndexEdges::new()] }));

/// What the interrupt reads and writes.
struct Shared {
    counters: [Option<Counter>; 2],
    edges: [IndexEdges; 2],
}

/// The index lines of the first two encoders.
pub struct IndexLines {
    _pins: [Input<'static>; 2],
}

impl IndexLines {
    /// Watches both lines, for encoders with the first of these counters, which have 32 bits. The lines are pulled up, for encoders
    /// with open-collector outputs; a line that is not wired stays high.
    pub fn new<const N: usize>(
        first: Peri<'static, peripherals::PB11>,
        second: Peri<'static, peripherals::PB12>,
        counters: [Counter; N],
    ) -> Self {
        let counters = core::array::from_fn(|axis| counters.get(axis).copied());
        critical_section::with(|cs| SHARED.borrow_ref_mut(cs).counters = counters);
        let pins = [Input::new(first, Pull::Up), Input::new(second, Pull::Up)];
        rcc::enable_and_reset::<peripherals::SYSCFG>();
        for line in INDEX_LINES {
            pac::SYSCFG.exticr(line / 4).modify(|w| w.set_exti(line % 4, PORT_B));
            pac::EXTI.rtsr(0).modify(|w| w.set_line(line, true));
            pac::EXTI.ftsr(0).modify(|w| w.set_line(line, true));
            pac::EXTI.imr(0).modify(|w| w.set_line(line, true));
        }
        interrupt::EXTI15_10.set_priority(Priority::P0);
        // SAFETY: the handler is complete; nothing relies on this interrupt being masked.
        #[allow(unsafe_code, reason = "unmasking an interrupt")]
        unsafe {
            interrupt::EXTI15_10.enable();
        }
        Self { _pins: pins }
    }

    /// Takes the first rise and the first fall since the last call, and lets the next ones come: two in a tick, so that a line full
    /// of noise does not keep the processor busy.
    pub fn take(&mut self, axis: usize) -> IndexEdges {
        let Some(line) = INDEX_LINES.get(axis) else { return IndexEdges::new() };
        critical_section::with(|cs| {
            pac::EXTI.imr(0).modify(|w| w.set_line(*line, true));
            SHARED.borrow_ref_mut(cs).edges.get_mut(axis).map(core::mem::take).unwrap_or_default()
        })
    }
}

#[interrupt]
fn EXTI15_10() {
    critical_section::with(|cs| {
        let shared = &mut *SHARED.borrow_ref_mut(cs);
        let counts = shared.counters.map(|counter| counter.map_or(0, Counter::read).cast_signed());
        let levels = pac::GPIOB.idr().read();
        let pending = pac::EXTI.pr(0).read();
        for ((edges, count), line) in shared.edges.iter_mut().zip(counts).zip(INDEX_LINES) {
            if !pending.line(line) {
                continue;
            }
            pac::EXTI.pr(0).write(|w| w.set_line(line, true));
            let rises = levels.idr(line) == Idr::HIGH;
            if !edges.iter().any(|known| known.rises == rises) {
                let _ = edges.push(IndexEdge { count, rises });
            }
            if edges.is_full() {
                pac::EXTI.imr(0).modify(|w| w.set_line(line, false));
            }
        }
    });
}
