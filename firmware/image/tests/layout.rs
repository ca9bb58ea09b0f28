//! The layout holds together, and the linker is told the same.
#![allow(
    clippy::unwrap_used,
    clippy::assertions_on_constants,
    reason = "a test fails loudly, and constants are what it is about"
)]

use std::path::Path;

use vergence_image::layout::{
    ACTIVE, BOOTLOADER, CAPACITY, DFU, FLASH_BASE, IMAGE, PAGE, RAM, Region, SETTINGS, STACK, STATE, SURVIVOR, WORD,
    pages_to_swap,
};
use vergence_image::{SEAL_LENGTH, SURVIVOR_WORDS};

/// 512 KiB in two banks.
const FLASH_LENGTH: u32 = 512 * 1024;
const BANK: u32 = FLASH_LENGTH / 2;

#[test]
fn regions_are_whole_pages_and_do_not_overlap() {
    let regions = [BOOTLOADER, STATE, ACTIVE, SETTINGS, DFU];
    assert!(regions.iter().all(|region| region.is_whole_pages()));
    assert!(regions.windows(2).all(|pair| pair[0].end() <= pair[1].start));
    assert!(DFU.end() <= FLASH_LENGTH);
}

#[test]
fn the_image_to_come_lies_in_the_other_bank() {
    assert!(SETTINGS.end() <= BANK && DFU.start >= BANK);
}

/// embassy-boot 0.7: one word for the state, one for its validity, four for each page; the second image has one page more.
#[test]
fn the_swap_has_the_room_it_needs() {
    // The last word holds the number of pages.
    assert!((2 + 4 * (ACTIVE.length / PAGE) + 1) * WORD <= STATE.length);
    assert_eq!(DFU.length, ACTIVE.length + PAGE);
}

#[test]
fn the_seal_is_whole_words_in_a_page_before_the_image() {
    assert_eq!(SEAL_LENGTH % WORD as usize, 0);
    assert!(ACTIVE.start + SEAL_LENGTH as u32 <= IMAGE.start);
    assert_eq!((IMAGE.start - ACTIVE.start, IMAGE.end()), (PAGE, ACTIVE.end()));
    assert!(CAPACITY.is_multiple_of(PAGE));
}

/// Erasing takes 22.5 ms a page, programming 85 us a word (STM32G474 data sheet, typical), and each page goes two ways.
#[test]
fn a_swap_takes_a_second_for_eleven_pages_of_the_longer_image() {
    let page_us = 22_500 + PAGE / WORD * 85;
    assert_eq!((pages_to_swap(1, 0), pages_to_swap(PAGE, 1), pages_to_swap(1, PAGE + 1)), (2, 2, 3));
    assert!(pages_to_swap(0, 10 * PAGE) * 2 * page_us < 1_000_000);
    assert!(pages_to_swap(CAPACITY, 0) * 2 * page_us < 8_400_000);
    // A damaged header must not lead beyond the place.
    assert_eq!(pages_to_swap(u32::MAX, 0), ACTIVE.length / PAGE);
}

#[test]
fn the_survivor_fits() {
    assert!(SURVIVOR_WORDS * 4 <= SURVIVOR.length as usize);
    assert_eq!(RAM.end(), SURVIVOR.start);
}

#[test]
fn the_linker_is_told_the_same() {
    let application = memory_x("nucleo-g474");
    assert_eq!(application["FLASH"], Region { start: FLASH_BASE + IMAGE.start, length: CAPACITY });
    let boot_loader = memory_x("bootloader");
    assert_eq!(boot_loader["FLASH"], Region { start: FLASH_BASE + BOOTLOADER.start, length: BOOTLOADER.length });
    for memory in [application, boot_loader] {
        assert_eq!(memory["STACK"], STACK);
        assert_eq!(memory["RAM"], Region { start: STACK.end(), length: RAM.length - STACK.length });
        assert_eq!(memory["SURVIVOR"], SURVIVOR);
    }
}

/// The regions of a linker script, by name.
fn memory_x(package: &str) -> std::collections::BTreeMap<String, Region> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(package).join("memory.x");
    let text = std::fs::read_to_string(&file).unwrap();
    text.lines().filter_map(region).collect()
}

/// `NAME : ORIGIN = 0x08000000, LENGTH = 96K - 128`, perhaps with a comment.
fn region(line: &str) -> Option<(String, Region)> {
    let (name, rest) = line.split_once(": ORIGIN = 0x")?;
    let (origin, length) = rest.split_once(", LENGTH = ")?;
    let length = length.split("/*").next()?;
    let mut terms = length.split('-').map(|term| number(term.trim()));
    let length = terms.next()? - terms.sum::<u32>();
    Some((name.trim().to_string(), Region { start: u32::from_str_radix(origin, 16).unwrap(), length }))
}

fn number(term: &str) -> u32 {
    match term.strip_suffix('K') {
        Some(kibibytes) => kibibytes.parse::<u32>().unwrap() * 1024,
        None => term.parse().unwrap(),
    }
}
