//! Exception frames, stacks and privileges.

use super::{Code, scenario, write};
use crate::events::{set_raises, set_spoils_float};

const FPCCR: u32 = 0xe000_ef34;

/// Code with values in S0, S1, S7, S15, S16 and FPSCR that an interrupt must keep; returns a sum of what it finds.
fn float_kept() -> Code {
    code!(
        "vpush {{s16}}",
        "mov r2, #0x03000000",
        "vmsr fpscr, r2",
        "vmov s0, r0",
        "add r0, #1",
        "vmov s1, r0",
        "add r0, #1",
        "vmov s7, r0",
        "add r0, #1",
        "vmov s15, r0",
        "vmov s16, r0",
        "ldr r1, =0xe000e200",
        "mov r2, #1",
        "str r2, [r1]",
        "dsb",
        "isb",
        "vmov r0, s0",
        "vmov r1, s1",
        "add r0, r0, r1, lsl #4",
        "vmov r1, s7",
        "add r0, r0, r1, lsl #8",
        "vmov r1, s15",
        "add r0, r0, r1, lsl #12",
        "vmov r1, s16",
        "add r0, r0, r1, lsl #16",
        "vmrs r1, fpscr",
        "add r0, r1",
        "mov r1, #0",
        "vmsr fpscr, r1",
        "vpop {{s16}}",
        "bx lr",
        ".ltorg",
    )
}

pub fn stacked() {
    for (name, control) in [("lazy float frame", 0xc000_0000), ("eager float frame", 0x8000_0000)] {
        write(FPCCR, control);
        set_spoils_float(false);
        scenario(name, float_kept(), 1);
        set_spoils_float(true);
        scenario("the handler uses floats", float_kept(), 2);
        set_raises(16, 1 << 5);
        scenario("so does a nested one", float_kept(), 3);
        set_raises(16, 0);
    }
    write(FPCCR, 0xc000_0000);
    set_spoils_float(false);
    scenario(
        "padded frame",
        code!(
            "push {{r4}}",
            "mov r4, sp",
            "svc #0",
            "ldr r1, [sp, #-8]",
            "mov r2, sp",
            "sub r4, r2",
            "mov r0, r4",
            "lsr r1, #9",
            "and r1, #1",
            "add r0, r1",
            "pop {{r4}}"
        ),
        0,
    );
    scenario(
        "frame on eight bytes",
        code!(
            "push {{r3, r4}}",
            "mov r4, sp",
            "svc #0",
            "ldr r1, [sp, #-4]",
            "mov r2, sp",
            "sub r4, r2",
            "mov r0, r4",
            "lsr r1, #9",
            "and r1, #1",
            "add r0, r1",
            "pop {{r3, r4}}"
        ),
        0,
    );
}

pub fn privileges() {
    scenario(
        "process stack",
        code!(
            "mrs r1, CONTROL",
            "ldr r2, =process_stack_top",
            "msr PSP, r2",
            "orr r3, r1, #2",
            "msr CONTROL, r3",
            "isb",
            "svc #0",
            "mov r0, sp",
            "sub r0, r2",
            "msr CONTROL, r1",
            "isb",
            "bx lr",
            ".ltorg"
        ),
        0,
    );
    // An unprivileged program cannot mask, cannot read the stack pointers and cannot go back; the handler of the SVC
    // gives the privilege back.
    scenario(
        "unprivileged",
        code!(
            "push {{r4, lr}}",
            "mrs r1, CONTROL",
            "orr r3, r1, #1",
            "msr CONTROL, r3",
            "isb",
            "cpsid i",
            "mov r2, #0x40",
            "msr BASEPRI, r2",
            "mrs r0, PRIMASK",
            "mrs r2, BASEPRI",
            "add r0, r2",
            "mrs r2, MSP",
            "add r0, r2",
            "msr CONTROL, r1",
            "isb",
            "mrs r2, CONTROL",
            "and r2, #3",
            "add r0, r0, r2, lsl #8",
            "svc #0",
            "mrs r2, CONTROL",
            "and r2, #3",
            "add r0, r0, r2, lsl #4",
            "pop {{r4, pc}}"
        ),
        0,
    );
    scenario(
        "unprivileged access to the NVIC",
        code!(
            "mrs r1, CONTROL",
            "orr r1, #1",
            "msr CONTROL, r1",
            "isb",
            "ldr r1, =0xe000e100",
            "ldr r0, [r1]",
            "bx lr",
            ".ltorg"
        ),
        3,
    );
}
