//! RCC, PWR and the time base: frequencies, start-up times, clock enables, limits.
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

mod common;

use common::{Bench, FLASH, GPIOA, PWR, RCC, TIM2, bare, bench};
use proptest::prelude::*;
use vergence_cpu::Bus;
use vergence_mcu::{Nothing, Picoseconds, TimeBase};

/// PLLCFGR for 24 MHz / 6 × 85 / 2 = 170 MHz from HSE (RM0440 §7.4.4).
const PLL_170: u32 = 3 | 5 << 4 | 85 << 8 | 1 << 24;

#[test]
fn wakes_up_on_hsi16() {
    let mut bench = bare(Nothing);
    assert_eq!(bench.read(RCC), 0x0000_0500, "RCC_CR: HSION and HSIRDY");
    assert_eq!(bench.read(RCC + 8), 0x0000_0005, "RCC_CFGR");
    assert_eq!(bench.read(RCC + 0xC), 0x0000_1000, "RCC_PLLCFGR");
    assert_eq!(bench.read(RCC + 0x94), 0x0C00_0000, "power-on and pin reset flags in RCC_CSR");
    let tree = bench.chip.clock_tree();
    assert_eq!((tree.sysclk, tree.hclk, tree.pclk), (16_000_000, 16_000_000, [16_000_000; 2]));
}

/// A chip whose PLL gives 170 MHz from HSI16, in boost mode and with the wait states, still running at 16 MHz.
fn before_the_step() -> Bench<Nothing> {
    let mut bench = bare(Nothing);
    bench.write(RCC + 0x58, 1 << 28);
    bench.write(PWR + 0x80, 0);
    bench.write(FLASH, 0x0004_0604);
    bench.write(RCC + 0xC, 2 | 3 << 4 | 85 << 8 | 1 << 24);
    bench.modify(RCC, 0, 1 << 24);
    bench.wait(640);
    bench
}

#[test]
fn a_step_above_80_mhz_goes_by_way_of_a_divided_bus() {
    let mut bench = before_the_step();
    bench.write(RCC + 8, 3);
    let complaint = bench.complaint().unwrap();
    assert!(
        complaint.contains("from 16000000 to 170000000 Hz at once") && complaint.contains("RM0440 7.2.7"),
        "{complaint}"
    );

    let mut bench = before_the_step();
    bench.write(RCC + 8, 3 | 0b1000 << 4);
    bench.wait(84);
    bench.write(RCC + 8, 3);
    assert_eq!(bench.complaint().unwrap(), "AHB was divided for 988 ns, which must be at least 1 us (RM0440 7.2.7)");

    let mut bench = before_the_step();
    bench.write(RCC + 8, 3 | 0b1000 << 4);
    bench.wait(85);
    bench.write(RCC + 8, 3);
    assert_eq!((bench.complaint(), bench.chip.clock_tree().hclk), (None, 170_000_000));
    bench.write(RCC + 8, 1);
    assert!(bench.complaint().unwrap().contains("from 170000000 to 16000000 Hz at once"));
}

#[test]
fn the_way_down_from_170_mhz_is_divided_too() {
    let mut bench = before_the_step();
    bench.write(RCC + 8, 3 | 0b1000 << 4);
    bench.wait(100);
    bench.write(RCC + 8, 3);
    bench.write(RCC + 8, 3 | 0b1000 << 4);
    bench.wait(85);
    bench.write(RCC + 8, 1 | 0b1000 << 4);
    assert_eq!((bench.complaint(), bench.chip.clock_tree().hclk), (None, 8_000_000));
}

#[test]
fn runs_at_170_mhz_from_the_crystal_after_honest_times() {
    let mut bench = bare(Nothing);
    bench.write(RCC + 0x58, 1 << 28);
    bench.write(PWR + 0x80, 0);
    bench.write(FLASH, 0x0004_0604);
    bench.modify(RCC, 0, 1 << 16);
    // 2 ms at 16 MHz.
    bench.wait(31_999);
    assert_eq!(bench.read(RCC) >> 17 & 1, 0, "HSERDY comes too early");
    bench.wait(1);
    assert_eq!(bench.read(RCC) >> 17 & 1, 1);
    bench.write(RCC + 0xC, PLL_170);
    bench.modify(RCC, 0, 1 << 24);
    bench.write(RCC + 8, 3 | 0b1000 << 4);
    assert_eq!(bench.read(RCC + 8) >> 2 & 3, 1, "the switch waits for the PLL");
    // 40 µs at 8 MHz.
    bench.wait(320);
    assert_eq!(bench.read(RCC + 8) >> 2 & 3, 3);
    // 1 µs at 85 MHz.
    bench.wait(85);
    bench.write(RCC + 8, 3);
    assert_eq!(bench.chip.clock_tree().hclk, 170_000_000);
    assert_eq!(bench.complaint(), None);
    let before = bench.chip.time();
    bench.wait(170_000);
    assert_eq!(bench.chip.time() - before, Picoseconds::milliseconds(1));
}

