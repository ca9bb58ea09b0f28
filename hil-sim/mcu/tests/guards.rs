//! The watchdog, random numbers and checksums (RM0440 §42, §26, §16).
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

mod common;

use common::{RCC, bare, bench};
use vergence_cpu::{Access, Bus};
use vergence_mcu::{Nothing, Picoseconds, ResetCause};

const IWDG: u32 = 0x4000_3000;
const RNG: u32 = 0x5006_0800;
const CRC: u32 = 0x4002_3000;

#[test]
fn the_watchdog_bites_in_time_and_the_cause_is_known() {
    let mut bench = bare(Nothing);
    // 32 kHz / 32 = 1 kHz; 500 counts.
    bench.write(IWDG, 0x5555);
    bench.write(IWDG + 4, 3);
    bench.write(IWDG + 8, 499);
    bench.write(IWDG, 0xCCCC);
    assert_eq!(bench.read(RCC + 0x94) & 1, 1, "it switches the slow oscillator on");
    bench.wait(16_000 * 400);
    bench.write(IWDG, 0xAAAA);
    bench.wait(16_000 * 500 - 1);
    assert!(!bench.chip.watchdog_bites());
    bench.wait(1);
    assert!(bench.chip.watchdog_bites());
    bench.chip.reset(bench.now, ResetCause::Watchdog);
    assert!(!bench.chip.watchdog_bites());
    // Power-on and pin from before, watchdog now (§7.4.28).
    assert_eq!(bench.read(RCC + 0x94), 0x2C00_0000);
    bench.write(RCC + 0x94, 1 << 23);
    assert_eq!(bench.read(RCC + 0x94), 0);
    assert_eq!(bench.chip.time(), Picoseconds::milliseconds(900));
}

#[test]
fn the_watchdog_stands_until_started_and_guards_its_registers() {
    let mut bench = bare(Nothing);
    bench.wait(16_000_000);
    assert!(!bench.chip.watchdog_bites());
    bench.write(IWDG + 8, 1);
    assert!(bench.complaint().unwrap().ends_with("the watchdog's registers are locked"));
}

#[test]
fn feeding_outside_the_window_bites() {
    let mut bench = bare(Nothing);
    bench.write(IWDG, 0xCCCC);
    bench.write(IWDG, 0x5555);
    bench.write(IWDG + 4, 3);
    bench.write(IWDG + 8, 999);
    assert_eq!(bench.read(IWDG + 0xC), 3, "values travel to the slow domain");
    bench.wait(16_000);
    assert_eq!(bench.read(IWDG + 0xC), 0);
    bench.write(IWDG + 0x10, 499);
    bench.wait(16_000 * 501);
    bench.write(IWDG, 0xAAAA);
    assert!(!bench.chip.watchdog_bites());
    bench.wait(16_000 * 400);
    bench.write(IWDG, 0xAAAA);
    bench.wait(1);
    assert!(bench.chip.watchdog_bites());
}

#[test]
fn random_numbers_need_their_clock_and_come_in_fours() {
    let mut bench = bench();
    bench.write(RNG, 1 << 2);
    assert_eq!(bench.read(RNG + 4) & 0x20, 0x20, "CEIS without a 48 MHz clock");
    bench.write(RNG, 0);
    bench.write(RCC + 0x98, 1);
    bench.wait(100);
    bench.write(RNG + 4, 0);
    bench.write(RNG, 1 << 2 | 1 << 3);
    assert_eq!(bench.read(RNG + 4), 0);
    // 412 clocks of 48 MHz are 137.3 cycles.
    bench.wait(138);
    assert!(bench.line(90));
    let words: Vec<_> = (0..4).map(|_| bench.read(RNG + 8)).collect();
    assert!(words.windows(2).all(|pair| pair[0] != pair[1]));
    assert_eq!(bench.read(RNG + 4) & 1, 0, "the next four are not ready");
    let mut twin = common::bench();
    twin.write(RCC + 0x98, 1);
    twin.wait(100);
    twin.write(RNG, 1 << 2);
    twin.wait(138);
    assert_eq!(twin.read(RNG + 8), words[0], "the same seed, the same numbers");
}

/// Check values of the CRC catalogue (reveng.sourceforge.io) for "123456789".
#[test]
fn checksums_match_the_catalogue() {
    let mut bench = bench();
    let mut checksum = |cr: u32, init: u32, polynomial: u32| {
        bench.write(CRC + 0x14, polynomial);
        bench.write(CRC + 0x10, init);
        bench.write(CRC + 8, cr | 1);
        for &byte in b"123456789" {
            bench.chip.write(bench.now, CRC, Access::Byte, u32::from(byte)).unwrap();
        }
        bench.read(CRC)
    };
    assert_eq!(checksum(0, u32::MAX, 0x04C1_1DB7), 0x0376_E6E7, "CRC-32/MPEG-2, the unit's default");
    assert_eq!(checksum(1 << 5 | 1 << 7, u32::MAX, 0x04C1_1DB7) ^ u32::MAX, 0xCBF4_3926, "CRC-32/ISO-HDLC");
    assert_eq!(checksum(1 << 3, 0xFFFF, 0x1021), 0x29B1, "CRC-16/IBM-3740");
    assert_eq!(checksum(2 << 3, 0, 0x07), 0xF4, "CRC-8/SMBUS");
}

#[test]
fn a_word_is_four_bytes_from_the_top() {
    let mut bench = bench();
    bench.write(CRC, 0x3132_3334);
    let whole = bench.read(CRC);
    bench.write(CRC + 8, 1);
    for byte in [0x31, 0x32, 0x33, 0x34] {
        bench.chip.write(bench.now, CRC, Access::Byte, byte).unwrap();
    }
    assert_eq!(bench.read(CRC), whole);
}
