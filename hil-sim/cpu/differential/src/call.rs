//! Runs one instruction form on given registers, flags and memory.

use core::arch::naked_asm;

/// An instruction form as a function, and its text.
pub struct Form {
    pub text: &'static str,
    pub code: unsafe extern "C" fn(),
}

/// A list of forms: each text becomes a function of its own, ending in a return.
#[macro_export]
macro_rules! forms {
    ($($text:expr),* $(,)?) => {
        &[$({
            #[unsafe(naked)]
            unsafe extern "C" fn code() {
                core::arch::naked_asm!($text, "bx lr")
            }
            $crate::call::Form { text: $text, code }
        }),*]
    };
}

/// The machine state before and after a form. `run` in assembly knows this layout.
#[repr(C)]
pub struct Context {
    code: unsafe extern "C" fn(),
    /// R0 to R5; R5 points into the middle of `scratch`.
    pub r: [u32; 6],
    pub apsr: u32,
    pub fpscr: u32,
    /// S0 to S3.
    pub s: [u32; 4],
    /// Memory for loads and stores.
    pub scratch: [u32; 32],
}

impl Context {
    pub fn new(form: &Form) -> Self {
        Self { code: form.code, r: [0; 6], apsr: 0, fpscr: 0, s: [0; 4], scratch: [0; 32] }
    }

    fn middle(&self) -> u32 {
        self.scratch[16..].as_ptr() as u32
    }

    /// How far the form moved its base register.
    pub fn moved(&self) -> u32 {
        self.r[5].wrapping_sub(self.middle())
    }

    /// Runs the form.
    pub fn run(&mut self) {
        self.r[5] = self.middle();
        // SAFETY: the forms use only what `run` saves, and memory only around R5, inside `scratch`.
        unsafe { run(self) }
    }
}

#[unsafe(naked)]
unsafe extern "C" fn run(context: &mut Context) {
    naked_asm!(
        "push {{r0, r4-r11, lr}}",
        "ldr r12, [r0]",
        "ldrd r1, r2, [r0, #28]",
        "add r3, r0, #36",
        "vldm r3, {{s0-s3}}",
        "vmsr fpscr, r2",
        "msr APSR_nzcvqg, r1",
        "add.w r0, r0, #4",
        "ldm r0, {{r0-r5}}",
        "blx r12",
        "ldr r12, [sp]",
        "add.w r12, r12, #4",
        "stm r12, {{r0-r5}}",
        "mrs r0, APSR",
        "vmrs r1, fpscr",
        "strd r0, r1, [r12, #24]",
        "add r12, r12, #32",
        "vstm r12, {{s0-s3}}",
        "mov r1, #0",
        "vmsr fpscr, r1",
        "pop {{r0, r4-r11, pc}}",
    )
}
