//! SPI: frames, FIFOs, flags, times (RM0440 §42). At 16 MHz.
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

mod common;

use common::{Bench, RCC, bench_with, pin};
use vergence_cpu::{Access, Bus};
use vergence_mcu::{SpiFrame, SpiId, World};

const SPI1: u32 = 0x4001_3000;
const CR1: u32 = SPI1;
const CR2: u32 = SPI1 + 4;
const SR: u32 = SPI1 + 8;
const DR: u32 = SPI1 + 12;
/// Master, select by software, on; clock of the bus divided by 2 << this.
const ON: u32 = 1 << 9 | 1 << 8 | 1 << 6 | 1 << 2;
const DIV8: u32 = 2 << 3;
const HALF: u32 = 0xF00;
const BYTE: u32 = 0x700 | 1 << 12;
const RXNE: u32 = 1;
const TXE: u32 = 2;
const MODF: u32 = 1 << 5;
const OVR: u32 = 1 << 6;
const BSY: u32 = 1 << 7;
/// The interrupt of SPI1.
const LINE: u32 = 35;

/// A device that answers each word with its complement, and keeps what it got.
#[derive(Clone, Debug, Default)]
struct Mirror {
    frames: Vec<SpiFrame>,
    mute: bool,
}

impl World for Mirror {
    fn frame_exchanged(&mut self, port: SpiId, frame: SpiFrame) -> Option<u16> {
        assert_eq!(port, SpiId::SPI1);
        self.frames.push(frame);
        (!self.mute).then_some(!frame.word)
    }
}

fn wired() -> Bench<Mirror> {
    let mut bench = bench_with(Mirror::default());
    bench.modify(RCC + 0x60, 0, 1 << 12);
    for name in ["PB3", "PA6", "PA7"] {
        bench.connect(name, 5);
    }
    bench
}

fn on(cr1: u32, cr2: u32) -> Bench<Mirror> {
    let mut bench = wired();
    bench.write(CR2, cr2);
    bench.write(CR1, cr1);
    bench
}

fn put(bench: &mut Bench<Mirror>, access: Access, word: u32) {
    bench.chip.write(bench.now, DR, access, word).unwrap();
}

fn get(bench: &mut Bench<Mirror>, access: Access) -> u32 {
    bench.chip.read(bench.now, DR, access).unwrap()
}

#[test]
fn after_reset_it_is_off_with_eight_bits_and_room_to_write() {
    let mut bench = wired();
    assert_eq!([CR1, CR2, SR, SPI1 + 16].map(|register| bench.read(register)), [0, 0x700, TXE, 7]);
}

/// A frame of 16 bits at an eighth of 16 MHz takes 128 cycles; the answer of the device is there when it ends.
#[test]
fn a_frame_takes_its_bits_and_brings_an_answer() {
    let mut bench = on(ON | DIV8 | 1, HALF);
    put(&mut bench, Access::Half, 0x1234);
    assert_eq!(bench.read(SR) & (BSY | RXNE), BSY);
    bench.wait(127);
    assert_eq!(bench.read(SR) & (BSY | RXNE), BSY);
    bench.wait(1);
    assert_eq!(bench.read(SR), RXNE | TXE | 2 << 9, "half full");
    assert_eq!(get(&mut bench, Access::Half), !0x1234 & 0xFFFF);
    assert_eq!(bench.read(SR), TXE);
    let [frame] = bench.chip.world().frames[..] else { panic!("one frame") };
    assert_eq!((frame.word, frame.bits, frame.mode, frame.hertz), (0x1234, 16, 1, 2_000_000));
    assert_eq!((frame.to - frame.from).0, 8_000_000, "8 us");
}

#[test]
fn mode_and_divider_reach_the_line() {
    for (bits, mode) in [(0, 0), (1, 1), (2, 2), (3, 3)] {
        for divider in 0..8 {
            let mut bench = on(ON | divider << 3 | bits, HALF);
            put(&mut bench, Access::Half, 0xA5A5);
            bench.wait(16 * (2 << divider));
            let frame = bench.chip.world().frames[0];
            assert_eq!((frame.mode, frame.hertz), (mode, 16_000_000 / (2 << divider)));
        }
    }
    // The clock rests at its polarity.
    for polarity in [false, true] {
        let bench = on(ON | u32::from(polarity) << 1, HALF);
        assert_eq!(bench.chip.is_high(pin("PB3")), polarity);
    }
}

#[test]
fn frames_follow_each_other_and_the_fifos_hold_two() {
    let mut bench = on(ON | DIV8, HALF);
    put(&mut bench, Access::Half, 1);
    put(&mut bench, Access::Half, 2);
    assert_eq!(bench.read(SR) & TXE, TXE, "one is under way, one waits");
    put(&mut bench, Access::Half, 3);
    assert_eq!(bench.read(SR) & (TXE | 3 << 11), 3 << 11, "full");
    bench.wait(3 * 128);
    let frames: Vec<_> = bench.chip.world().frames.iter().map(|frame| frame.word).collect();
    assert_eq!(frames, [1, 2, 3]);
    assert_eq!(bench.read(SR) & (OVR | BSY), OVR, "the third answer found no room");
    assert_eq!([0; 2].map(|_| get(&mut bench, Access::Half)), [0xFFFE, 0xFFFD]);
    assert_eq!(bench.read(SR) & OVR, OVR, "this read clears it");
    assert_eq!(bench.read(SR) & OVR, 0);
}

