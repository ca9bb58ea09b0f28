//! TIM: quadrature, filters, captures, timers that trigger each other (RM0440 §28 to §31). All at 16 MHz.
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

mod common;

use common::timer::*;
use common::{Bench, TIM1, TIM2, TIM3, bench};
use vergence_mcu::Nothing;

/// TIM3 as an encoder on PA6 and PA7.
fn encoder(mode: u32) -> Bench<Nothing> {
    let mut bench = bench();
    bench.connect("PA6", 2);
    bench.connect("PA7", 2);
    bench.write(TIM3 + CCMR1, 0x0101);
    bench.write(TIM3 + SMCR, mode);
    bench.write(TIM3 + CR1, CEN);
    bench
}

fn turn(bench: &mut Bench<Nothing>, quarters: i32) {
    const GRAY: [(bool, bool); 4] = [(false, false), (true, false), (true, true), (false, true)];
    let mut phase = 0i32;
    for _ in 0..quarters.abs() {
        phase += quarters.signum();
        let (a, b) = GRAY[phase.rem_euclid(4) as usize];
        bench.drive("PA6", a);
        bench.drive("PA7", b);
        bench.wait(10);
    }
}

#[test]
fn quadrature_follows_the_manuals_table() {
    // All edges in mode 3, half of them in modes 1 and 2; up while TI1 leads.
    for (mode, forward, backward) in [(3, 40, -40), (1, 20, -20), (2, 20, -20)] {
        let mut bench = encoder(mode);
        turn(&mut bench, 40);
        assert_eq!(bench.read(TIM3 + CNT), forward as u32);
        assert_eq!(bench.read(TIM3 + CR1) & DOWN, 0);
        turn(&mut bench, -40);
        assert_eq!(bench.read(TIM3 + CNT), 0);
        turn(&mut bench, -40);
        assert_eq!(bench.read(TIM3 + CNT), (0x1_0000 + backward) as u32);
        assert_eq!(bench.read(TIM3 + CR1) & DOWN, DOWN);
        assert_eq!(bench.read(TIM3 + SR) & 1, 1, "an underflow is an update");
    }
}

#[test]
fn an_inverted_phase_turns_the_direction() {
    let mut bench = encoder(3);
    bench.write(TIM3 + CCER, 2);
    turn(&mut bench, 40);
    assert_eq!(bench.read(TIM3 + CNT), 0x1_0000 - 40);
}

#[test]
fn the_filter_swallows_short_pulses() {
    // IC1F = IC2F = 3: eight samples at the timer's clock.
    let mut bench = encoder(3);
    bench.write(TIM3 + CCMR1, 0x3131);
    bench.drive("PA6", true);
    bench.wait(7);
    bench.drive("PA6", false);
    bench.wait(100);
    assert_eq!(bench.read(TIM3 + CNT), 0);
    bench.drive("PA6", true);
    bench.wait(7);
    assert_eq!(bench.read(TIM3 + CNT), 0);
    bench.wait(1);
    assert_eq!(bench.read(TIM3 + CNT), 1);
}

#[test]
fn captures_the_count_and_flags_what_was_missed() {
    let mut bench = bench();
    bench.connect("PA0", 1);
    bench.write(TIM2 + CCMR1, 1);
    bench.write(TIM2 + CCER, 1);
    bench.write(TIM2 + CR1, CEN);
    bench.wait(101);
    bench.drive("PA0", true);
    assert_eq!(bench.read(TIM2 + SR) & 0x202, 2);
    bench.wait(50);
    bench.drive("PA0", false);
    assert_eq!(bench.read(TIM2 + CCR1), 100, "only rising edges are captured");
    assert_eq!(bench.read(TIM2 + SR) & 0x202, 0, "reading CCR1 clears the flag");
    for _ in 0..2 {
        bench.drive("PA0", true);
        bench.wait(10);
        bench.drive("PA0", false);
    }
    assert_eq!(bench.read(TIM2 + SR) & 0x202, 0x202, "the second capture came before the first was read");
    assert_eq!(bench.read(TIM2 + CCR1), 160);
}

#[test]
fn one_timer_counts_the_periods_of_another() {
    let mut bench = bench();
    // TIM1 sends a trigger at each update, TIM2 counts ITR0, which is TIM1.
    bench.write(TIM1 + CR2, 2 << 4);
    bench.write(TIM1 + ARR, 9);
    bench.write(TIM2 + SMCR, 7);
    bench.write(TIM2 + CR1, CEN);
    bench.write(TIM1 + CR1, CEN);
    bench.wait(1_001);
    assert_eq!(bench.read(TIM2 + CNT), 100);
}

#[test]
fn a_trigger_starts_or_resets_a_timer() {
    let mut bench = bench();
    bench.connect("PA0", 1);
    // Slave mode trigger on TI1FP1.
    bench.write(TIM2 + CCMR1, 1);
    bench.write(TIM2 + SMCR, 6 | 5 << 4);
    bench.wait(10);
    assert_eq!(bench.read(TIM2 + CR1), 0);
    bench.drive("PA0", true);
    assert_eq!(bench.read(TIM2 + CR1), CEN);
    bench.wait(21);
    assert_eq!(bench.read(TIM2 + CNT), 20);
    bench.drive("PA0", false);
    bench.write(TIM2 + SMCR, 4 | 5 << 4);
    bench.drive("PA0", true);
    assert_eq!(bench.read(TIM2 + CNT), 0);
}
