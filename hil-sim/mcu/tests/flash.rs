//! FLASH: times, error flags, interrupts, stalls, power cuts and ECC (RM0440 §3).
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

mod common;

use common::{Bench, FLASH, bench};
use vergence_cpu::{Access, Bus};
use vergence_mcu::{Damage, Nothing, PowerCut, ResetCause};

const SR: u32 = FLASH + 0x10;
const CR: u32 = FLASH + 0x14;
const ECCR: u32 = FLASH + 0x18;
const PG: u32 = 1;
const BSY: u32 = 1 << 16;
const STRT: u32 = 1 << 16;
const BANK_2: u32 = 0x0804_0000;

fn unlocked() -> Bench<Nothing> {
    let mut bench = bench();
    bench.write(FLASH + 8, 0x4567_0123);
    bench.write(FLASH + 8, 0xCDEF_89AB);
    assert_eq!(bench.read(CR) >> 31, 0);
    bench
}

fn program(bench: &mut Bench<Nothing>, address: u32, value: u64) {
    bench.write(CR, PG);
    bench.write(address, value as u32);
    bench.write(address + 4, (value >> 32) as u32);
}

/// Cycles at 16 MHz until BSY falls.
fn busy_cycles(bench: &mut Bench<Nothing>) -> u64 {
    let begin = bench.now;
    while bench.read(SR) & BSY != 0 {
        bench.wait(1);
    }
    bench.now - begin
}

fn double_word(bench: &mut Bench<Nothing>, address: u32) -> u64 {
    u64::from(bench.read(address)) | u64::from(bench.read(address + 4)) << 32
}

#[test]
fn is_locked_after_reset() {
    let mut bench = bench();
    assert_eq!(bench.read(CR), 0xC000_0000);
    bench.write(CR, PG);
    assert!(bench.complaint().unwrap().ends_with("the flash is locked"));
}

#[test]
fn a_double_word_takes_82_us() {
    let mut bench = unlocked();
    program(&mut bench, 0x0800_1000, 0x1122_3344_5566_7788);
    // 81.69 µs at 16 MHz (DS12288, flash memory characteristics).
    assert_eq!(busy_cycles(&mut bench), 1_308);
    assert_eq!(double_word(&mut bench, 0x0800_1000), 0x1122_3344_5566_7788);
    assert_eq!(bench.read(SR), 0, "EOP comes only with its interrupt enabled");
}

#[test]
fn a_page_takes_22_ms_and_page_numbers_count_in_the_bank() {
    let mut bench = unlocked();
    for address in [0x0800_0800, BANK_2 + 0x7F8, BANK_2 + 0x800, BANK_2 + 0xFF8, BANK_2 + 0x1000] {
        program(&mut bench, address, 0);
        busy_cycles(&mut bench);
    }
    // PER, page 1, bank 2.
    bench.write(CR, 2 | 1 << 3 | 1 << 11);
    bench.write(CR, 2 | 1 << 3 | 1 << 11 | STRT);
    assert_eq!(busy_cycles(&mut bench), 352_320, "22.02 ms at 16 MHz");
    assert_eq!(double_word(&mut bench, 0x0800_0800), 0, "the same page of the other bank stays");
    assert_eq!(double_word(&mut bench, BANK_2 + 0x7F8), 0);
    assert_eq!(double_word(&mut bench, BANK_2 + 0x800), u64::MAX);
    assert_eq!(double_word(&mut bench, BANK_2 + 0xFF8), u64::MAX);
    assert_eq!(double_word(&mut bench, BANK_2 + 0x1000), 0);
}

#[test]
fn programming_over_data_is_refused_but_zero_goes() {
    let mut bench = unlocked();
    program(&mut bench, BANK_2, 0xFFFF_FFFF_FFFF_FFFE);
    busy_cycles(&mut bench);
    program(&mut bench, BANK_2, 0xFFFF_FFFF_FFFF_FFF0);
    assert_eq!(bench.read(SR), 1 << 3, "PROGERR");
    assert_eq!(double_word(&mut bench, BANK_2), 0xFFFF_FFFF_FFFF_FFFE);
    // With an error flag standing, the next try is out of sequence.
    program(&mut bench, BANK_2 + 8, 1);
    assert_eq!(bench.read(SR), 1 << 3 | 1 << 7, "PGSERR");
    bench.write(SR, 0xC3FB);
    program(&mut bench, BANK_2, 0);
    assert_eq!(bench.read(SR), BSY);
    busy_cycles(&mut bench);
    assert_eq!(double_word(&mut bench, BANK_2), 0);
}

