//! Alternate functions of the pins (DS12288 table 13, 64-pin package), for timers, serial ports and SPI.

use crate::pin::{Pin, Signal};
use crate::unit::{SpiId, TimerId, UartId};

/// The peripheral signal that alternate function `number` connects `pin` to; `None` where the model has none.
pub(crate) fn alternate_function(pin: Pin, number: u8) -> Option<Signal> {
    let (_, functions) = TABLE.iter().find(|(row, _)| *row == pin.index())?;
    functions.iter().find(|(function, _)| *function == number).map(|&(_, signal)| signal)
}

#[allow(clippy::panic, reason = "the compiler evaluates it")]
const fn timer(number: u8) -> TimerId {
    match TimerId::new(number) {
        Some(timer) => timer,
        None => panic!("no such timer"),
    }
}

const fn channel(number: u8, channel: u8) -> Signal {
    Signal::Channel(timer(number), channel - 1)
}

const fn complement(number: u8, channel: u8) -> Signal {
    Signal::Complement(timer(number), channel - 1)
}

const fn external(number: u8) -> Signal {
    Signal::External(timer(number))
}

const fn pin(port: u8, number: usize) -> usize {
    (port - b'A') as usize * 16 + number
}

/// Pins, and their alternate functions.
const TABLE: &[(usize, &[(u8, Signal)])] = &[
    (pin(b'A', 0), &[(1, channel(2, 1)), (2, channel(5, 1)), (10, external(8)), (14, external(2))]),
    (
        pin(b'A', 1),
        &[(1, channel(2, 2)), (2, channel(5, 2)), (7, Signal::DriverEnable(UartId::USART2)), (9, complement(15, 1))],
    ),
    (
        pin(b'A', 2),
        &[
            (1, channel(2, 3)),
            (2, channel(5, 3)),
            (7, Signal::Transmit(UartId::USART2)),
            (9, channel(15, 1)),
            (12, Signal::Transmit(UartId::LPUART1)),
        ],
    ),
    (
        pin(b'A', 3),
        &[
            (1, channel(2, 4)),
            (2, channel(5, 4)),
            (7, Signal::Receive(UartId::USART2)),
            (9, channel(15, 2)),
            (12, Signal::Receive(UartId::LPUART1)),
        ],
    ),
    (pin(b'A', 4), &[(2, channel(3, 2))]),
    (pin(b'A', 5), &[(1, channel(2, 1)), (2, external(2)), (5, Signal::SpiClock(SpiId::SPI1))]),
    (pin(b'A', 6), &[(1, channel(16, 1)), (2, channel(3, 1)), (5, Signal::SpiIn(SpiId::SPI1))]),
    (
        pin(b'A', 7),
        &[
            (1, channel(17, 1)),
            (2, channel(3, 2)),
            (4, complement(8, 1)),
            (5, Signal::SpiOut(SpiId::SPI1)),
            (6, complement(1, 1)),
        ],
    ),
    (pin(b'A', 8), &[(6, channel(1, 1)), (10, external(4))]),
    (pin(b'A', 9), &[(6, channel(1, 2)), (7, Signal::Transmit(UartId::USART1)), (10, channel(2, 3))]),
    (
        pin(b'A', 10),
        &[
            (5, Signal::SpiIn(SpiId::SPI2)),
            (6, channel(1, 3)),
            (7, Signal::Receive(UartId::USART1)),
            (10, channel(2, 4)),
        ],
    ),
    (
        pin(b'A', 11),
        &[(5, Signal::SpiOut(SpiId::SPI2)), (6, complement(1, 1)), (10, channel(4, 1)), (11, channel(1, 4))],
    ),
    (
        pin(b'A', 12),
        &[
            (1, channel(16, 1)),
            (6, complement(1, 2)),
            (7, Signal::DriverEnable(UartId::USART1)),
            (10, channel(4, 2)),
            (11, external(1)),
        ],
    ),
    (pin(b'A', 13), &[(1, complement(16, 1)), (10, channel(4, 3))]),
    (pin(b'A', 14), &[(5, channel(8, 2)), (7, Signal::Transmit(UartId::USART2))]),
    (
        pin(b'A', 15),
        &[
            (1, channel(2, 1)),
            (2, channel(8, 1)),
            (7, Signal::Receive(UartId::USART2)),
            (8, Signal::DriverEnable(UartId::UART4)),
            (14, external(2)),
        ],
    ),
    (pin(b'B', 0), &[(2, channel(3, 3)), (4, complement(8, 2)), (6, complement(1, 2))]),
    (
        pin(b'B', 1),
        &[
            (2, channel(3, 4)),
            (4, complement(8, 3)),
            (6, complement(1, 3)),
            (12, Signal::DriverEnable(UartId::LPUART1)),
        ],
    ),
    (pin(b'B', 2), &[(2, channel(5, 1)), (3, channel(20, 1))]),
    (
        pin(b'B', 3),
        &[
            (1, channel(2, 2)),
            (2, external(4)),
            (4, complement(8, 1)),
            (5, Signal::SpiClock(SpiId::SPI1)),
            (6, Signal::SpiClock(SpiId::SPI3)),
            (7, Signal::Transmit(UartId::USART2)),
            (10, external(3)),
        ],
    ),
    (
        pin(b'B', 4),
        &[
            (1, channel(16, 1)),
            (2, channel(3, 1)),
            (4, complement(8, 2)),
            (5, Signal::SpiIn(SpiId::SPI1)),
            (6, Signal::SpiIn(SpiId::SPI3)),
            (7, Signal::Receive(UartId::USART2)),
            (8, Signal::DriverEnable(UartId::UART5)),
        ],
    ),
    (
        pin(b'B', 5),
        &[
            (2, channel(3, 2)),
            (3, complement(8, 3)),
            (5, Signal::SpiOut(SpiId::SPI1)),
            (6, Signal::SpiOut(SpiId::SPI3)),
            (10, channel(17, 1)),
        ],
    ),
    (
        pin(b'B', 6),
        &[
            (1, complement(16, 1)),
            (2, channel(4, 1)),
            (5, channel(8, 1)),
            (6, external(8)),
            (7, Signal::Transmit(UartId::USART1)),
        ],
    ),
    (
        pin(b'B', 7),
        &[(1, complement(17, 1)), (2, channel(4, 2)), (7, Signal::Receive(UartId::USART1)), (10, channel(3, 4))],
    ),
    (
        pin(b'B', 8),
        &[(1, channel(16, 1)), (2, channel(4, 3)), (7, Signal::Receive(UartId::USART3)), (10, channel(8, 2))],
    ),
    (
        pin(b'B', 9),
        &[
            (1, channel(17, 1)),
            (2, channel(4, 4)),
            (7, Signal::Transmit(UartId::USART3)),
            (10, channel(8, 3)),
            (12, complement(1, 3)),
        ],
    ),
    (
        pin(b'B', 10),
        &[(1, channel(2, 3)), (7, Signal::Transmit(UartId::USART3)), (8, Signal::Receive(UartId::LPUART1))],
    ),
    (
        pin(b'B', 11),
        &[(1, channel(2, 4)), (7, Signal::Receive(UartId::USART3)), (8, Signal::Transmit(UartId::LPUART1))],
    ),
    (pin(b'B', 12), &[(2, external(5)), (8, Signal::DriverEnable(UartId::LPUART1))]),
    (pin(b'B', 13), &[(5, Signal::SpiClock(SpiId::SPI2)), (6, complement(1, 1))]),
    (
        pin(b'B', 14),
        &[
            (1, channel(15, 1)),
            (5, Signal::SpiIn(SpiId::SPI2)),
            (6, complement(1, 2)),
            (7, Signal::DriverEnable(UartId::USART3)),
        ],
    ),
    (
        pin(b'B', 15),
        &[(1, channel(15, 2)), (2, complement(15, 1)), (4, complement(1, 3)), (5, Signal::SpiOut(SpiId::SPI2))],
    ),
    (pin(b'C', 0), &[(2, channel(1, 1)), (8, Signal::Receive(UartId::LPUART1))]),
    (pin(b'C', 1), &[(2, channel(1, 2)), (8, Signal::Transmit(UartId::LPUART1))]),
    (pin(b'C', 2), &[(2, channel(1, 3)), (6, channel(20, 2))]),
    (pin(b'C', 3), &[(2, channel(1, 4))]),
    (pin(b'C', 4), &[(2, external(1)), (7, Signal::Transmit(UartId::USART1))]),
    (pin(b'C', 5), &[(6, complement(1, 4)), (7, Signal::Receive(UartId::USART1))]),
    (pin(b'C', 6), &[(2, channel(3, 1)), (4, channel(8, 1))]),
    (pin(b'C', 7), &[(2, channel(3, 2)), (4, channel(8, 2))]),
    (pin(b'C', 8), &[(2, channel(3, 3)), (4, channel(8, 3)), (6, channel(20, 3))]),
    (pin(b'C', 9), &[(2, channel(3, 4)), (4, channel(8, 4))]),
    (
        pin(b'C', 10),
        &[
            (4, complement(8, 1)),
            (5, Signal::Transmit(UartId::UART4)),
            (6, Signal::SpiClock(SpiId::SPI3)),
            (7, Signal::Transmit(UartId::USART3)),
        ],
    ),
    (
        pin(b'C', 11),
        &[
            (4, complement(8, 2)),
            (5, Signal::Receive(UartId::UART4)),
            (6, Signal::SpiIn(SpiId::SPI3)),
            (7, Signal::Receive(UartId::USART3)),
        ],
    ),
    (
        pin(b'C', 12),
        &[
            (1, channel(5, 2)),
            (4, complement(8, 3)),
            (5, Signal::Transmit(UartId::UART5)),
            (6, Signal::SpiOut(SpiId::SPI3)),
        ],
    ),
    (pin(b'C', 13), &[(4, complement(1, 1)), (6, complement(8, 4))]),
    (pin(b'D', 2), &[(2, external(3)), (5, Signal::Receive(UartId::UART5))]),
    (pin(b'F', 0), &[(6, complement(1, 3))]),
    (pin(b'F', 1), &[(5, Signal::SpiClock(SpiId::SPI2))]),
];
