//! TIM: counts, updates, outputs (RM0440 §28 to §31). All at 16 MHz.
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

mod common;

use common::timer::*;
use common::{Bench, Recorder, TIM1, TIM3, TIM15, bench, bench_with, pin};
use proptest::prelude::*;
use vergence_cpu::{Bus, NEVER};
use vergence_mcu::Nothing;

/// TIM1 with its first channel on PA8, which is observed.
fn pulses() -> Bench<Recorder> {
    let mut bench = bench_with(Recorder { pins: vec![pin("PA8")], ..Recorder::default() });
    bench.connect("PA8", 6);
    bench.write(TIM1 + BDTR, MOE);
    bench
}

/// Edges since `begin`: cycles and levels.
fn edges(bench: &Bench<Recorder>, begin: u64) -> Vec<(u64, bool)> {
    let edges = bench.chip.world().edges.iter();
    edges.filter(|edge| edge.at.cycle >= begin).map(|edge| (edge.at.cycle - begin, edge.high)).collect()
}

/// A timer keeps a request that its DMA channel does not serve, because the channel was switched off: it is served when the
/// channel is switched on again, unless the timer's enable was withdrawn meanwhile.
#[test]
fn a_dma_request_that_was_pending_at_an_abort_is_served_later_unless_it_is_withdrawn() {
    const CHANNEL: u32 = 0x4002_0008;
    const RAM: u32 = 0x2000_0000;
    /// On, from memory, memory increments, half words to words.
    const ON: u32 = 1 | 1 << 4 | 1 << 7 | 1 << 10 | 2 << 8;
    for (withdrawn, left, reload) in [(false, 1, 111), (true, 2, 9_999)] {
        let mut bench = bench();
        bench.write(RAM, 222 << 16 | 111);
        // TIM1_CH1 to channel 1 of DMA1.
        bench.write(0x4002_0800, 42);
        bench.write(CHANNEL + 4, 2);
        bench.write(CHANNEL + 8, TIM1 + ARR);
        bench.write(CHANNEL + 12, RAM);
        bench.write(TIM1 + ARR, 9_999);
        bench.write(TIM1 + DIER, 1 << 9);
        // The compare event of channel 1, while the DMA channel is off.
        bench.write(TIM1 + EGR, 1 << 1);
        if withdrawn {
            bench.write(TIM1 + DIER, 0);
            bench.write(TIM1 + DIER, 1 << 9);
        }
        bench.write(CHANNEL, ON);
        bench.wait(20);
        assert_eq!((bench.read(CHANNEL + 4), bench.read(TIM1 + ARR)), (left, reload), "withdrawn: {withdrawn}");
    }
}

#[test]
fn counts_one_clock_after_its_start_through_the_prescaler() {
    let mut bench = bench();
    bench.write(TIM3 + PSC, 3);
    bench.write(TIM3 + EGR, 1);
    bench.write(TIM3 + CR1, CEN);
    bench.wait(4);
    assert_eq!(bench.read(TIM3 + CNT), 0, "the first count lasts one clock longer (§29.4.2)");
    bench.wait(1);
    assert_eq!(bench.read(TIM3 + CNT), 1);
    bench.wait(4 * 99);
    assert_eq!(bench.read(TIM3 + CNT), 100);
    bench.write(TIM3 + CR1, 0);
    bench.wait(1_000);
    assert_eq!(bench.read(TIM3 + CNT), 100);
}

#[test]
fn the_prescaler_waits_for_the_update() {
    let mut bench = bench();
    bench.write(TIM3 + ARR, 9);
    bench.write(TIM3 + CR1, CEN);
    bench.write(TIM3 + PSC, 1);
    bench.wait(11);
    assert_eq!((bench.read(TIM3 + CNT), bench.read(TIM3 + SR) & 1), (0, 1), "ten counts of one clock");
    bench.wait(19);
    assert_eq!(bench.read(TIM3 + CNT), 9, "from here on a count takes two");
}

#[test]
fn the_reload_value_is_preloaded_on_request() {
    for (preload, wraps_after) in [(0, 6), (ARPE, 11)] {
        let mut bench = bench();
        bench.write(TIM3 + ARR, 9);
        bench.write(TIM3 + EGR, 1);
        bench.write(TIM3 + SR, 0);
        bench.write(TIM3 + CR1, CEN | preload);
        bench.write(TIM3 + ARR, 4);
        bench.wait(wraps_after - 1);
        assert_eq!(bench.read(TIM3 + SR) & 1, 0);
        bench.wait(1);
        assert_eq!(bench.read(TIM3 + SR) & 1, 1);
    }
}

#[test]
fn software_updates_set_the_flag_unless_urs() {
    let mut bench = bench();
    bench.write(TIM3 + CR1, 4);
    bench.write(TIM3 + EGR, 1);
    assert_eq!(bench.read(TIM3 + SR), 1 << 1 | 1 << 2 | 1 << 3 | 1 << 4, "compare values of zero match, no update");
    bench.write(TIM3 + CR1, 0);
    bench.write(TIM3 + EGR, 1);
    assert_eq!(bench.read(TIM3 + SR) & 1, 1);
}

