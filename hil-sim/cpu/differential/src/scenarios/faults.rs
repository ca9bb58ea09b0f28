//! Faults: trapped, escalated, masked.

use core::arch::asm;

use super::{read, scenario, write};
use crate::events::{print, record};

const CCR: u32 = 0xe000_ed14;
const SHPR1: u32 = 0xe000_ed18;
const SHCSR: u32 = 0xe000_ed24;
const TRAP_UNALIGNED: u32 = 1 << 3;
const TRAP_DIVIDE: u32 = 1 << 4;
const ALIGN_STACK: u32 = 1 << 9;

pub fn unmasked(name: &str, enabled: u32) {
    write(SHCSR, enabled);
    record(enabled);
    print(name);
    scenario("udf", code!("udf #1"), 0);
    scenario("udf.w", code!("nop", "udf.w #1"), 0);
    scenario("unallocated coprocessor", code!("mcr p5, #0, r0, c0, c0, #0"), 0);
    scenario("divide by zero untrapped", code!("mov r1, #0", "sdiv r0, r0, r1"), 5);
    write(CCR, ALIGN_STACK | TRAP_DIVIDE);
    scenario("sdiv by zero", code!("mov r1, #0", "sdiv r0, r0, r1"), 5);
    scenario("udiv by zero in an IT block", code!("movs r1, #0", "itt eq", "udiveq r0, r0, r1", "moveq r0, #3"), 5);
    write(CCR, ALIGN_STACK | TRAP_UNALIGNED);
    scenario("unaligned word trapped", code!("sub sp, #8", "mov r1, sp", "add sp, #8", "ldr r0, [r1, #1]"), 0);
    scenario("unaligned half trapped", code!("sub sp, #8", "mov r1, sp", "add sp, #8", "strh r0, [r1, #1]"), 0);
    write(CCR, ALIGN_STACK);
    scenario("unaligned ldrd", code!("sub r1, sp, #30", "ldrd r2, r3, [r1]"), 0);
    scenario("unaligned ldm", code!("sub r1, sp, #30", "ldm r1, {{r2, r3}}"), 0);
    scenario("unaligned ldrex", code!("sub r1, sp, #30", "ldrex r2, [r1]"), 0);
    scenario("unaligned vldr", code!("sub r1, sp, #30", "vldr s0, [r1]"), 0);
    scenario("even branch target", code!("bx r0"), 0x400);
    scenario("load from nowhere", code!("mov r1, #0x70000000", "ldr r0, [r1, #4]"), 9);
    record(read(0xe000_ed38));
    print("BFAR");
    scenario("jump to nowhere", code!("orr r0, #1", "bx r0"), 0x7000_0000);
    scenario("jump to a peripheral", code!("orr r0, #1", "bx r0"), 0x4000_0000);
    write(0xe000_ed88, 0);
    scenario("floating point without access", code!("vmov s0, r0"), 0);
    write(0xe000_ed88, 0x00f0_0000);
}

/// A fault that cannot be taken becomes a HardFault.
pub fn masked() {
    scenario("svc under PRIMASK", code!("cpsid i", "mov r1, lr", "svc #2"), 0);
    // SAFETY: ends the mask that the scenario left.
    unsafe { asm!("cpsie i", options(nostack)) };
    scenario("udf under PRIMASK", code!("cpsid i", "udf #2"), 0);
    // SAFETY: the same.
    unsafe { asm!("cpsie i", options(nostack)) };
    write(SHPR1, 0x0080_0000);
    scenario("udf under BASEPRI", code!("mov r1, #0x80", "msr BASEPRI, r1", "udf #2"), 0);
    // SAFETY: the same.
    unsafe { asm!("msr BASEPRI, {0}", in(reg) 0, options(nostack)) };
    write(SHPR1, 0);
}
