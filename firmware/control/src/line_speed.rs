//! The speed of the serial line. A new one is on trial until a host with an open session is heard at it, which has heard the
//! board as well; without one the board returns to the speed before. A board that hears nobody looks for a host: it listens at the speed that is set and at that of the
//! factory in turn.

use vergence_protocol::Microseconds;

/// Longest time in microseconds that a new speed stays without a request of a session: opening a port and a session takes a
/// host two seconds at most.
const TRIAL_US: u64 = 5_000_000;
/// Silence of the host in microseconds after which the board looks for it. An open session asks for the time each second.
const SILENCE_US: u64 = 5_000_000;
/// Time in microseconds at each speed while the board looks for a host: a host that opens a session says so for two
/// seconds.
const LOOK_US: u64 = 1_000_000;
/// Time in microseconds after a change in which a frame may still have been sent at the speed before: it waits in the
/// buffers between wire and node.
const LATE_US: u64 = 20_000;

/// The speed of the line, in baud, and why it has it.
#[derive(Clone, Copy, Debug)]
pub struct LineSpeed {
    factory: u32,
    /// The speed of the line.
    present: u32,
    /// The speed that it gets as soon as all frames have left.
    next: Option<u32>,
    trial: Option<Trial>,
    changed_at: Microseconds,
    /// When a frame of a host came last.
    heard_at: Option<Microseconds>,
}

/// What comes back where nobody is heard at the new speed.
#[derive(Clone, Copy, Debug)]
struct Trial {
    setting: u32,
    speed: u32,
}

impl LineSpeed {
    /// A line that starts at the speed `set`.
    pub fn new(set: u32, factory: u32) -> Self {
        let (next, trial, heard_at) = (None, None, None);
        Self { factory, present: set, next, trial, changed_at: Microseconds(0), heard_at }
    }

    /// The speed of the line.
    pub fn present(&self) -> u32 {
        self.present
    }

    /// Whether another speed waits until all frames have left.
    pub fn is_changing(&self) -> bool {
        self.next.is_some()
    }

    /// Whether no session was heard at the new speed yet.
    pub fn is_on_trial(&self) -> bool {
        self.trial.is_some()
    }

    /// Puts the speed `set` on trial; the setting was `before`.
    pub fn try_out(&mut self, set: u32, before: u32) {
        if set == self.present && self.next.is_none() {
            return;
        }
        self.trial = self.trial.or(Some(Trial { setting: before, speed: self.present }));
        self.next = Some(set);
    }

    /// Takes note of a whole frame of a host.
    pub fn hear(&mut self, now: Microseconds) {
        if self.is_of_present(now) {
            self.heard_at = Some(now);
        }
    }

    /// Takes note of a request of an open session: host and board hear each other.
    pub fn converse(&mut self, now: Microseconds) {
        if self.is_of_present(now) {
            self.trial = None;
        }
    }

    /// Whether what arrives now was sent at the present speed.
    fn is_of_present(&self, now: Microseconds) -> bool {
        self.next.is_none() && now.0 >= self.changed_at.0 + LATE_US
    }

    /// Takes note that all frames have left: a speed that waits comes into effect.
    pub fn run_dry(&mut self, now: Microseconds) {
        if let Some(next) = self.next.take() {
            self.present = next;
            self.changed_at = now;
            self.heard_at = None;
        }
    }

    /// Ends a trial, or looks for a host, when that is due; the setting is `set`. Returns the setting that comes back.
    pub fn poll(&mut self, now: Microseconds, set: u32) -> Option<u32> {
        if self.next.is_some() {
            return None;
        }
        let at_this = now.0.saturating_sub(self.changed_at.0);
        if let Some(Trial { setting, speed }) = self.trial.take_if(|_| at_this >= TRIAL_US) {
            self.next = Some(speed);
            return Some(setting);
        }
        let is_silent = self.heard_at.is_none_or(|heard| now.0.saturating_sub(heard.0) >= SILENCE_US);
        if self.trial.is_none() && is_silent && at_this >= LOOK_US {
            let other = if self.present == self.factory { set } else { self.factory };
            self.next = Some(other).filter(|&other| other != self.present);
        }
        None
    }
}
