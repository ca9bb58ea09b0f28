//! Simulated servos at the other end of a pseudo-terminal.
#![allow(
    clippy::unwrap_used,
    clippy::disallowed_methods,
    clippy::disallowed_types,
    reason = "a test fails by panic; a peer talks in real time"
)]

use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use serialport::{SerialPort, TTYPort};
use vergence_plant::servo::{Free, Master, Nanoseconds, ServoBus};

/// Servos that answer on a pseudo-terminal until they are taken back.
pub struct ServoLine {
    /// Name of the terminal to open.
    pub name: String,
    stop: Arc<AtomicBool>,
    server: JoinHandle<ServoBus<Free>>,
    // Open as long as the servos answer: else the other end would fail.
    _theirs: TTYPort,
}

impl ServoLine {
    pub fn serve(bus: ServoBus<Free>) -> Self {
        let (mut ours, theirs) = TTYPort::pair().unwrap();
        ours.set_timeout(Duration::from_millis(2)).unwrap();
        let stop = Arc::new(AtomicBool::new(false));
        let server = std::thread::spawn({
            let stop = stop.clone();
            move || answer(ours, bus, &stop)
        });
        Self { name: theirs.name().unwrap(), stop, server, _theirs: theirs }
    }

    /// The servos as they are now.
    pub fn take_back(self) -> ServoBus<Free> {
        self.stop.store(true, Ordering::Relaxed);
        self.server.join().unwrap()
    }
}

/// Serves servos at the speed that the other end has set. Simulated time follows the clock, and runs ahead while they answer.
fn answer(mut port: TTYPort, mut bus: ServoBus<Free>, stop: &AtomicBool) -> ServoBus<Free> {
    let mut now = Nanoseconds(0);
    let mut last = Instant::now();
    let mut buffer = [0; 256];
    while !stop.load(Ordering::Relaxed) {
        let count = port.read(&mut buffer).unwrap_or(0);
        let mut master = Master::new(port.baud_rate().unwrap());
        // After a jump ahead it goes on with the clock: a master that waits sees the servos move.
        let passed = std::mem::replace(&mut last, Instant::now()).elapsed();
        master.now = now.plus(Nanoseconds(u64::try_from(passed.as_nanos()).unwrap()));
        bus.advance(master.now);
        if count > 0 {
            // Long enough for the next servo of a read; a ping of all has a slot for each number.
            let is_ping_of_all = buffer.get(4..8) == Some(&[0xFE, 3, 0, 1]);
            let wait = if is_ping_of_all { 5_000_000 } else { 15_000 };
            let heard = master.ask(&mut bus, &buffer[..count], Nanoseconds::microseconds(wait));
            port.write_all(&heard).unwrap();
        }
        now = master.now;
    }
    bus
}