#[test]
fn a_core_clock_beyond_the_supply_is_refused() {
    let mut bench = bare(Nothing);
    bench.write(FLASH, 0x0004_0604);
    bench.modify(RCC, 0, 1 << 16);
    bench.wait(32_000);
    bench.write(RCC + 0xC, PLL_170);
    bench.modify(RCC, 0, 1 << 24);
    bench.write(RCC + 8, 3 | 0b1000 << 4);
    bench.wait(500);
    bench.write(RCC + 8, 3);
    assert_eq!(bench.complaint().unwrap(), "a core clock of 170000000 Hz is too fast for range 1");
}

#[test]
fn missing_wait_states_are_refused() {
    let mut bench = bare(Nothing);
    bench.write(RCC + 0x58, 1 << 28);
    bench.write(PWR + 0x80, 0);
    bench.write(FLASH, 0x0004_0603);
    bench.write(RCC + 0xC, 2 | 3 << 4 | 85 << 8 | 1 << 24);
    bench.modify(RCC, 0, 1 << 24);
    bench.write(RCC + 8, 3 | 0b1000 << 4);
    bench.wait(500);
    bench.write(RCC + 8, 3);
    let complaint = bench.complaint().unwrap();
    assert!(complaint.ends_with("range 1 boost needs 4 flash wait states, not 3"), "{complaint}");
}

#[test]
fn dividers_reach_buses_and_timers() {
    let mut bench = bench();
    // HPRE = /4, PPRE1 = /2, PPRE2 = /8: 16 → 4 MHz; buses 2 and 0.5 MHz; timers twice that (§7.2.15).
    bench.write(RCC + 8, 1 | 0b1001 << 4 | 0b100 << 8 | 0b110 << 11);
    let tree = bench.chip.clock_tree();
    assert_eq!((tree.hclk, tree.pclk), (4_000_000, [2_000_000, 500_000]));
    bench.write(TIM2, 1);
    bench.write(common::TIM15, 1);
    bench.wait(4_001);
    assert_eq!(bench.read(TIM2 + 0x24), 4_000, "TIM2 counts at 4 MHz");
    bench.wait(3);
    assert_eq!(bench.read(common::TIM15 + 0x24), 1_000, "TIM15 counts at 1 MHz");
}

#[test]
fn a_peripheral_without_clock_is_an_error_with_its_name() {
    let mut bench = bare(Nothing);
    bench.read(GPIOA);
    assert!(bench.chip.stop_requested());
    assert_eq!(bench.complaint().unwrap(), "GPIOA is used while its clock is off in RCC (MODER)");
}

#[test]
fn an_unmodelled_register_is_an_error_with_its_name() {
    let mut bench = bench();
    bench.read(RCC + 0x64);
    assert_eq!(bench.complaint().unwrap(), "RCC has no register at offset 0x64 in the model");
    let mut bench = bare(Nothing);
    assert!(bench.chip.read(0, 0x5000_0000, vergence_cpu::Access::Word).is_err());
    assert_eq!(bench.complaint().unwrap(), "nothing is modelled at 0x50000000");
}

#[test]
fn reset_registers_put_a_peripheral_back() {
    let mut bench = bench();
    bench.write(TIM2 + 0x2C, 1_000);
    bench.write(RCC + 0x38, 1);
    bench.write(RCC + 0x38, 0);
    assert_eq!(bench.read(TIM2 + 0x2C), u32::MAX);
}

#[test]
fn the_census_knows_what_was_touched() {
    let mut bench = bare(Nothing);
    bench.read(RCC);
    bench.write(RCC + 0x48, 0x101);
    let touched = bench.chip.touched();
    let names: Vec<_> =
        touched.iter().map(|touched| (touched.register.as_str(), touched.read, touched.written)).collect();
    assert_eq!(names, [("RCC.CR", true, false), ("RCC.AHB1ENR", false, true)]);
}

proptest! {
    #[test]
    fn cycles_and_time_go_together(
        hz in 1_000_000u32..170_000_000,
        changed_at in 0u64..1 << 40,
        cycle in 0u64..1 << 40,
    ) {
        let mut base = TimeBase::new(16_000_000);
        base.change(changed_at, hz);
        let cycle = changed_at + cycle;
        prop_assert_eq!(base.cycle_at(base.time_of(cycle)), cycle);
        prop_assert!(base.time_of(cycle) < base.time_of(cycle + 1));
    }
}
