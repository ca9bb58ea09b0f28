//! Exceptions: faults, priorities, preemption, frames. Each scenario prints its events.

use core::arch::{asm, naked_asm};

use crate::events::{events, print, record, set_raises, set_spoils_float, set_start};

const ICSR: u32 = 0xe000_ed04;
const AIRCR: u32 = 0xe000_ed0c;
const CCR: u32 = 0xe000_ed14;
const SHPR1: u32 = 0xe000_ed18;
const SHPR2: u32 = 0xe000_ed1c;
const SHPR3: u32 = 0xe000_ed20;
const SHCSR: u32 = 0xe000_ed24;
const FPCCR: u32 = 0xe000_ef34;
const STIR: u32 = 0xe000_ef00;
const ISER0: u32 = 0xe000_e100;
const ICER0: u32 = 0xe000_e180;
const ISPR0: u32 = 0xe000_e200;
const ICPR0: u32 = 0xe000_e280;
const IPR0: u32 = 0xe000_e400;
const STK_CTRL: u32 = 0xe000_e010;
const STK_LOAD: u32 = 0xe000_e014;
const STK_VAL: u32 = 0xe000_e018;
const PEND_PENDSV: u32 = 1 << 28;
const FAULTS_ENABLED: u32 = 7 << 16;
const TRAP_UNALIGNED: u32 = 1 << 3;
const TRAP_DIVIDE: u32 = 1 << 4;
const ALIGN_STACK: u32 = 1 << 9;
const AIRCR_KEY: u32 = 0x05fa_0000;

type Code = unsafe extern "C" fn(u32) -> u32;

/// A piece of code to run, which may fault: its handler then returns to the caller.
macro_rules! code {
    ($($line:literal),+ $(,)?) => {{
        #[unsafe(naked)]
        unsafe extern "C" fn code(_: u32) -> u32 {
            naked_asm!($($line),+, "bx lr")
        }
        code as Code
    }};
}

fn write(address: u32, value: u32) {
    // SAFETY: only registers of the system control space are written here.
    unsafe {
        (address as *mut u32).write_volatile(value);
        asm!("dsb", "isb", options(nostack));
    }
}

fn read(address: u32) -> u32 {
    // SAFETY: only registers of the system control space are read here.
    unsafe { (address as *const u32).read_volatile() }
}

/// Runs code on an argument and logs what it returns.
fn run_code(code: Code, argument: u32) {
    set_start(code as usize as u32 & !1);
    // SAFETY: ends the floating-point context, so that the frame's size depends on the code alone.
    unsafe { asm!("mrs {0}, CONTROL", "bic {0}, #4", "msr CONTROL, {0}", "isb", out(reg) _, options(nostack)) };
    // SAFETY: the code keeps to the calling convention, and returns to here even when it faults.
    record(unsafe { code(argument) });
}

fn scenario(name: &str, code: Code, argument: u32) {
    run_code(code, argument);
    print(name);
}

pub fn run() {
    calls();
    faults("enabled", FAULTS_ENABLED);
    faults("escalated", 0);
    write(SHCSR, FAULTS_ENABLED);
    masked_faults();
    priorities();
    grouping();
    masks();
    frames();
    privileges();
    timers();
}

fn calls() {
    write(SHPR2, 0x4000_0000);
    write(SHPR3, 0x00e0_0000);
    scenario("svc", code!("svc #5"), 0x1234);
    scenario("svc in an IT block", code!("movs r1, #0", "itte eq", "svceq #1", "moveq r0, #7", "movne r0, #9"), 1);
    scenario(
        "exclusive access broken by svc",
        code!("sub sp, #8", "ldrex r1, [sp]", "svc #0", "strex r0, r1, [sp]", "add sp, #8"),
        0,
    );
    scenario("flags across svc", code!("msr APSR_nzcvqg, r0", "svc #0", "mrs r0, APSR", "lsr r0, #16"), 0xf80f_0000);
    write(ICSR, PEND_PENDSV);
    print("pendsv");
    scenario(
        "pendsv held by PRIMASK",
        code!(
            "cpsid i",
            "ldr r1, =0xe000ed04",
            "mov r2, #0x10000000",
            "str r2, [r1]",
            "dsb",
            "ldr r0, [r1]",
            "cpsie i",
            "isb",
            "lsr r0, #24",
            "bx lr",
            ".ltorg"
        ),
        0,
    );
}

fn faults(name: &str, enabled: u32) {
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

/// What cannot be taken becomes a HardFault.
fn masked_faults() {
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

fn set_priorities(priorities: [u8; 8]) {
    let word = |index: usize| u32::from_le_bytes([0, 1, 2, 3].map(|byte| priorities[index + byte]));
    write(IPR0, word(0));
    write(IPR0 + 4, word(4));
}

/// Raised by line 1: 2 is more urgent and preempts, 3 is equal and waits, 4 less urgent and comes last.
fn priorities() {
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
fn grouping() {
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

fn masks() {
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

/// Code with values in S0, S1, S7, S15, S16 and FPSCR that an interrupt must keep; gives a sum of what it finds.
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

fn frames() {
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

fn privileges() {
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

/// Three interrupts of the system timer, waited for asleep.
fn timers() {
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
