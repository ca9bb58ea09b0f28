//! Interrupts: priorities, preemption, chaining, masks, the system timer.

use core::arch::asm;

use super::{read, scenario, write};
use crate::events::{events, print, record, set_raises};

const AIRCR: u32 = 0xe000_ed0c;
const STIR: u32 = 0xe000_ef00;
const ISER0: u32 = 0xe000_e100;
const ICER0: u32 = 0xe000_e180;
const ISPR0: u32 = 0xe000_e200;
const ICPR0: u32 = 0xe000_e280;
const IPR0: u32 = 0xe000_e400;
const STK_CTRL: u32 = 0xe000_e010;
const STK_LOAD: u32 = 0xe000_e014;
const STK_VAL: u32 = 0xe000_e018;
const AIRCR_KEY: u32 = 0x05fa_0000;

fn set_priorities(priorities: [u8; 8]) {
    let word = |index: usize| u32::from_le_bytes([0, 1, 2, 3].map(|byte| priorities[index + byte]));
    write(IPR0, word(0));
    write(IPR0 + 4, word(4));
}

/// Raised by line 1: 2 is more urgent and preempts, 3 is equal and waits, 4 less urgent and comes last.
pub fn priorities() {
    write(ISER0, 0xff);
    set_priorities([0x80, 0x80, 0x40, 0x80, 0xc0, 0x00, 0xf0, 0x80]);
    set_raises(17, 0b1_1100);
    write(ISPR0, 1 << 1);
    print("preemption and chaining");
    set_raises(17, 0);
    set_raises(18, 1 << 5);
    write(STIR, 2);
    print("software trigger and nesting");
    write(ICER0, 1 << 3);
    write(ISPR0, 1 << 3 | 1 << 4);
    record(read(ISPR0));
    write(ICPR0, 1 << 3);
    record(read(ISPR0));
    record(read(ISER0));
    write(ISER0, 1 << 3);
    print("disabled and cleared");
    record(read(IPR0));
    record(read(IPR0 + 4));
    print("priorities read back");
    set_raises(18, 0);
}

/// With three bits of sub-priority, 0x40 does not preempt 0x60 but goes before 0x50 when both wait.
pub fn grouping() {
    write(AIRCR, AIRCR_KEY | 6 << 8);
    set_priorities([0x60, 0x40, 0x50, 0x80, 0, 0, 0, 0]);
    set_raises(16, 0b1110);
    write(ISPR0, 1);
    print("sub-priorities");
    write(AIRCR, AIRCR_KEY);
    write(ISPR0, 1);
    print("no sub-priorities");
    set_raises(16, 0);
}

pub fn masks() {
    set_priorities([0x20, 0x40, 0x60, 0x80, 0, 0, 0, 0]);
    scenario(
        "BASEPRI holds back",
        code!(
            "mov r1, #0x50",
            "msr BASEPRI, r1",
            "ldr r1, =0xe000e200",
            "mov r2, #15",
            "str r2, [r1]",
            "dsb",
            "isb",
            "ldr r0, [r1]",
            "mov r3, #0",
            "msr BASEPRI, r3",
            "isb",
            "bx lr",
            ".ltorg"
        ),
        0,
    );
    scenario(
        "FAULTMASK holds back",
        code!(
            "cpsid f",
            "ldr r1, =0xe000e200",
            "mov r2, #3",
            "str r2, [r1]",
            "dsb",
            "isb",
            "ldr r0, [r1]",
            "cpsie f",
            "isb",
            "bx lr",
            ".ltorg"
        ),
        0,
    );
}

/// Three interrupts of the system timer, waited for asleep.
pub fn timers() {
    write(STK_LOAD, 99_999);
    write(STK_VAL, 0);
    write(STK_CTRL, 7);
    while events() < 3 {
        // SAFETY: the timer wakes the core.
        unsafe { asm!("wfi", options(nostack)) };
    }
    write(STK_CTRL, 0);
    record(read(STK_CTRL));
    record(read(STK_CTRL));
    record(read(STK_LOAD));
    print("systick");
}
