//! Operands: pseudo-random (xorshift32, Marsaglia 2003), with special values more frequent than by chance.

/// A reproducible stream of operands.
pub struct Operands(u32);

const INTEGERS: [u32; 8] = [0, 1, u32::MAX, 0x8000_0000, 0x7fff_ffff, 0x0000_ffff, 0x8000_8000, 31];
/// Zeros, ones, infinities, quiet and signalling NaNs, the ends of the denormals and normals, edges of the integers.
const FLOATS: [u32; 32] = [
    0x0000_0000,
    0x8000_0000,
    0x3f80_0000,
    0xbf80_0000,
    0x7f80_0000,
    0xff80_0000,
    0x7fc0_0000,
    0xffc1_2345,
    0x7f80_0001,
    0xffa5_5555,
    0x0000_0001,
    0x8000_0001,
    0x007f_ffff,
    0x807f_ffff,
    0x0080_0000,
    0x8080_0001,
    0x7f7f_ffff,
    0xff7f_ffff,
    0x4f00_0000,
    0xcf00_0000,
    0x4f80_0000,
    0x4eff_ffff,
    0xbf00_0000,
    0x3f00_0001,
    0x3fc0_0000,
    0x4020_0000,
    0x4b00_0001,
    0x3300_0000,
    0x3880_0000,
    0x387f_c000,
    0x477f_e000,
    0x477f_f000,
];

impl Operands {
    pub fn new() -> Self {
        Self(0x2545_f491)
    }

    /// Any word.
    pub fn any(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }

    /// A word: one of the special values, a small number, or any.
    pub fn integer(&mut self) -> u32 {
        let kind = self.any() >> 27 & 3;
        let value = self.any();
        match kind {
            0 => INTEGERS[(value >> 8 & 7) as usize],
            1 => value & 0xff,
            _ => value,
        }
    }

    /// Bits of a single: one of the special values, a number of medium size, of any size, a denormal, or any bits.
    pub fn float(&mut self) -> u32 {
        let kind = self.any() >> 27 & 7;
        let value = self.any();
        let sign = value & 0x8000_0000;
        match kind {
            0 | 1 => FLOATS[(value >> 8 & 31) as usize],
            2 | 3 => sign | (120 + (value >> 23 & 15)) << 23 | value & 0x007f_ffff,
            4 => sign | (0x40 + (value >> 24 & 0x7f)) << 23 | value & 0x007f_0000,
            5 => sign | value & 0x00ff_ffff,
            _ => value,
        }
    }
}