#[test]
fn misuse_raises_its_flag() {
    let mut bench = unlocked();
    bench.write(BANK_2, 1);
    assert_eq!(bench.read(SR), 1 << 7, "PGSERR without PG");
    bench.write(SR, 0xC3FB);
    bench.write(CR, PG);
    bench.chip.write(bench.now, BANK_2, Access::Half, 1).unwrap();
    assert_eq!(bench.read(SR), 1 << 6, "SIZERR for a half-word");
    bench.write(SR, 0xC3FB);
    bench.write(BANK_2, 1);
    bench.write(BANK_2 + 12, 1);
    assert_eq!(bench.read(SR), 1 << 5, "PGAERR for the wrong second word");
}

#[test]
fn the_end_raises_an_interrupt() {
    let mut bench = unlocked();
    bench.write(CR, PG | 1 << 24);
    bench.write(BANK_2, 1);
    bench.write(BANK_2 + 4, 1);
    assert!(!bench.line(4));
    assert_eq!(bench.chip.next_event(), bench.now + 1_308);
    bench.wait(1_308);
    assert!(bench.line(4));
    bench.write(SR, 1);
    assert!(!bench.line(4));
}

#[test]
fn only_code_in_the_busy_bank_waits() {
    let mut bench = unlocked();
    program(&mut bench, BANK_2, 1);
    bench.chip.fetch(0x0800_0000).unwrap();
    assert_eq!(bench.chip.wait_states(bench.now), 0, "bank 1 is free");
    bench.wait(308);
    bench.chip.fetch(BANK_2).unwrap();
    assert_eq!(bench.chip.wait_states(bench.now), 1_000, "until bank 2 is free");
    assert_eq!(bench.chip.wait_states(bench.now), 0, "it waits only once");
}

#[test]
fn a_power_cut_leaves_what_it_says() {
    for (damage, cells, torn) in
        [(Damage::None, Some(u64::MAX), 0), (Damage::Complete, Some(0x1234), 0), (Damage::Torn { seed: 7 }, None, 1)]
    {
        let mut bench = unlocked();
        bench.chip.set_power_cut(Some(PowerCut { operation: 2, damage }));
        program(&mut bench, BANK_2, 1);
        busy_cycles(&mut bench);
        assert!(!bench.chip.power_is_lost());
        program(&mut bench, BANK_2 + 8, 0x1234);
        assert!(bench.chip.power_is_lost());
        // The dead chip writes nothing more.
        program(&mut bench, BANK_2 + 16, 0);
        assert_eq!(&bench.chip.flash()[0x4_0010..0x4_0018], &[0xFF; 8]);
        let left = u64::from_le_bytes(bench.chip.flash()[0x4_0008..0x4_0010].try_into().unwrap());
        match cells {
            Some(cells) => assert_eq!(left, cells),
            None => assert_eq!(left & 0x1234, 0x1234, "programming only clears bits that shall be zero"),
        }
        assert_eq!(bench.chip.torn_words().count(), torn);
    }
}

#[test]
fn a_torn_word_raises_nmi_until_cleared_and_erasing_heals_it() {
    let mut bench = unlocked();
    bench.chip.set_power_cut(Some(PowerCut { operation: 1, damage: Damage::Torn { seed: 1 } }));
    program(&mut bench, BANK_2 + 0x18, 0x1234);
    let torn: Vec<_> = bench.chip.torn_words().collect();
    assert_eq!(torn, [0x4_0018]);
    bench.chip.reset(bench.now, ResetCause::PowerOn);
    bench.read(BANK_2 + 0x10);
    assert!(!bench.chip.nmi(), "its neighbour is well");
    bench.read(BANK_2 + 0x18);
    assert!(bench.chip.nmi());
    // ECCD, bank 2, double word 3 of it.
    assert_eq!(bench.read(ECCR), 1 << 31 | 1 << 21 | 3);
    bench.write(ECCR, 1 << 31);
    assert!(!bench.chip.nmi());
    bench.write(FLASH + 8, 0x4567_0123);
    bench.write(FLASH + 8, 0xCDEF_89AB);
    bench.write(CR, 2 | 1 << 11 | STRT);
    busy_cycles(&mut bench);
    bench.read(BANK_2 + 0x18);
    assert!(!bench.chip.nmi());
}

#[test]
fn identity_words_are_there() {
    let mut bench = bench();
    assert_eq!(bench.read(0x1FFF_75E0) & 0xFFFF, 512, "flash size in KiB (§48.2)");
    assert_eq!(bench.read(0x1FFF_7590), 0x0031_0042, "unique identifier (§48.1)");
    assert_eq!(bench.read(FLASH + 0x20) >> 22 & 1, 1, "DBANK");
}
