//! The exceptions' states and priorities (B1.5, B3.4): which is pending, which active, which comes first.

use crate::bus::Lines;

/// Exception numbers of the architecture (table B1-4).
pub(crate) mod exception {
    pub const NMI: u16 = 2;
    pub const HARD_FAULT: u16 = 3;
    pub const MEMORY: u16 = 4;
    pub const BUS: u16 = 5;
    pub const USAGE: u16 = 6;
    pub const SUPERVISOR_CALL: u16 = 11;
    pub const PENDABLE: u16 = 14;
    pub const SYSTEM_TICK: u16 = 15;
    /// Exception number of interrupt line 0.
    pub const FIRST_LINE: u16 = 16;
}

/// Priority of code outside any exception: below every configurable one.
pub(crate) const THREAD_PRIORITY: i32 = 256;
/// Priority that FAULTMASK raises to, and that of HardFault.
pub(crate) const HARD_FAULT_PRIORITY: i32 = -1;
const NMI_PRIORITY: i32 = -2;
/// The STM32G4 implements four bits of priority.
pub(crate) const PRIORITY_BITS: u8 = 0xf0;

/// Exception states. System exceptions are bits of a half-word by their number; lines are bits of [`Lines`].
#[derive(Clone)]
pub(crate) struct Nvic {
    pub enabled: Lines,
    pub pending: Lines,
    pub active: Lines,
    asserted: Lines,
    priorities: [u8; 128],
    pub system_pending: u16,
    pub system_active: u16,
    system_priorities: [u8; 16],
    /// AIRCR.PRIGROUP.
    pub grouping: u32,
    nmi: bool,
}

impl Nvic {
    pub const fn new() -> Self {
        Self {
            enabled: 0,
            pending: 0,
            active: 0,
            asserted: 0,
            priorities: [0; 128],
            system_pending: 0,
            system_active: 0,
            system_priorities: [0; 16],
            grouping: 0,
            nmi: false,
        }
    }

    /// Whether [`Self::observe`] would change nothing.
    #[inline]
    pub fn knows(&self, lines: Lines, nmi: bool) -> bool {
        lines == self.asserted && lines & !self.active & !self.pending == 0 && nmi == self.nmi
    }

    /// Records the chip's lines. An asserted line pends; while its handler runs, only a new edge does. Returns whether
    /// an exception became pending.
    pub fn observe(&mut self, lines: Lines, nmi: bool) -> bool {
        if self.knows(lines, nmi) {
            return false;
        }
        let fresh = lines & (!self.active | !self.asserted) & !self.pending;
        self.pending |= fresh;
        self.asserted = lines;
        let rising = nmi && !self.nmi;
        self.nmi = nmi;
        if rising {
            self.raise(exception::NMI);
        }
        fresh != 0 || rising
    }

    pub fn raise(&mut self, number: u16) {
        match number.checked_sub(exception::FIRST_LINE) {
            Some(line) => self.pending |= 1 << (line & 127),
            None => self.system_pending |= 1 << number,
        }
    }

    pub fn clear_pending(&mut self, number: u16) {
        match number.checked_sub(exception::FIRST_LINE) {
            Some(line) => self.pending &= !(1 << (line & 127)),
            None => self.system_pending &= !(1 << number),
        }
    }

    pub fn is_pending(&self, number: u16) -> bool {
        match number.checked_sub(exception::FIRST_LINE) {
            Some(line) => self.pending >> (line & 127) & 1 != 0,
            None => self.system_pending >> number & 1 != 0,
        }
    }

    pub fn activate(&mut self, number: u16) {
        self.clear_pending(number);
        match number.checked_sub(exception::FIRST_LINE) {
            Some(line) => self.active |= 1 << (line & 127),
            None => self.system_active |= 1 << number,
        }
    }

    /// Pends a line again that is still asserted when its handler ends.
    pub fn deactivate(&mut self, number: u16) {
        match number.checked_sub(exception::FIRST_LINE) {
            Some(line) => {
                self.active &= !(1 << (line & 127));
                self.pending |= self.asserted & 1 << (line & 127);
            }
            None => self.system_active &= !(1 << number),
        }
    }

    pub fn is_active(&self, number: u16) -> bool {
        match number.checked_sub(exception::FIRST_LINE) {
            Some(line) => self.active >> (line & 127) & 1 != 0,
            None => self.system_active >> number & 1 != 0,
        }
    }

    pub fn active_count(&self) -> u32 {
        self.active.count_ones() + self.system_active.count_ones()
    }

    /// Whether any interrupt line is pending, enabled or not.
    pub fn any_line_pending(&self) -> bool {
        self.pending != 0
    }

    pub fn priority_byte(&self, number: u16) -> u8 {
        match number.checked_sub(exception::FIRST_LINE) {
            Some(line) => self.priorities[usize::from(line & 127)],
            None => self.system_priorities[usize::from(number)],
        }
    }

    pub fn set_priority_byte(&mut self, number: u16, priority: u8) {
        match number.checked_sub(exception::FIRST_LINE) {
            Some(line) => self.priorities[usize::from(line & 127)] = priority & PRIORITY_BITS,
            None => self.system_priorities[usize::from(number)] = priority & PRIORITY_BITS,
        }
    }

    /// The part of a priority that decides about preemption (B1.5.4).
    pub fn group(&self, priority: u8) -> i32 {
        i32::from(priority) & (-2 << self.grouping)
    }

    /// Priority with the sub-priority, lower is more urgent.
    fn full_priority(&self, number: u16) -> i32 {
        match number {
            exception::NMI => NMI_PRIORITY,
            exception::HARD_FAULT => HARD_FAULT_PRIORITY,
            _ => i32::from(self.priority_byte(number)),
        }
    }

    /// Priority that decides about preemption.
    pub fn priority(&self, number: u16) -> i32 {
        match number {
            exception::NMI => NMI_PRIORITY,
            exception::HARD_FAULT => HARD_FAULT_PRIORITY,
            _ => self.group(self.priority_byte(number)),
        }
    }

    /// The exception to take next, regardless of what runs now: highest priority, then lowest number.
    pub fn best_pending(&self) -> Option<u16> {
        let lines = self.pending & self.enabled;
        if lines == 0 && self.system_pending == 0 {
            return None;
        }
        numbers(self.system_pending, lines).min_by_key(|&number| (self.full_priority(number), number))
    }

    /// The most urgent priority among the active exceptions.
    pub fn active_priority(&self) -> i32 {
        numbers(self.system_active, self.active).map(|number| self.priority(number)).min().unwrap_or(THREAD_PRIORITY)
    }
}

/// The exception numbers of both sets, ascending.
fn numbers(mut system: u16, mut lines: Lines) -> impl Iterator<Item = u16> {
    std::iter::from_fn(move || {
        if system != 0 {
            let number = system.trailing_zeros() as u16;
            system &= system - 1;
            return Some(number);
        }
        (lines != 0).then(|| {
            let line = lines.trailing_zeros() as u16;
            lines &= lines - 1;
            line + exception::FIRST_LINE
        })
    })
}
