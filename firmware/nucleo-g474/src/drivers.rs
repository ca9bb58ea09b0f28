//! The serial line of TMC2209 motor drivers: a task of the executor that runs [`DriverLine`], below the node and its tick.
//!
//! The node gives settings and reads states; the bytes come by an interrupt of the port. Without such a driver the task
//! waits for ever, and no byte is sent.

use core::cell::RefCell;
use core::future::pending;

use critical_section::Mutex;
use embassy_futures::select::{Either, select};
use embassy_stm32::gpio::{AfType, Flex, OutputType, Pull, Speed};
use embassy_stm32::interrupt;
use embassy_stm32::interrupt::{InterruptExt, Priority};
use embassy_stm32::pac::UART4;
use embassy_stm32::usart::TxPin;
use embassy_stm32::{Peri, peripherals, rcc};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
use embassy_sync::signal::Signal;
use embassy_time::{Instant, Timer};
use vergence_control::driver::{ADDRESSES, DriverLine, LONGEST};
use vergence_control::{DriverKind, DriverSettings};
use vergence_protocol::{AxisList, DriverState, Microseconds};

/// Speed of the line in baud: a request and its reply take half a millisecond. The drivers find it out by themselves.
const BAUD: u32 = 250_000;
/// Below the trigger's edge, above the node.
const PRIORITY: Priority = Priority::P4;

/// Bytes from the line, the board's own included: for one exchange at most.
static HEARD: Pipe<CriticalSectionRawMutex, { 2 * LONGEST }> = Pipe::new();
/// Wakes the task: [`SHARED`] has changed.
static CHANGED: Signal<CriticalSectionRawMutex, ()> = Signal::new();
static SHARED: Mutex<RefCell<Shared>> =
    Mutex::new(RefCell::new(Shared { settings: None, motors_on: false, states: [DriverState::Plain; ADDRESSES] }));

/// The one wire to the motor drivers.
pub struct DriverWire {
    _pin: Flex<'static>,
}

impl DriverWire {
    /// Sets up port and pin: one wire for both directions (RM0440, 37.5.15). Whoever speaks pulls it down; the pull-up keeps a
    /// wire without drivers quiet.
    pub fn new(_port: Peri<'static, peripherals::UART4>, pin: Peri<'static, impl TxPin<peripherals::UART4>>) -> Self {
        let function = pin.af_num();
        let mut pin = Flex::new(pin);
        pin.set_as_af_unchecked(function, AfType::output_pull(OutputType::OpenDrain, Speed::Medium, Pull::Up));
        rcc::enable_and_reset::<peripherals::UART4>();
        let clock = rcc::frequency::<peripherals::UART4>().0;
        UART4.brr().write(|w| w.set_brr(((clock + BAUD / 2) / BAUD) as u16));
        UART4.cr3().write(|w| w.set_hdsel(true));
        UART4.cr1().write(|w| {
            w.set_fifoen(true);
            w.set_te(true);
            // The board hears itself.
            w.set_re(true);
            w.set_rxneie(true);
            w.set_ue(true);
        });
        interrupt::UART4.set_priority(PRIORITY);
        // SAFETY: the handler is complete; nothing relies on this interrupt being masked.
        #[allow(unsafe_code, reason = "unmasking an interrupt")]
        unsafe {
            interrupt::UART4.enable();
        }
        Self { _pin: pin }
    }
}

/// What node and task tell each other.
struct Shared {
    /// New settings that the task has not taken yet.
    settings: Option<[DriverSettings; ADDRESSES]>,
    motors_on: bool,
    states: [DriverState; ADDRESSES],
}

fn with_shared<R>(act: impl FnOnce(&mut Shared) -> R) -> R {
    critical_section::with(|cs| act(&mut SHARED.borrow_ref_mut(cs)))
}

/// Gives the drivers of all axes these settings. Until the task has done so they do not count as usable.
pub fn configure(settings: &AxisList<DriverSettings>) {
    let settings = core::array::from_fn(|axis| settings.get(axis).copied().unwrap_or_default());
    with_shared(|shared| {
        shared.settings = Some(settings);
        let state = |driver: DriverSettings| match driver.kind {
            DriverKind::Plain | DriverKind::Servo => DriverState::Plain,
            DriverKind::Tmc2209 => DriverState::Starting,
        };
        shared.states = settings.map(state);
    });
    CHANGED.signal(());
}

/// Notes whether the motors are on.
pub fn set_motors(on: bool) {
    with_shared(|shared| shared.motors_on = on);
    CHANGED.signal(());
}

/// State of the driver of an axis.
pub fn state(axis: usize) -> DriverState {
    with_shared(|shared| shared.states.get(axis).copied().unwrap_or_default())
}

/// Runs the line.
#[embassy_executor::task]
pub async fn supervise(_wire: DriverWire) {
    let mut line = DriverLine::default();
    let mut bytes = [0; 2 * LONGEST];
    loop {
        take_orders(&mut line);
        if let Some(datagram) = line.poll(now()) {
            HEARD.clear();
            // They fit in the port's FIFO, which is empty.
            for byte in datagram {
                UART4.tdr().write(|w| w.set_dr(byte.into()));
            }
        }
        publish(&line);
        let alarm = async {
            match line.wakes_at() {
                Some(at) => Timer::at(Instant::from_micros(at.0)).await,
                None => pending().await,
            }
        };
        if let Either::First(count) = select(HEARD.read(&mut bytes), select(CHANGED.wait(), alarm)).await {
            bytes[..count].iter().for_each(|&byte| line.receive(now(), byte));
        }
    }
}

fn now() -> Microseconds {
    Microseconds(Instant::now().as_micros())
}

fn take_orders(line: &mut DriverLine) {
    let (settings, motors_on) = with_shared(|shared| (shared.settings.take(), shared.motors_on));
    if let Some(settings) = settings {
        line.configure(settings);
    }
    line.set_motors(motors_on);
}

/// Tells the node the states, unless it has given new settings meanwhile.
fn publish(line: &DriverLine) {
    with_shared(|shared| {
        if shared.settings.is_none() {
            shared.states.iter_mut().enumerate().for_each(|(axis, state)| *state = line.state(axis));
        }
    });
}

#[interrupt]
fn UART4() {
    while UART4.isr().read().rxne() {
        // A byte too many belongs to no exchange.
        let _ = HEARD.try_write(&[UART4.rdr().read().dr() as u8]);
    }
    // A byte with an error is no good by its datagram's checksum.
    UART4.icr().write(|w| {
        w.set_ore(true);
        w.set_fe(true);
        w.set_ne(true);
    });
}
