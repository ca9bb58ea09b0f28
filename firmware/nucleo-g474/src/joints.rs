//! The robot's servo bus on USART3: [`JointLine`] in the port's interrupt, below the node and its tick, above the executor.
//!
//! The interrupt is raised when the wire falls silent after bytes, when the node gives orders, and each millisecond by
//! [`keep_going`]. Bytes come and go by DMA, because the node's tick may hold the interrupt up for half a millisecond, which are
//! 200 bytes at 4 Mbit/s. A board that drives no joints leaves port and pins alone.

use core::cell::RefCell;
use core::sync::atomic::{AtomicU8, Ordering, compiler_fence};

use cortex_m::peripheral::NVIC;
use critical_section::Mutex;
use embassy_stm32::gpio::{AfType, Flex, OutputType, Pull, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::pac::bdma::vals::{Dir, Pl};
use embassy_stm32::pac::{DMA1, DMAMUX1, USART3, bdma};
use embassy_stm32::usart::{DePin, RxDma, TxDma, TxPin};
use embassy_stm32::{Peri, peripherals, rcc};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Instant, Timer};
use heapless::Vec;
use vergence_control::joints::{BusSettings, JointLine, JointOrders, JointStates};
use vergence_protocol::Microseconds;

/// Below the node, above the executor.
const PRIORITY: Priority = Priority::P12;
/// Longest time between two looks at the bus: as [`JointLine::poll`] asks.
const PERIOD_US: u64 = 1_000;
/// Bytes that DMA keeps until the interrupt takes them: of 1.2 ms at 4 Mbit/s.
const RING: usize = 512;
/// Longest transmission in bytes.
const LONGEST: usize = 256;
/// Bytes that are passed on at once.
const PORTION: usize = 64;
/// Channels of DMA1, counted from 0; [`BusPort::new`] takes them.
const RX_CHANNEL: usize = 5;
const TX_CHANNEL: usize = 6;
/// Half a bit before and after the bytes in which the buffer on the wire is switched, in sixteenths of a bit.
const TURNING: u8 = 8;

/// What the wire has brought, the board's own bytes included. DMA writes it.
static HEARD: [AtomicU8; RING] = [const { AtomicU8::new(0) }; RING];
/// What is being sent. DMA reads it.
static SAID: [AtomicU8; LONGEST] = [const { AtomicU8::new(0) }; LONGEST];
static SHARED: Mutex<RefCell<Shared>> =
    Mutex::new(RefCell::new(Shared { port: None, change: None, orders: None, states: None }));
/// Wakes [`keep_going`]: there are joints now.
static DRIVES: Signal<CriticalSectionRawMutex, ()> = Signal::new();

/// Port and pins of the bus.
pub struct BusPort {
    data: Flex<'static>,
    drive: Flex<'static>,
    functions: [u8; 2],
    requests: [u8; 2],
}

impl BusPort {
    /// Takes port, pins and channels. Nothing is set up before there are joints.
    pub fn new(
        _port: Peri<'static, peripherals::USART3>,
        data: Peri<'static, impl TxPin<peripherals::USART3>>,
        drive: Peri<'static, impl DePin<peripherals::USART3>>,
        rx: Peri<'static, peripherals::DMA1_CH6>,
        tx: Peri<'static, peripherals::DMA1_CH7>,
    ) -> Self {
        Self {
            functions: [data.af_num(), drive.af_num()],
            requests: [RxDma::<peripherals::USART3>::request(&*rx), TxDma::<peripherals::USART3>::request(&*tx)],
            data: Flex::new(data),
            drive: Flex::new(drive),
        }
    }

    /// Gives the port to its interrupt.
    pub fn start(self) {
        with_shared(|shared| shared.port = Some(self));
        interrupt::USART3.set_priority(PRIORITY);
        // SAFETY: the handler has what it needs; nothing relies on this interrupt being masked.
        #[allow(unsafe_code, reason = "unmasking an interrupt")]
        unsafe {
            interrupt::USART3.enable();
        }
    }

