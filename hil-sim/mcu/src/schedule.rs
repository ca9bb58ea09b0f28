//! When each peripheral is due next, and which interrupt lines it holds.

use vergence_cpu::{Cycle, Lines, NEVER};

use crate::unit::{UNITS, Unit};

#[derive(Clone, Debug)]
pub(crate) struct Schedule {
    due: [Cycle; UNITS],
    lines: [Lines; UNITS],
    /// The cycle of the next event of the world.
    world: Cycle,
    next: Cycle,
    all_lines: Lines,
}

/// A peripheral or the world, whose event is due.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Due {
    World,
    Unit(Unit),
}

impl Schedule {
    pub fn new() -> Self {
        Self { due: [NEVER; UNITS], lines: [0; UNITS], world: NEVER, next: NEVER, all_lines: 0 }
    }

    pub fn set(&mut self, unit: Unit, due: Cycle, lines: Lines) {
        let index = unit.index();
        let (due_before, lines_before) = (self.due[index], self.lines[index]);
        self.due[index] = due;
        self.lines[index] = lines;
        if due < self.next {
            self.next = due;
        } else if due_before == self.next {
            self.find_next();
        }
        if lines != lines_before {
            self.all_lines = self.lines.iter().fold(0, |all, lines| all | lines);
        }
    }

    pub fn set_world(&mut self, due: Cycle) {
        self.world = due;
        self.find_next();
    }

    fn find_next(&mut self) {
        self.next = self.due.iter().fold(self.world, |next, &due| next.min(due));
    }

    pub fn next(&self) -> Cycle {
        self.next
    }

    pub fn lines(&self) -> Lines {
        self.all_lines
    }

    /// The first that is due up to `now`, and when.
    pub fn first_until(&self, now: Cycle) -> Option<(Cycle, Due)> {
        if self.next > now {
            return None;
        }
        let who = match self.due.iter().position(|&due| due == self.next) {
            Some(index) => Due::Unit(Unit::at(index)),
            None => Due::World,
        };
        Some((self.next, who))
    }
}