#[test]
fn interrupts_come_at_their_cycle_and_on_their_line() {
    let mut bench = bench();
    bench.write(TIM15 + ARR, 999);
    bench.write(TIM15 + CCR1, 500);
    bench.write(TIM15 + DIER, 3);
    bench.write(TIM15 + SR, 0);
    let begin = bench.now;
    bench.write(TIM15 + CR1, CEN);
    assert_eq!(bench.chip.next_event(), begin + 501);
    bench.wait(501);
    assert!(bench.line(24), "TIM1_BRK_TIM15");
    bench.write(TIM15 + SR, 0);
    assert!(!bench.line(24));
    assert_eq!(bench.chip.next_event(), begin + 1_001);
    bench.wait(500);
    assert_eq!(bench.read(TIM15 + SR) & 3, 1);
    assert!(bench.line(24));
}

#[test]
fn nobody_who_looks_means_no_events() {
    let mut bench = bench();
    bench.connect("PA8", 6);
    bench.write(TIM1 + BDTR, MOE);
    bench.write(TIM1 + ARR, 99);
    bench.write(TIM1 + CCR1, 50);
    bench.write(TIM1 + CCMR1, PWM_1);
    bench.write(TIM1 + CCER, 1);
    bench.write(TIM1 + CR1, CEN);
    assert_eq!(bench.chip.next_event(), NEVER);
}

#[test]
fn pwm_follows_the_manuals_figure() {
    // §28.3.11: ARR = 8, CCR = 4: active for four counts of nine in mode 1, the rest in mode 2.
    for (mode, first) in [(PWM_1, true), (PWM_2, false)] {
        let mut bench = pulses();
        bench.write(TIM1 + ARR, 8);
        bench.write(TIM1 + CCR1, 4);
        bench.write(TIM1 + CCMR1, mode);
        bench.write(TIM1 + EGR, 1);
        bench.write(TIM1 + CCER, 1);
        let begin = bench.now + 1;
        bench.write(TIM1 + CR1, CEN);
        bench.wait(28);
        assert_eq!(
            edges(&bench, begin),
            [(4, !first), (9, first), (13, !first), (18, first), (22, !first), (27, first)]
        );
    }
}

#[test]
fn toggles_on_each_match() {
    let mut bench = pulses();
    bench.write(TIM1 + ARR, 9);
    bench.write(TIM1 + CCR1, 3);
    bench.write(TIM1 + CCMR1, TOGGLE);
    bench.write(TIM1 + CCER, 1);
    let begin = bench.now + 1;
    bench.write(TIM1 + CR1, CEN);
    bench.wait(30);
    assert_eq!(edges(&bench, begin), [(3, true), (13, false), (23, true)]);
}

#[test]
fn one_pulse_mode_with_repetition_makes_exactly_so_many_pulses() {
    let mut bench = pulses();
    bench.write(TIM1 + ARR, 99);
    bench.write(TIM1 + CCR1, 60);
    bench.write(TIM1 + CCMR1, PWM_2);
    bench.write(TIM1 + CCER, 1);
    bench.write(TIM1 + RCR, 299);
    bench.write(TIM1 + EGR, 1);
    let begin = bench.now + 1;
    bench.write(TIM1 + CR1, CEN | OPM);
    bench.wait(100_000);
    let expected: Vec<_> =
        (0..300).flat_map(|period| [(100 * period + 60, true), (100 * period + 100, false)]).collect();
    assert_eq!(edges(&bench, begin), expected);
    assert_eq!(bench.read(TIM1 + CR1), OPM, "the timer has stopped by itself");
}

#[test]
fn counting_down_the_pulse_ends_the_period() {
    // §28.3.11: down-counting, PWM mode 1 is active while CNT <= CCR; the period reloads from ARR.
    let mut bench = pulses();
    bench.write(TIM1 + CR1, DOWN | OPM);
    bench.write(TIM1 + ARR, 99);
    bench.write(TIM1 + CCR1, 24);
    bench.write(TIM1 + CCMR1, PWM_1);
    bench.write(TIM1 + RCR, 1);
    bench.write(TIM1 + EGR, 1);
    assert_eq!(bench.read(TIM1 + CNT), 99);
    bench.write(TIM1 + CCER, 1);
    bench.write(TIM1 + SR, 0);
    let begin = bench.now + 1;
    bench.write(TIM1 + CR1, CEN | DOWN | OPM);
    bench.wait(40);
    // The next period is longer.
    bench.write(TIM1 + ARR, 199);
    bench.wait(1_000);
    assert_eq!(edges(&bench, begin), [(75, true), (100, false), (275, true), (300, false)]);
    assert_eq!(bench.read(TIM1 + CR1), DOWN | OPM);
    assert_eq!(bench.read(TIM1 + SR) & 3, 3);
}

