//! Bytes from the line: DMA fills a ring and never stops, whatever happens on the line.
//!
//! The driver's own reader stops DMA at each line error and starts it again in mid-ring: the channel then writes from the
//! ring's start on (RM0440, 12.4.6: a channel cannot be resumed) while the reader goes on where it was, and what it reads
//! is a lap old. So errors raise no interrupt here, and the place of the next byte is the channel's own count. An error
//! costs the frame that it hit.

use embassy_stm32::interrupt::typelevel::{Handler, LPUART1};
use embassy_stm32::mode::Async;
use embassy_stm32::pac;
use embassy_stm32::usart::{RingBufferedUartRx, UartRx};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, with_timeout};
use static_cell::StaticCell;

/// Bytes of the ring: nearly twice what arrives in the 22 ms of a page erasure at 2 Mbaud, when no interrupt is served.
const RING: usize = 8 * 1024;
/// Index of the DMA channel that fills the ring.
const CHANNEL: usize = 0;

/// Rings when the line falls idle after bytes.
static IDLE: Signal<CriticalSectionRawMutex, ()> = Signal::new();

/// The part of the line's interrupt that wakes the reader. Bind it before the driver's.
pub struct Bell;

impl Handler<LPUART1> for Bell {
    #[allow(unsafe_code, reason = "what the driver's trait asks for")]
    unsafe fn on_interrupt() {
        if pac::LPUART1.isr().read().idle() {
            IDLE.signal(());
        }
    }
}

/// The ring and the place in it that is read next.
pub struct Receiver {
    /// Keeps port and channel running.
    _line: RingBufferedUartRx<'static>,
    ring: *const u8,
    next: usize,
}

impl Receiver {
    /// Starts to receive. Call it once.
    #[allow(unsafe_code, reason = "memory that DMA writes")]
    pub fn start(line: UartRx<'static, Async>) -> Self {
        static MEMORY: StaticCell<[u8; RING]> = StaticCell::new();
        let ring = MEMORY.init_with(|| [0; RING]).as_mut_ptr();
        // SAFETY: the memory is static and used once. The driver only passes its address on to DMA, because its own reader
        // is never called.
        let mut line = line.into_ring_buffered(unsafe { core::slice::from_raw_parts_mut(ring, RING) });
        line.start_uart();
        // An error would make the driver's interrupt stop DMA.
        pac::LPUART1.cr3().modify(|w| w.set_eie(false));
        Self { _line: line, ring, next: 0 }
    }

    /// Waits for bytes until the line falls idle, for `patience` at most, and takes as many as fit into `bytes`; returns
    /// their number. Bytes that nobody took for a whole ring are lost.
    pub async fn read(&mut self, bytes: &mut [u8], patience: Duration) -> usize {
        IDLE.reset();
        listen();
        // After that, so that whatever comes later rings.
        let count = self.take(bytes);
        if count > 0 {
            return count;
        }
        let _ = with_timeout(patience, IDLE.wait()).await;
        self.take(bytes)
    }

    fn take(&mut self, bytes: &mut [u8]) -> usize {
        let left = usize::from(pac::DMA1.ch(CHANNEL).ndtr().read().ndt());
        let end = RING.saturating_sub(left) % RING;
        let mut count = 0;
        for byte in bytes.iter_mut().take((end + RING - self.next) % RING) {
            // SAFETY: the index lies inside the ring, and DMA writes elsewhere now.
            #[allow(unsafe_code, reason = "memory that DMA writes")]
            let taken = unsafe { self.ring.add(self.next).read_volatile() };
            *byte = taken;
            self.next = (self.next + 1) % RING;
            count += 1;
        }
        count
    }
}

/// Forgets the end of earlier bytes and errors, and makes the next end raise the interrupt, which the driver switches off.
fn listen() {
    critical_section::with(|_| {
        pac::LPUART1.icr().write(|w| {
            w.set_idle(true);
            w.set_fe(true);
            w.set_ne(true);
            w.set_ore(true);
        });
        pac::LPUART1.cr1().modify(|w| w.set_idleie(true));
    });
}
