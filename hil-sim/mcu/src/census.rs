//! Which registers firmware has touched.

use crate::unit::{UNITS, Unit};

/// Register offsets below this are counted.
const WORDS: usize = 64;

/// A register and how it was touched.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Touched {
    /// The peripheral and the register, such as "TIM1.CCR1".
    pub register: String,
    /// Whether it was read.
    pub read: bool,
    /// Whether it was written.
    pub written: bool,
}

/// Marks for every register.
#[derive(Clone, Debug)]
pub(crate) struct Census {
    marks: Vec<u8>,
}

impl Census {
    pub fn new() -> Self {
        Self { marks: vec![0; UNITS * WORDS] }
    }

    pub fn note(&mut self, unit: Unit, offset: u32, write: bool) {
        if let Some(mark) = self.marks.get_mut(unit.index() * WORDS + (offset as usize / 4) % WORDS) {
            *mark |= 1 + u8::from(write);
        }
    }

    /// All registers touched, by peripheral and offset; `name` gives the name of a register.
    pub fn touched(&self, name: impl Fn(Unit, u32) -> Option<&'static str>) -> Vec<Touched> {
        let marked = self.marks.iter().enumerate().filter(|(_, mark)| **mark != 0);
        marked
            .filter_map(|(index, &mark)| {
                let unit = Unit::at(index / WORDS);
                let register = name(unit, (index % WORDS * 4) as u32)?;
                Some(Touched { register: format!("{unit}.{register}"), read: mark & 1 != 0, written: mark & 2 != 0 })
            })
            .collect()
    }
}
