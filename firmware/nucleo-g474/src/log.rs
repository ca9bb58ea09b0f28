//! The log: defmt entries on the serial link, or with feature `log-rtt` to a debug probe.

#[cfg(feature = "log-rtt")]
use defmt_rtt as _;
use embassy_time::Instant;
use vergence_control::NodeIdentity;
use vergence_image::DeathKind;

defmt::timestamp!("{=u64:us}", Instant::now().as_micros());

/// Logs version and build of the firmware, and how the last start ended.
pub fn greet(identity: &NodeIdentity) {
    let [major, minor, patch] = identity.firmware;
    defmt::info!("vergence {=u8}.{=u8}.{=u8}, build {=u64:016x}", major, minor, patch, identity.build);
    let Some(death) = vergence_nucleo_common::memory::survivor().death else { return };
    let trace = death.trace();
    match death.kind {
        DeathKind::Panic => defmt::error!("died of a panic, called from {=[?]:#x}", trace),
        DeathKind::HardFault => defmt::error!("died of a fault at, called from {=[?]:#x}", trace),
        DeathKind::Settings => defmt::error!("could not start with the settings of this firmware"),
        DeathKind::SerialLine => defmt::error!("could not start with the serial line's speed"),
    }
}

/// Gives the oldest entry to `to`, if there is one.
pub fn forward(to: impl FnOnce(&[u8])) {
    #[cfg(feature = "log-link")]
    link::forward(to);
    #[cfg(not(feature = "log-link"))]
    let _ = to;
}

#[cfg(feature = "log-link")]
mod link {
    //! Queue of log entries for the node. An entry that does not fit is dropped whole; logging never waits.

    use core::cell::RefCell;

    use critical_section::{Mutex, RestoreState};
    use heapless::{Deque, Vec};

    /// Length of the longest entry in bytes.
    const ENTRY: usize = 128;

    static STATE: Mutex<RefCell<State>> = Mutex::new(RefCell::new(State::new()));

    struct State {
        encoder: defmt::Encoder,
        /// Leaves the critical section that spans one entry.
        outside: Option<RestoreState>,
        entry: Vec<u8, ENTRY>,
        too_long: bool,
        /// Queued entries: each ends with a zero, the only one in it (rzCOBS).
        queue: Deque<u8, 512>,
    }

    impl State {
        const fn new() -> Self {
            Self {
                encoder: defmt::Encoder::new(),
                outside: None,
                entry: Vec::new(),
                too_long: false,
                queue: Deque::new(),
            }
        }

        /// Runs `step` of the encoder and collects the bytes that it writes.
        fn encode(&mut self, step: impl FnOnce(&mut defmt::Encoder, &mut dyn FnMut(&[u8]))) {
            let Self { encoder, entry, too_long, .. } = self;
            step(encoder, &mut |bytes| *too_long |= entry.extend_from_slice(bytes).is_err());
        }
    }

    fn with<R>(work: impl FnOnce(&mut State) -> R) -> R {
        critical_section::with(|cs| work(&mut STATE.borrow_ref_mut(cs)))
    }

    pub fn forward(to: impl FnOnce(&[u8])) {
        let mut entry = Vec::<u8, ENTRY>::new();
        with(|state| {
            while let Some(byte) = state.queue.pop_front() {
                // Longer entries are never queued.
                let _ = entry.push(byte);
                if byte == 0 {
                    break;
                }
            }
        });
        if !entry.is_empty() {
            to(&entry);
        }
    }

    #[defmt::global_logger]
    struct Logger;

    // SAFETY: one critical section lasts from `acquire` to `release`, so that no other code can acquire.
    #[allow(unsafe_code, reason = "what defmt asks for")]
    unsafe impl defmt::Logger for Logger {
        fn acquire() {
            // SAFETY: `release` leaves this section, as defmt calls both in pairs.
            let outside = unsafe { critical_section::acquire() };
            with(|state| {
                state.outside = Some(outside);
                state.entry.clear();
                state.too_long = false;
                state.encode(|encoder, write| encoder.start_frame(write));
            });
        }

        unsafe fn write(bytes: &[u8]) {
            with(|state| state.encode(|encoder, write| encoder.write(bytes, write)));
        }

        unsafe fn release() {
            let outside = with(|state| {
                state.encode(|encoder, write| encoder.end_frame(write));
                if !state.too_long && state.entry.len() <= state.queue.capacity() - state.queue.len() {
                    for &byte in &state.entry {
                        // The queue has room.
                        let _ = state.queue.push_back(byte);
                    }
                }
                state.outside.take()
            });
            if let Some(outside) = outside {
                // SAFETY: this is the state that `acquire` saved.
                unsafe { critical_section::release(outside) };
            }
        }

        unsafe fn flush() {}
    }
}
