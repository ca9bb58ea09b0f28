//! The controller on a NUCLEO-G474RE: pins, timers, interrupts, link, flash and log around [`vergence_control::Node`].
//!
//! Three levels of urgency: the interrupts of drivers (trigger edge, time, DMA, serial line), which are short; below
//! them the node with its one kilohertz tick ([`control`]); below that the executor's tasks ([`link`], [`watchdog`]).

#![no_std]
#![no_main]

mod board;
mod control;
mod encoder;
mod factory;
mod link;
mod log;
mod memory;
mod rig;
mod steps;
mod trigger;
mod watchdog;

use board::Board;
use embassy_executor::Spawner;
use vergence_control::{Controller, Node, NodeIdentity};

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let reset = memory::reset_cause();
    let mut board = Board::new(embassy_stm32::init(board::clocks()));
    board.watchdog.unleash();
    let identity = NodeIdentity {
        board: board::NAME.try_into().unwrap_or_default(),
        firmware: version(),
        build: memory::build_id(),
        uid: embassy_stm32::uid::uid(),
        reset,
    };
    log::greet(&identity);
    let boot = board.random.next_u32();
    let Ok(controller) = Controller::new(&factory::axes()) else { panic!("factory settings") };
    control::start(Node::new(controller, identity, boot), board.rig, board.tick);
    let Some((rx, tx)) = board.line.open(board::BAUD) else { panic!("serial line") };
    if let (Ok(receive), Ok(transmit), Ok(watch)) =
        (link::receive(rx), link::transmit(tx), watchdog::watch(board.watchdog, board.led))
    {
        spawner.spawn(receive);
        spawner.spawn(transmit);
        spawner.spawn(watch);
    }
}

/// The package's version.
const fn version() -> [u8; 3] {
    [
        part(env!("CARGO_PKG_VERSION_MAJOR")),
        part(env!("CARGO_PKG_VERSION_MINOR")),
        part(env!("CARGO_PKG_VERSION_PATCH")),
    ]
}

const fn part(digits: &str) -> u8 {
    let (mut value, mut rest) = (0, digits.as_bytes());
    while let [digit, after @ ..] = rest {
        value = value * 10 + (*digit - b'0');
        rest = after;
    }
    value
}