#[test]
fn without_the_main_switch_nothing_is_driven() {
    let mut bench = pulses();
    bench.write(TIM1 + ARR, 99);
    bench.write(TIM1 + CCR1, 50);
    bench.write(TIM1 + CCMR1, PWM_1);
    bench.write(TIM1 + CCER, 1);
    assert!(bench.chip.is_high(pin("PA8")));
    bench.write(TIM1 + BDTR, 0);
    assert!(!bench.chip.is_high(pin("PA8")));
}

#[test]
fn the_complement_is_the_inverse() {
    let mut bench = pulses();
    bench.connect("PA7", 6);
    bench.write(TIM1 + ARR, 99);
    bench.write(TIM1 + CCR1, 50);
    bench.write(TIM1 + CCMR1, PWM_1);
    bench.write(TIM1 + CCER, 1 | 1 << 2);
    assert!(bench.chip.is_high(pin("PA8")));
    assert!(!bench.chip.is_high(pin("PA7")));
    bench.write(TIM1 + BDTR, MOE | 10);
    assert!(bench.complaint().unwrap().ends_with("dead time is not modelled"));
}

#[test]
fn what_is_missing_is_refused() {
    for (register, value, words) in [
        (CR1, 1 << 5, "bits 0x20 are not modelled"),
        (CCMR1, 1 << 16 | 4 << 4, "output mode 12 of channel 1 is not modelled"),
        (SMCR, 9 | 1 << 16, "bits 0x8 are not modelled"),
    ] {
        let mut bench = bench();
        bench.write(TIM1 + register, value);
        let complaint = bench.complaint().unwrap();
        assert!(complaint.ends_with(words), "{complaint}");
    }
}

#[derive(Clone, Debug)]
struct Setup {
    prescaler: u32,
    reload: u32,
    compare: u32,
    repetitions: u32,
    cr1: u32,
    mode: u32,
    new_reload: u32,
    new_compare: u32,
}

fn setups() -> impl Strategy<Value = Setup> {
    let flags = (prop::bool::ANY, prop::bool::ANY, prop::bool::ANY);
    ((0u32..4, 1u32..40, 0u32..50, 0u32..5), flags, 0u32..8, (1u32..40, 0u32..50)).prop_map(
        |((prescaler, reload, compare, repetitions), (down, preload, once), mode, (new_reload, new_compare))| Setup {
            prescaler,
            reload,
            compare,
            repetitions,
            cr1: CEN | if down { DOWN } else { 0 } | if preload { ARPE } else { 0 } | if once { OPM } else { 0 },
            mode: mode << 4 | 8,
            new_reload,
            new_compare,
        },
    )
}

fn started(setup: &Setup) -> Bench<Nothing> {
    let mut bench = bench();
    bench.write(TIM1 + PSC, setup.prescaler);
    bench.write(TIM1 + ARR, setup.reload);
    bench.write(TIM1 + CCR1, setup.compare);
    bench.write(TIM1 + CCMR1, setup.mode);
    bench.write(TIM1 + RCR, setup.repetitions);
    bench.write(TIM1 + CR1, setup.cr1 & !CEN);
    bench.write(TIM1 + EGR, 1);
    bench.write(TIM1 + SR, 0);
    bench.write(TIM1 + CR1, setup.cr1);
    bench.write(TIM1 + ARR, setup.new_reload);
    bench.write(TIM1 + CCR1, setup.new_compare);
    bench
}

fn state(bench: &mut Bench<Nothing>) -> [u32; 3] {
    [CR1, SR, CNT].map(|register| bench.read(TIM1 + register))
}

proptest! {
    /// Skipping ahead must not be observable.
    #[test]
    fn one_leap_equals_many_steps(setup in setups(), cycles in 0u64..2_000) {
        let mut leaping = started(&setup);
        let mut stepping = started(&setup);
        leaping.wait(cycles);
        for _ in 0..cycles {
            stepping.wait(1);
            stepping.read(TIM1 + CNT);
        }
        prop_assert_eq!(state(&mut leaping), state(&mut stepping));
    }

    /// An observed output has the same edges however rarely the chip is advanced.
    #[test]
    fn edges_do_not_depend_on_who_looks(setup in setups(), cycles in 1u64..2_000) {
        let run = |step: u64| {
            let mut bench = pulses();
            for (register, value) in [
                (PSC, setup.prescaler), (ARR, setup.reload), (CCR1, setup.compare), (CCMR1, setup.mode),
                (RCR, setup.repetitions), (CR1, setup.cr1 & !CEN), (EGR, 1), (CCER, 1), (CR1, setup.cr1),
                (ARR, setup.new_reload), (CCR1, setup.new_compare),
            ] {
                bench.write(TIM1 + register, value);
            }
            for _ in 0..cycles / step {
                bench.wait(step);
                if step == 1 {
                    bench.read(TIM1 + CNT);
                }
            }
            bench.wait(cycles % step);
            edges(&bench, 0)
        };
        prop_assert_eq!(run(1), run(cycles));
    }
}
