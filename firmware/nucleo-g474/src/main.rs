//! The controller on a NUCLEO-G474RE: pins, timers, interrupts, link, flash and log around [`vergence_control::Node`].
//!
//! Four levels of urgency: the short interrupts of trigger edge, time, DMA and serial line; below them the node with its
//! 1 kHz tick ([`control`]); below that the bus of a robot's servos ([`joints`]); below that the executor's tasks ([`link`], [`planning`], [`drivers`], [`watchdog`]).
//!
//! Imports go one way: this file starts everything; [`board`] hands out the pins; [`link`] and [`control`] exchange bytes
//! through [`exchange`] and do not know each other; [`control`] gets its plans through [`planning`].

#![no_std]
#![no_main]

mod absolute;
mod board;
mod control;
mod drivers;
mod dying;
mod encoder;
mod exchange;
mod factory;
mod index_lines;
mod joints;
mod link;
mod log;
mod memory;
mod planning;
mod receiver;
mod rig;
mod steps;
mod trigger;
mod version;
mod watchdog;

#[cfg(all(feature = "one-axis", feature = "three-axes"))]
compile_error!("a board has one wiring: choose one of the features one-axis and three-axes, or none for two axes");

#[cfg_attr(feature = "one-axis", path = "wiring/one_axis.rs")]
#[cfg_attr(feature = "three-axes", path = "wiring/three_axes.rs")]
#[cfg_attr(not(any(feature = "one-axis", feature = "three-axes")), path = "wiring/two_axes.rs")]
mod wiring;

use board::Board;
use embassy_executor::Spawner;
use embassy_stm32::pac::{TIM15, timer::vals::Urs};
use static_cell::StaticCell;
use vergence_control::{BoardSettings, Delivered, Node, NodeIdentity};
use vergence_image::DeathKind;
use vergence_image::layout::HARDWARE;
use vergence_nucleo_common::Services;
use vergence_nucleo_common::clocks::{self, Source};
use vergence_nucleo_common::memory::survivor;

/// Makes the settings that the board is delivered with in their place.
#[inline(never)]
fn placed_settings() -> &'static Delivered {
    static PLACE: StaticCell<Delivered> = StaticCell::new();
    let Ok(bench) = BoardSettings::new(&factory::axes()) else { dying::give_up(DeathKind::Settings) };
    PLACE.init(Delivered::for_bench(bench))
}

/// Makes the node in the memory beside the stack's. Neither this nor the settings are parts of `main`, whose frame would hold several copies of both at a
/// time: 64 kB of stack, more than there is.
#[inline(never)]
fn placed_node(
    settings: &'static Delivered,
    identity: NodeIdentity,
    boot: u32,
    services: &mut Services,
) -> &'static mut Node {
    match Node::new(settings, identity, boot, services) {
        Ok(node) => memory::keep_node(node),
        Err(_) => dying::give_up(DeathKind::Settings),
    }
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    let reset = memory::reset_cause();
    let board = Board::new(clocks::start(Source::Crystal));
    count_microseconds();
    let watchdog = watchdog::start(board.watchdog);
    let identity = NodeIdentity {
        board: board::NAME.try_into().unwrap_or_default(),
        hardware: HARDWARE,
        firmware: version::version(),
        oldest: version::oldest(),
        build: version::build_id(),
        uid: embassy_stm32::uid::uid(),
        reset,
    };
    log::greet(&identity);
    let mut services = Services::of_application(&board.flash, memory::take_defaults_wanted());
    let boot = board::random(board.random).unwrap_or_else(|| survivor().starts);
    let node = placed_node(placed_settings(), identity, boot, &mut services);
    let Some((rx, tx)) = board.line.open(node.baud()) else { dying::give_up(DeathKind::SerialLine) };
    board.servo_bus.start();
    control::start(node, board.rig, services, board.tick);
    if let (Ok(receive), Ok(transmit), Ok(plan), Ok(watch), Ok(supervise), Ok(keep_going)) = (
        link::receive(rx),
        link::transmit(tx),
        planning::plan(planning::planner()),
        watchdog::watch(watchdog, board.led),
        drivers::supervise(board.driver_line),
        joints::keep_going(),
    ) {
        spawner.spawn(receive);
        spawner.spawn(transmit);
        spawner.spawn(plan);
        spawner.spawn(watch);
        spawner.spawn(supervise);
        spawner.spawn(keep_going);
    }
}

/// Sets the timer of the executor's time to microseconds: its driver computed the prescaler for half the speed of the buses
/// ([`clocks::start`]). Nobody has asked for the time yet.
fn count_microseconds() {
    let half = TIM15.psc().read();
    TIM15.psc().write_value(2 * half + 1);
    // An update takes the prescaler over; it must not count as the end of a period.
    TIM15.cr1().modify(|w| w.set_urs(Urs::COUNTER_ONLY));
    TIM15.egr().write(|w| w.set_ug(true));
    TIM15.cr1().modify(|w| w.set_urs(Urs::ANY_EVENT));
}
