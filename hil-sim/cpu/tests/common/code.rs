//! Thumb code for the tests: a few instructions by name, and the registers of the core.

pub const WFI: u16 = 0xbf30;
pub const WFE: u16 = 0xbf20;
pub const SEV: u16 = 0xbf40;
pub const NOP: u16 = 0xbf00;
pub const CPSID_I: u16 = 0xb672;
pub const CPSIE_I: u16 = 0xb662;
pub const RETURN: u16 = 0x4770;
pub const UNDEFINED: u16 = 0xde00;
pub const SUPERVISOR_CALL: u16 = 0xdf00;
pub const BREAKPOINT: u16 = 0xbe00;
/// Branches to itself.
pub const FOREVER: u16 = 0xe7fe;
/// `str r1, [r0]` and `ldr r2, [r0]`.
pub const STORE: u16 = 0x6001;
pub const LOAD: u16 = 0x6802;

pub const ISER: u32 = 0xe000_e100;
pub const ISPR: u32 = 0xe000_e200;
pub const IPR: u32 = 0xe000_e400;
pub const STK_CTRL: u32 = 0xe000_e010;
pub const STK_LOAD: u32 = 0xe000_e014;
pub const STK_VAL: u32 = 0xe000_e018;
pub const ICSR: u32 = 0xe000_ed04;
pub const VTOR: u32 = 0xe000_ed08;
pub const AIRCR: u32 = 0xe000_ed0c;
pub const SCR: u32 = 0xe000_ed10;
pub const CCR: u32 = 0xe000_ed14;
pub const SHCSR: u32 = 0xe000_ed24;
pub const CFSR: u32 = 0xe000_ed28;
pub const HFSR: u32 = 0xe000_ed2c;
pub const CPACR: u32 = 0xe000_ed88;
pub const FPCCR: u32 = 0xe000_ef34;
pub const DEMCR: u32 = 0xe000_edfc;
pub const DWT_CTRL: u32 = 0xe000_1000;
pub const DWT_CYCCNT: u32 = 0xe000_1004;

/// MOVW and MOVT: any constant into a register.
pub fn constant(register: u16, value: u32) -> Vec<u16> {
    let half = |opcode: u16, value: u16| {
        let first = opcode | (value >> 11 & 1) << 10 | value >> 12;
        [first, (value >> 8 & 7) << 12 | register << 8 | value & 0xff]
    };
    [half(0xf240, value as u16), half(0xf2c0, (value >> 16) as u16)].concat()
}

/// Stores a constant; spoils R0 and R1.
pub fn write(address: u32, value: u32) -> Vec<u16> {
    [constant(0, address), constant(1, value), vec![STORE]].concat()
}

/// Loads a word into R2; spoils R0.
pub fn read(address: u32) -> Vec<u16> {
    [constant(0, address), vec![LOAD]].concat()
}

/// A handler that appends its digit to the trace in R4.
pub fn trace(digit: u16) -> Vec<u16> {
    // lsls r4, r4, #4; adds r4, #digit; bx lr
    vec![0x0124, 0x3400 + digit, RETURN]
}