    /// Sets up port and pins: one wire for both directions (RM0440, 37.5.15), which whoever speaks pulls down, and a line that
    /// is high while the board speaks (37.5.20).
    fn open(&mut self, baud: u32) {
        let [data, drive] = self.functions;
        self.data.set_as_af_unchecked(data, AfType::output_pull(OutputType::OpenDrain, Speed::High, Pull::Up));
        self.drive.set_as_af_unchecked(drive, AfType::output(OutputType::PushPull, Speed::High));
        rcc::enable_and_reset::<peripherals::USART3>();
        let clock = rcc::frequency::<peripherals::USART3>().0; // the system clock: clocks::start
        USART3.brr().write(|w| w.set_brr(((clock + baud / 2) / baud) as u16));
        USART3.cr3().write(|w| {
            w.set_hdsel(true);
            w.set_dem(true);
            w.set_dmar(true);
            w.set_dmat(true);
            // A byte too many must not stop those behind it.
            w.set_ovrdis(true);
        });
        for (channel, request) in [RX_CHANNEL, TX_CHANNEL].into_iter().zip(self.requests) {
            DMAMUX1.ccr(channel).write(|w| w.set_dmareq_id(request));
        }
        let ring = DMA1.ch(RX_CHANNEL);
        ring.cr().modify(|w| w.set_en(false));
        ring.ndtr().write(|w| w.set_ndt(RING as u16));
        ring.par().write_value(USART3.rdr().as_ptr() as u32);
        ring.mar().write_value(HEARD.as_ptr() as u32);
        ring.cr().write(|w| {
            w.set_dir(Dir::FROM_PERIPHERAL);
            w.set_minc(true);
            w.set_circ(true);
            w.set_pl(Pl::MEDIUM);
            w.set_en(true);
        });
        USART3.cr1().write(|w| {
            w.set_fifoen(true);
            w.set_te(true);
            // The receiver stays on while the board speaks: switching it on again after the last byte would need the processor,
            // which may be busy while a servo answers already. The board's own bytes are counted off.
            w.set_re(true);
            w.set_deat(TURNING);
            w.set_dedt(TURNING);
            w.set_idleie(true);
            w.set_ue(true);
        });
    }
}

/// What node and interrupt tell each other.
struct Shared {
    /// The port, until its interrupt takes it.
    port: Option<BusPort>,
    /// New settings that the interrupt has not taken yet; `None` in them for no joints.
    change: Option<Option<BusSettings>>,
    /// New orders.
    orders: Option<JointOrders>,
    /// What is known of the joints; `None` where there are none.
    states: Option<JointStates>,
}

fn with_shared<R>(act: impl FnOnce(&mut Shared) -> R) -> R {
    critical_section::with(|cs| act(&mut SHARED.borrow_ref_mut(cs)))
}

/// Lets the interrupt look after the bus.
fn ring() {
    NVIC::pend(interrupt::USART3);
}

/// The joints as the node sees them.
#[derive(Default)]
pub struct Joints {
    settings: Option<BusSettings>,
    orders: JointOrders,
    /// Whether goals wait for the end of the tick.
    waits: bool,
    /// What was known at the beginning of the tick.
    states: Option<JointStates>,
}

impl Joints {
    /// Drives joints with these settings from now on, or none.
    pub fn configure(&mut self, settings: Option<&BusSettings>) {
        if self.settings.as_ref() == settings {
            return;
        }
        self.settings = settings.cloned();
        self.orders = JointOrders::default();
        self.waits = false;
        self.states = settings.map(|_| JointStates::default());
        with_shared(|shared| {
            shared.change = Some(self.settings.clone());
            shared.orders = None;
            shared.states = self.states.clone();
        });
        DRIVES.signal(());
        ring();
    }

    /// Takes what is known of the joints now: the tick works with that.
    pub fn latch(&mut self) {
        if let Some(states) = &mut self.states {
            with_shared(|shared| {
                if let Some(known) = &shared.states {
                    states.clone_from(known);
                }
            });
        }
    }

    /// What is known of the joints; `None` where there are none.
    pub fn states(&self) -> Option<&JointStates> {
        self.states.as_ref()
    }

    /// Switches the torque of all joints.
    pub fn set_torque(&mut self, on: bool) {
        if self.states.is_some() {
            self.orders.set_torque(on);
            self.give_orders();
        }
    }

