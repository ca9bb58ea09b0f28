//! Pins as a value change dump (IEEE 1364-2005 §18), for a waveform viewer.

use std::fmt::Write;

use crate::pin::{Pin, PinSet};
use crate::world::PinEdge;

/// Edges of chosen pins since the trace began.
#[derive(Clone, Debug, Default)]
pub(crate) struct Trace {
    /// Traced pins with their levels at the beginning.
    pins: Vec<(Pin, bool)>,
    edges: Vec<PinEdge>,
}

impl Trace {
    pub fn new(pins: Vec<(Pin, bool)>) -> Self {
        Self { pins, edges: Vec::new() }
    }

    pub fn watched(&self) -> PinSet {
        self.pins.iter().fold(0, |all, (pin, _)| all | pin.set())
    }

    pub fn note(&mut self, edge: PinEdge) {
        if self.pins.iter().any(|(pin, _)| *pin == edge.pin) {
            self.edges.push(edge);
        }
    }

    /// The dump, in picoseconds since power-on; pins under the names that `name` gives them.
    pub fn dump(&self, name: impl Fn(Pin) -> String) -> String {
        let mut text = String::from("$timescale 1 ps $end\n$scope module stm32g474 $end\n");
        let symbol = |index: usize| char::from(b'!' + (index % 94) as u8);
        for (index, (pin, _)) in self.pins.iter().enumerate() {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "$var wire 1 {} {} $end", symbol(index), name(*pin));
        }
        text.push_str("$upscope $end\n$enddefinitions $end\n#0\n$dumpvars\n");
        for (index, (_, high)) in self.pins.iter().enumerate() {
            let _ = writeln!(text, "{}{}", u8::from(*high), symbol(index));
        }
        text.push_str("$end\n");
        let mut last = 0;
        for edge in &self.edges {
            let Some(index) = self.pins.iter().position(|(pin, _)| *pin == edge.pin) else { continue };
            if edge.at.time.0 != last {
                last = edge.at.time.0;
                let _ = writeln!(text, "#{last}");
            }
            let _ = writeln!(text, "{}{}", u8::from(edge.high), symbol(index));
        }
        text
    }
}