#[test]
fn bytes_have_their_own_threshold() {
    for (frxth, after_one) in [(1 << 12, RXNE), (0, 0)] {
        let mut bench = on(ON | DIV8, BYTE & !(1 << 12) | frxth);
        put(&mut bench, Access::Byte, 0x5A);
        bench.wait(64);
        assert_eq!(bench.read(SR) & RXNE, after_one);
        put(&mut bench, Access::Byte, 0x00);
        bench.wait(64);
        assert_eq!(bench.read(SR) & RXNE, RXNE);
        assert_eq!([0; 2].map(|_| get(&mut bench, Access::Byte)), [0xA5, 0xFF]);
    }
}

#[test]
fn sizes_of_four_to_sixteen_bits_are_cut_out_of_the_words() {
    for bits in 4..=16u32 {
        let mut bench = on(ON | DIV8, (bits - 1) << 8 | 1 << 12);
        let access = if bits > 8 { Access::Half } else { Access::Byte };
        put(&mut bench, access, 0);
        bench.wait(u64::from(8 * bits));
        assert_eq!(get(&mut bench, access), u32::from(u16::MAX) >> (16 - bits));
        assert_eq!(u32::from(bench.chip.world().frames[0].bits), bits);
    }
    let mut bench = wired();
    bench.write(CR2, 0x100);
    assert_eq!(bench.read(CR2), 0x700, "sizes below four bits are eight");
}

#[test]
fn interrupts_follow_their_flags() {
    for (enable, works) in [(1 << 6, true), (1 << 7, true), (1 << 5, false)] {
        let mut bench = on(ON | DIV8, HALF | enable);
        put(&mut bench, Access::Half, 1);
        bench.wait(128);
        assert_eq!(bench.line(LINE), works);
    }
    let mut bench = on(ON | DIV8, HALF | 1 << 5);
    (0..3).for_each(|_| put(&mut bench, Access::Half, 0));
    bench.wait(3 * 128);
    assert!(bench.line(LINE), "an overrun is an error");
}

#[test]
fn a_line_that_nobody_drives_reads_as_its_pull() {
    for (pull, word) in [(1, 0xFFFF), (2, 0)] {
        let mut bench = on(ON | DIV8, HALF);
        bench.chip.with_world(|mirror, _| mirror.mute = true);
        bench.modify(common::GPIOA + 0xC, 3 << 12, pull << 12);
        put(&mut bench, Access::Half, 7);
        bench.wait(128);
        assert_eq!(get(&mut bench, Access::Half), word);
    }
}

/// A clock without a pin reaches no device.
#[test]
fn without_a_clock_pin_nothing_is_exchanged() {
    let mut bench = bench_with(Mirror::default());
    bench.modify(RCC + 0x60, 0, 1 << 12);
    bench.write(CR2, HALF);
    bench.write(CR1, ON | DIV8);
    put(&mut bench, Access::Half, 7);
    bench.wait(128);
    assert!(bench.chip.world().frames.is_empty());
}

#[test]
fn a_master_whose_select_is_low_is_thrown_out() {
    let mut bench = on(ON & !(1 << 8), HALF);
    assert_eq!(bench.read(SR) & MODF, MODF);
    assert_eq!(bench.read(CR1) & (1 << 6 | 1 << 2), 0);
}

#[test]
fn what_is_missing_is_refused() {
    let refused = |act: fn(&mut Bench<Mirror>)| {
        let mut bench = wired();
        act(&mut bench);
        bench.complaint().unwrap_or_default()
    };
    assert!(refused(|bench| bench.write(CR1, ON | 1 << 13)).contains("0x2000"), "CRC");
    assert!(refused(|bench| bench.write(CR1, ON & !(1 << 2))).contains("slave"));
    assert!(refused(|bench| bench.write(CR2, 1)).contains("0x1"), "DMA");
    assert!(
        refused(|bench| {
            bench.write(CR2, BYTE);
            bench.write(CR1, ON);
            put(bench, Access::Half, 7);
        })
        .contains("packing")
    );
    assert!(
        refused(|bench| {
            bench.write(CR1, ON);
            bench.write(CR1, ON | 1);
        })
        .contains("while the port is on")
    );
    assert!(
        refused(|bench| {
            bench.write(CR2, HALF);
            bench.write(CR1, ON | DIV8);
            put(bench, Access::Half, 7);
            bench.write(CR1, ON & !(1 << 6) | DIV8);
        })
        .contains("mid-frame")
    );
}