    /// Sets the goal of a joint.
    pub fn set_goal(&mut self, joint: usize, counts: i32) {
        if self.states.is_some() {
            self.orders.set_goal(joint, counts);
            self.waits = true;
        }
    }

    /// Ends the tick: its goals are given.
    pub fn release(&mut self) {
        if self.waits {
            self.give_orders();
        }
    }

    fn give_orders(&mut self) {
        self.waits = false;
        with_shared(|shared| shared.orders = Some(self.orders.clone()));
        ring();
    }
}

/// Looks after the bus each millisecond while there are joints: at rest the node's ticks are rarer.
#[embassy_executor::task]
pub async fn keep_going() {
    loop {
        if with_shared(|shared| shared.states.is_none()) {
            DRIVES.wait().await;
        }
        Timer::after_micros(PERIOD_US).await;
        ring();
    }
}

#[interrupt]
fn USART3() {
    static mut PORT: Option<BusPort> = None;
    static mut BUS: Option<Bus> = None;
    if PORT.is_none() {
        *PORT = with_shared(|shared| shared.port.take());
    }
    let Some(port) = PORT else { return };
    if let Some(settings) = with_shared(|shared| shared.change.take()) {
        if BUS.take().is_some() {
            USART3.cr1().write(|_| {});
        }
        *BUS = settings.map(|settings| Bus::open(port, settings));
    }
    if let Some(bus) = BUS {
        bus.look_after();
    }
}

fn now() -> Microseconds {
    Microseconds(Instant::now().as_micros())
}

/// The open bus.
struct Bus {
    line: JointLine,
    /// Place in the ring of the next byte to be taken.
    next: usize,
    /// The board's own bytes that are still to come from the ring.
    echo: usize,
}

impl Bus {
    fn open(port: &mut BusPort, settings: BusSettings) -> Self {
        port.open(settings.baud);
        Self { line: JointLine::new(settings), next: 0, echo: 0 }
    }

    fn look_after(&mut self) {
        // Before the ring is read, so that what comes after it raises the interrupt again.
        USART3.icr().write(|w| {
            w.set_idle(true);
            w.set_fe(true);
            w.set_ne(true);
        });
        self.hear();
        if let Some(orders) = with_shared(|shared| shared.orders.take()) {
            self.line.order(&orders);
        }
        if let Some(bytes) = self.line.poll(now()) {
            self.send(&bytes);
        }
        let states = self.line.states();
        with_shared(|shared| {
            // Not those of other joints than the node has just asked for.
            if shared.change.is_none() {
                shared.states = Some(states);
            }
        });
    }

    /// Takes what the wire has brought since the last call, without the board's own bytes.
    fn hear(&mut self) {
        let end = written();
        while self.next != end {
            let mut portion = Vec::<u8, PORTION>::new();
            while self.next != end && !portion.is_full() {
                let byte = HEARD[self.next % RING].load(Ordering::Relaxed);
                self.next = (self.next + 1) % RING;
                if self.echo > 0 {
                    self.echo -= 1;
                } else if portion.push(byte).is_err() {
                    break;
                }
            }
            self.line.hear(&portion);
        }
    }

    /// Sends these bytes. The line waits until those before them are over.
    fn send(&mut self, bytes: &[u8]) {
        let channel: bdma::Ch = DMA1.ch(TX_CHANNEL);
        channel.cr().modify(|w| w.set_en(false));
        for (place, &byte) in SAID.iter().zip(bytes) {
            place.store(byte, Ordering::Relaxed);
        }
        // What has come until now answers no question; what follows begins with these bytes.
        (self.next, self.echo) = (written(), bytes.len());
        channel.ndtr().write(|w| w.set_ndt(bytes.len().min(LONGEST) as u16));
        channel.par().write_value(USART3.tdr().as_ptr() as u32);
        channel.mar().write_value(SAID.as_ptr() as u32);
        compiler_fence(Ordering::SeqCst);
        channel.cr().write(|w| {
            w.set_dir(Dir::FROM_MEMORY);
            w.set_minc(true);
            w.set_en(true);
        });
    }
}

/// The place in the ring at which DMA writes the next byte.
fn written() -> usize {
    let left = usize::from(DMA1.ch(RX_CHANNEL).ndtr().read().ndt());
    compiler_fence(Ordering::SeqCst);
    (RING - left) % RING
}
