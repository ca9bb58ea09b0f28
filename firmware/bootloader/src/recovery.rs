//! Serial recovery: waits for another image on the same line, with the same frames. It knows only management messages,
//! which are frozen for ever, so that a host of any age can send one.

use embassy_stm32::usart::{self, RingBufferedUartRx, Uart, UartTx};
use embassy_stm32::{Peri, bind_interrupts, dma, mode, peripherals};
use embedded_hal_nb::serial::Read;
use static_cell::StaticCell;
use vergence_control::{BoardServices, Flash, PAGE, Updater};
use vergence_image::Survivor;
use vergence_image::layout::HARDWARE;
use vergence_nucleo_common::{Services, feed_watchdog, memory};
use vergence_protocol::frame::{self, Frame, Header, Kind};
use vergence_protocol::management::{Identity, Management, ManagementReport, Outcome, RebootTo};
use vergence_protocol::{MAX_FRAME, PROTOCOL, Receiver};

/// Speed of the line in baud: always the default, because settings are not read here.
const BAUD: u32 = 921_600;
/// Bytes of the receive ring: holds what arrives while a page is erased.
const RING: usize = 4096;

bind_interrupts!(struct Interrupts {
    LPUART1 => usart::InterruptHandler<peripherals::LPUART1>;
    DMA1_CHANNEL1 => dma::InterruptHandler<peripherals::DMA1_CH1>;
    DMA1_CHANNEL2 => dma::InterruptHandler<peripherals::DMA1_CH2>;
});

/// The serial line through the ST-LINK's virtual COM port.
pub struct Line {
    /// The serial port.
    pub port: Peri<'static, peripherals::LPUART1>,
    /// Output pin.
    pub tx: Peri<'static, peripherals::PA2>,
    /// Input pin.
    pub rx: Peri<'static, peripherals::PA3>,
    /// DMA channel of the output.
    pub tx_dma: Peri<'static, peripherals::DMA1_CH2>,
    /// DMA channel of the input.
    pub rx_dma: Peri<'static, peripherals::DMA1_CH1>,
}

/// Serves management requests until the host asks for a restart. Images older than `oldest` (major, minor, patch) are
/// refused.
pub fn serve(line: Line, services: Services, oldest: [u8; 3]) -> ! {
    let Some((mut rx, tx)) = open(line) else { reboot(RebootTo::Application) };
    let mut recovery = Recovery { tx, services, oldest, updater: Updater::default(), seq: 0 };
    let mut receiver = Receiver::new();
    loop {
        feed_watchdog();
        // A line error loses bytes; the receiver finds the next frame by its zero and checks it by its checksum.
        if let Ok(byte) = Read::<u8>::read(&mut rx)
            && let Some(frame) = receiver.push(byte)
        {
            recovery.receive(&frame);
        }
    }
}

fn open(line: Line) -> Option<(RingBufferedUartRx<'static>, UartTx<'static, mode::Async>)> {
    static MEMORY: StaticCell<[u8; RING]> = StaticCell::new();
    let mut config = usart::Config::default();
    config.baudrate = BAUD;
    let uart = Uart::new(line.port, line.rx, line.tx, line.tx_dma, line.rx_dma, Interrupts, config).ok()?;
    let (tx, rx) = uart.split();
    let mut rx = rx.into_ring_buffered(MEMORY.init_with(|| [0; RING]));
    rx.start_uart();
    Some((rx, tx))
}

struct Recovery {
    tx: UartTx<'static, mode::Async>,
    services: Services,
    oldest: [u8; 3],
    updater: Updater,
    seq: u8,
}

impl Recovery {
    fn receive(&mut self, frame: &Frame<'_>) {
        if frame.header.kind != Kind::Firmware {
            return;
        }
        let Ok(request) = frame.body::<Management>() else { return };
        let seq = frame.header.seq;
        let report = self.carry_out(seq, &request);
        self.answer(seq, &report);
        if let Management::Reboot(to) = request {
            reboot(to);
        }
    }

    fn carry_out(&mut self, seq: u8, request: &Management) -> ManagementReport {
        let services = &mut self.services;
        let outcome = match request {
            Management::Identify => return ManagementReport::Identity(identify(services, self.oldest)),
            Management::Begin(header) if header.hardware != HARDWARE => Outcome::WrongHardware,
            Management::Begin(header) if header.version < self.oldest => Outcome::TooOld,
            Management::Begin(header) => self.updater.begin(header, services),
            Management::Chunk { offset, data } => self.updater.chunk(*offset, data, services),
            Management::Commit(signature) => self.updater.commit(signature, services),
            // An image can be confirmed only while it runs.
            Management::Confirm => Outcome::NotBegun,
            Management::Rollback => match services.roll_back() {
                Ok(true) => Outcome::Done,
                Ok(false) => Outcome::NothingToRollBack,
                Err(_) => Outcome::FlashFailed,
            },
            Management::Reboot(_) => Outcome::Done,
        };
        ManagementReport::Progress { to: seq, next: self.updater.next(), outcome }
    }

    fn answer(&mut self, ack: u8, report: &ManagementReport) {
        let header = Header { major: PROTOCOL.major, kind: Kind::Firmware, seq: self.seq, ack };
        self.seq = self.seq.wrapping_add(1);
        let mut buffer = [0; MAX_FRAME];
        if let Ok(length) = frame::encode(header, report, &mut buffer) {
            // A zero before the frame ends any noise on the line.
            let _ = self.tx.blocking_write(&[0]).and_then(|()| self.tx.blocking_write(&buffer[..length]));
            let _ = self.tx.blocking_flush();
        }
    }
}

fn identify(services: &mut Services, oldest: [u8; 3]) -> Identity {
    Identity {
        hardware: HARDWARE,
        version: [0; 3],
        oldest,
        build: 0,
        boot: services.boot_state(),
        capacity: u32::try_from(services.image_flash().pages() * PAGE).unwrap_or(u32::MAX),
    }
}

fn reboot(to: RebootTo) -> ! {
    memory::remember(&Survivor { failed_starts: 0, recovery_wanted: to == RebootTo::Recovery, ..memory::survivor() });
    cortex_m::peripheral::SCB::sys_reset()
}
