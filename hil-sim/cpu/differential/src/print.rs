//! Lines of text by semihosting.

use core::arch::asm;

const WRITE0: u32 = 4;
const EXIT: u32 = 0x18;
/// "The application ended", which debuggers take for success.
const APPLICATION_EXIT: u32 = 0x20026;

/// A line being written; what does not fit is cut off.
pub struct Line {
    bytes: [u8; 256],
    length: usize,
}

impl Line {
    pub fn new() -> Self {
        Self { bytes: [0; 256], length: 0 }
    }

    fn push(&mut self, byte: u8) {
        if self.length + 2 < self.bytes.len() {
            self.bytes[self.length] = byte;
            self.length += 1;
        }
    }

    /// Text on one line: line breaks become semicolons, and the doubled braces of assembly templates single ones.
    pub fn text(mut self, text: &str) -> Self {
        let mut last = 0;
        for byte in text.bytes() {
            let doubled = matches!(byte, b'{' | b'}') && byte == last;
            last = if doubled { 0 } else { byte };
            if !doubled {
                self.push(if byte == b'\n' { b';' } else { byte });
            }
        }
        self
    }

    pub fn hex(mut self, word: u32) -> Self {
        for shift in (0..8).rev() {
            self.push(b"0123456789abcdef"[(word >> (4 * shift) & 15) as usize]);
        }
        self
    }

    pub fn print(mut self) {
        self.push(b'\n');
        call(WRITE0, self.bytes.as_ptr() as u32);
    }
}

/// Ends the run.
pub fn exit() -> ! {
    loop {
        call(EXIT, APPLICATION_EXIT);
    }
}

fn call(operation: u32, argument: u32) {
    // SAFETY: the host reads the zero-terminated text and writes nothing.
    unsafe { asm!("bkpt 0xab", inout("r0") operation => _, in("r1") argument, options(nostack)) }
}
