//! Records where a program died.
//!
//! Every function of this target keeps a stack frame (rustc sets "frame-pointer: always" for it): r7 points to two words on
//! the stack, the caller's r7 and the return address. So the calls that led to a panic are recorded as addresses, which the
//! ELF file turns into names; file names in the program would take 11 kB of flash.

use core::arch::asm;

use cortex_m_rt::ExceptionFrame;
use vergence_image::layout::{ACTIVE, BOOTLOADER, FLASH_BASE, RAM};
use vergence_image::{Death, DeathKind, TRACE};

/// A death of `kind` at the place of the call.
#[inline(always)]
#[must_use]
pub fn here(kind: DeathKind) -> Death {
    let mut trace = [0; TRACE];
    follow(frame_pointer(), &mut trace);
    Death { kind, trace }
}

/// A death by hard fault. Call it from the fault's handler, whose stack frame lies on that of the function at fault.
#[inline(always)]
#[must_use]
pub fn of_fault(frame: &ExceptionFrame) -> Death {
    let mut trace = [0; TRACE];
    let [at, rest @ ..] = &mut trace;
    *at = frame.pc();
    // The link register shows where a jump to an address without code came from.
    let (link, calls) = rest.split_at_mut(usize::from(is_code(frame.lr())));
    link.fill(frame.lr());
    if let Some([interrupted, _]) = frame_at(frame_pointer()) {
        follow(interrupted, calls);
    }
    Death { kind: DeathKind::HardFault, trace }
}

#[inline(always)]
fn frame_pointer() -> u32 {
    let pointer;
    // SAFETY: it copies a register.
    #[allow(unsafe_code, reason = "the frame pointer")]
    unsafe {
        asm!("mov {}, r7", out(reg) pointer, options(nomem, nostack, preserves_flags));
    }
    pointer
}

/// Fills `trace` with the return addresses of `frame` and its callers, as far as they are plausible.
fn follow(mut frame: u32, trace: &mut [u32]) {
    for address in trace {
        let Some([caller, back]) = frame_at(frame) else { return };
        // Frames of code that an interrupt has interrupted are not followed.
        if !is_code(back) || caller <= frame {
            return;
        }
        *address = back;
        frame = caller;
    }
}

fn is_code(address: u32) -> bool {
    [BOOTLOADER, ACTIVE].iter().any(|region| (region.start..region.end()).contains(&address.wrapping_sub(FLASH_BASE)))
}

/// The caller's frame pointer and the return address at `frame`, if it can be a stack frame.
fn frame_at(frame: u32) -> Option<[u32; 2]> {
    let is_stack = frame.is_multiple_of(4) && (RAM.start..RAM.end() - 8).contains(&frame);
    // SAFETY: two words of RAM, which may hold anything.
    #[allow(unsafe_code, reason = "the stack of a program that has died")]
    is_stack.then(|| unsafe { (frame as *const [u32; 2]).read_volatile() })
}
