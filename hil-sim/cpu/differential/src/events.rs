//! What the exception handlers record, and how they act.

use core::arch::{asm, naked_asm};
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

use crate::print::Line;

const CFSR: *mut u32 = 0xe000_ed28 as *mut u32;
const HFSR: *mut u32 = 0xe000_ed2c as *mut u32;
const ICSR: *mut u32 = 0xe000_ed04 as *mut u32;
const ISPR0: *mut u32 = 0xe000_e200 as *mut u32;
const HARD_FAULT: u32 = 3;
const USAGE_FAULT: u32 = 6;
const T_BIT: u32 = 1 << 24;
/// Length of the code under test; addresses beyond it are logged unchanged.
const NEAR: u32 = 0x100;
/// Marks of a handler's beginning and end among the events.
const ENTER: u32 = 0xe000_0000;
const LEAVE: u32 = 0xef00_0000;

static LOG: [AtomicU32; 24] = [const { AtomicU32::new(0) }; 24];
static LENGTH: AtomicU32 = AtomicU32::new(0);
/// Where the code under test starts; program counters are logged relative to it.
static START: AtomicU32 = AtomicU32::new(0);
/// Interrupt lines that the handler of each exception pends.
static RAISES: [AtomicU32; 48] = [const { AtomicU32::new(0) }; 48];
/// Handlers overwrite the floating-point registers.
static SPOILS_FLOAT: AtomicBool = AtomicBool::new(false);

/// The basic exception frame.
#[repr(C)]
pub struct Frame {
    r: [u32; 4],
    r12: u32,
    lr: u32,
    pc: u32,
    xpsr: u32,
}

pub fn record(word: u32) {
    let index = LENGTH.fetch_add(1, Relaxed);
    if let Some(entry) = LOG.get(index as usize) {
        entry.store(word, Relaxed);
    }
}

/// Events since the last print.
pub fn events() -> u32 {
    LENGTH.load(Relaxed)
}

/// Prints the events since the last print, in order.
pub fn print(name: &str) {
    let mut line = Line::new().text(name).text(":");
    let length = LENGTH.swap(0, Relaxed) as usize;
    for entry in LOG.iter().take(length) {
        line = line.text(" ").hex(entry.load(Relaxed));
    }
    line.print();
}

pub fn set_start(address: u32) {
    START.store(address, Relaxed);
}

/// Lets the handler of an exception pend interrupt lines.
pub fn set_raises(exception: u32, lines: u32) {
    if let Some(entry) = RAISES.get(exception as usize) {
        entry.store(lines, Relaxed);
    }
}

pub fn set_spoils_float(spoils: bool) {
    SPOILS_FLOAT.store(spoils, Relaxed);
}

/// The handler of every exception.
#[unsafe(naked)]
pub unsafe extern "C" fn dispatch() {
    naked_asm!(
        "mrs r0, IPSR",
        "mov r1, lr",
        "tst lr, #4",
        "ite eq",
        "mrseq r2, MSP",
        "mrsne r2, PSP",
        "push {{r4, lr}}",
        "bl {handle}",
        "pop {{r4, pc}}",
        handle = sym handle,
    )
}

extern "C" fn handle(exception: u32, return_value: u32, frame: &mut Frame) {
    record(ENTER | exception << 8 | return_value & 0xff);
    // SAFETY: thread mode becomes privileged again.
    unsafe { asm!("mrs {0}, CONTROL", "bic {0}, #1", "msr CONTROL, {0}", out(reg) _, options(nostack)) };
    if (HARD_FAULT..=USAGE_FAULT).contains(&exception) {
        record_fault(frame);
    }
    if SPOILS_FLOAT.load(Relaxed) {
        // SAFETY: the hardware has stacked what the interrupted code needs, S16 and up are not touched.
        unsafe { spoil_float() };
    }
    let raises = RAISES.get(exception as usize).map_or(0, |lines| lines.load(Relaxed));
    if raises != 0 {
        // SAFETY: a register of the NVIC.
        unsafe {
            ISPR0.write_volatile(raises);
            asm!("dsb", "isb", options(nostack));
            record(ICSR.read_volatile() & 0x0040_f9ff);
        }
        record(LEAVE | exception);
    }
}

/// Logs and clears the fault, then lets the code under test return to its caller.
fn record_fault(frame: &mut Frame) {
    // SAFETY: registers of the system control block.
    unsafe {
        record(CFSR.read_volatile());
        record(HFSR.read_volatile());
        CFSR.write_volatile(u32::MAX);
        HFSR.write_volatile(u32::MAX);
    }
    let offset = frame.pc.wrapping_sub(START.load(Relaxed));
    record(if offset < NEAR { offset } else { frame.pc });
    record(frame.xpsr & 0x0700_fdff);
    frame.pc = frame.lr & !1;
    frame.xpsr = frame.xpsr & 0xf80f_0000 | T_BIT;
}

#[unsafe(naked)]
unsafe extern "C" fn spoil_float() {
    naked_asm!(
        "vmov s0, r0",
        "vmov s1, r0",
        "vmov s7, r0",
        "vmov s15, r0",
        "mov r0, #0xc00000",
        "vmsr fpscr, r0",
        "bx lr",
    )
}
