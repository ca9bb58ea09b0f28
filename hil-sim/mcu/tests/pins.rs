//! GPIO, EXTI and pin routing (RM0440 §9, §10, §15).
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

mod common;

use common::{GPIOA, GPIOC, RCC, Recorder, bench, bench_with, pin};
use vergence_mcu::{Drive, Pin};

const SYSCFG: u32 = 0x4001_0000;
const EXTI: u32 = 0x4001_0400;

#[test]
fn pins_have_names() {
    assert_eq!(pin("PA0").to_string(), "PA0");
    assert_eq!(pin("PG15").to_string(), "PG15");
    for wrong in ["PA16", "PH0", "A1", "P", "PA", ""] {
        assert_eq!(Pin::named(wrong), None, "{wrong}");
    }
}

#[test]
fn ports_wake_up_as_the_manual_says() {
    let mut bench = bench();
    // §9.4.1, §9.4.3, §9.4.4: the debug pins are in use.
    assert_eq!([0, 8, 0xC].map(|register| bench.read(GPIOA + register)), [0xABFF_FFFF, 0x0C00_0000, 0x6400_0000]);
    assert_eq!(bench.read(GPIOC), 0xFFFF_FFFF);
}

#[test]
fn outputs_follow_bit_set_and_reset() {
    let mut bench = bench_with(Recorder { pins: vec![pin("PA5")], ..Recorder::default() });
    bench.modify(GPIOA, 3 << 10, 1 << 10);
    bench.write(GPIOA + 0x18, 1 << 5);
    bench.wait(7);
    // Setting wins over resetting.
    bench.write(GPIOA + 0x18, 1 << 5 | 1 << 21);
    assert_eq!(bench.read(GPIOA + 0x14), 1 << 5);
    assert_eq!(bench.read(GPIOA + 0x10) >> 5 & 1, 1);
    bench.write(GPIOA + 0x28, 1 << 5);
    let edges: Vec<_> = bench.chip.world().edges.iter().map(|edge| (edge.at.cycle, edge.high)).collect();
    assert_eq!(edges, [(0, true), (7, false)]);
}

#[test]
fn pull_ups_and_open_drains() {
    let mut bench = bench();
    bench.write(GPIOC, 0xFFFF_FFFC);
    assert_eq!(bench.read(GPIOC + 0x10) & 1, 0, "floating reads low in the model");
    bench.write(GPIOC + 0xC, 1);
    assert_eq!(bench.read(GPIOC + 0x10) & 1, 1);
    bench.chip.drive(pin("PC0"), Drive::Low);
    assert_eq!(bench.read(GPIOC + 0x10) & 1, 0);
    bench.chip.drive(pin("PC0"), Drive::Floating);
    bench.write(GPIOC + 4, 1);
    bench.write(GPIOC, 0xFFFF_FFFD);
    assert_eq!(bench.read(GPIOC + 0x10) & 1, 0, "an open drain pulls low");
    bench.write(GPIOC + 0x18, 1);
    assert_eq!(bench.read(GPIOC + 0x10) & 1, 1, "or lets go");
}

#[test]
fn a_chosen_edge_raises_its_interrupt() {
    let mut bench = bench();
    bench.write(GPIOC, !(3 << 26));
    bench.drive("PC13", true);
    // EXTI13 listens to port C, falling edges.
    bench.write(SYSCFG + 0x14, 2 << 4);
    bench.write(EXTI + 0xC, 1 << 13);
    bench.modify(EXTI, 0, 1 << 13);
    assert!(!bench.line(40));
    bench.drive("PC13", false);
    assert!(bench.line(40), "EXTI15_10");
    bench.write(EXTI + 0x14, 1 << 13);
    assert!(!bench.line(40));
    bench.drive("PC13", true);
    assert!(!bench.line(40), "rising edges are not chosen");
    bench.write(EXTI + 0x10, 1 << 13);
    assert!(bench.line(40), "by software");
}

#[test]
fn a_level_from_outside_outlives_a_reset() {
    let mut bench = bench();
    bench.drive("PC1", true);
    bench.chip.reset(bench.now, vergence_mcu::ResetCause::Software);
    bench.write(RCC + 0x4C, 4);
    bench.write(GPIOC, 0xFFFF_FFF3);
    assert_eq!(bench.read(GPIOC + 0x10), 2);
}

#[test]
fn masked_edges_stay_pending() {
    let mut bench = bench();
    bench.write(GPIOA, 0xFFFF_FFFC);
    bench.write(EXTI + 8, 1);
    bench.drive("PA0", true);
    assert!(!bench.line(6));
    assert_eq!(bench.read(EXTI + 0x14), 1);
    bench.modify(EXTI, 0, 1);
    assert!(bench.line(6));
}
