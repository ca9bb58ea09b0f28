//! Exceptions: faults, priorities, preemption, frames. Each scenario prints its events.

use core::arch::asm;

use crate::events::{print, record, set_start};

const ICSR: u32 = 0xe000_ed04;
const SHPR2: u32 = 0xe000_ed1c;
const SHPR3: u32 = 0xe000_ed20;
const SHCSR: u32 = 0xe000_ed24;
const PEND_PENDSV: u32 = 1 << 28;
const FAULTS_ENABLED: u32 = 7 << 16;

type Code = unsafe extern "C" fn(u32) -> u32;

/// A piece of code to run, which may fault: its handler then returns to the caller.
macro_rules! code {
    ($($line:literal),+ $(,)?) => {{
        #[unsafe(naked)]
        unsafe extern "C" fn code(_: u32) -> u32 {
            core::arch::naked_asm!($($line),+, "bx lr")
        }
        code as crate::scenarios::Code
    }};
}

mod faults;
mod frames;
mod interrupts;

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
    faults::unmasked("enabled", FAULTS_ENABLED);
    faults::unmasked("escalated", 0);
    write(SHCSR, FAULTS_ENABLED);
    faults::masked();
    interrupts::priorities();
    interrupts::grouping();
    interrupts::masks();
    frames::stacked();
    frames::privileges();
    interrupts::timers();
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
