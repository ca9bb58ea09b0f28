//! How stages are wired to the NUCLEO-G474RE: the files of `firmware/nucleo-g474/src/wiring`, from the other side.

use super::{AxisWiring, BenchWiring, SwitchWiring};
use crate::pin::Pin;
use crate::unit::{SpiId, UartId};

const A: usize = 0;
const B: usize = 16;
const C: usize = 32;

impl BenchWiring {
    /// The wiring of the firmware as it is delivered, with two axes (`docs/firmware.md`): home switches close at home, limits
    /// and emergency stop open when operated.
    #[must_use]
    pub fn nucleo_g474() -> Self {
        Self::with(two_axes())
    }

    /// The wiring of the firmware for this number of axes; `None` where there is none.
    #[must_use]
    pub fn nucleo_g474_of(axes: usize) -> Option<Self> {
        Some(Self::with(match axes {
            1 => one_axis(),
            2 => two_axes(),
            3 => three_axes(),
            _ => return None,
        }))
    }

    /// The wiring of a robot: servos on their bus, and none of the stages' lines.
    #[must_use]
    pub fn nucleo_g474_robot() -> Self {
        Self::with(Vec::new())
    }

    fn with(axes: Vec<AxisWiring>) -> Self {
        Self {
            axes,
            drivers_off: Pin::at(A + 10),
            holding: Pin::at(B + 5),
            emergency_stop: switch(C + 4, true),
            camera_trigger: Pin::at(B + 6),
            driver_line: UartId::UART4,
            servo_bus: UartId::USART3,
            encoder_bus: SpiId::SPI1,
        }
    }
}

fn one_axis() -> Vec<AxisWiring> {
    vec![first()]
}

/// The baseline of a board with one axis or two.
fn first() -> AxisWiring {
    axis([A + 8, A + 9], [A, A + 1], [C, C + 2], Some([B + 11, B]))
}

fn two_axes() -> Vec<AxisWiring> {
    vec![first(), axis([C + 6, C + 8], [B + 2, C + 12], [C + 1, C + 3], Some([B + 12, A + 4]))]
}

fn three_axes() -> Vec<AxisWiring> {
    vec![
        axis([A + 8, A + 9], [A + 15, A + 1], [C, C + 2], Some([B + 11, B])),
        axis([C + 6, C + 8], [A, C + 12], [C + 1, C + 3], Some([B + 12, A + 4])),
        axis([B + 2, C + 9], [B + 4, C + 7], [B + 1, C + 5], None),
    ]
}

/// An axis with its step and direction pins, the lines of its encoder, home switch and hard limit, and where it has them its index
/// line and the line that selects its absolute encoder.
fn axis(
    [step, direction]: [usize; 2],
    encoder: [usize; 2],
    [home, hard_limit]: [usize; 2],
    more: Option<[usize; 2]>,
) -> AxisWiring {
    AxisWiring {
        step: Pin::at(step),
        direction: Pin::at(direction),
        encoder: encoder.map(Pin::at),
        home: switch(home, false),
        hard_limit: switch(hard_limit, true),
        index: more.map(|[index, _]| Pin::at(index)),
        select: more.map(|[_, select]| Pin::at(select)),
    }
}

fn switch(index: usize, normally_closed: bool) -> SwitchWiring {
    SwitchWiring { pin: Pin::at(index), normally_closed }
}
