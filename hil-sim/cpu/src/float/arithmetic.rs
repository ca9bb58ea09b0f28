//! Sums, products, quotients, roots and comparisons (A2.5.8).

use super::{DIVIDE_BY_ZERO, Environment, INFINITY, INVALID, QUIET, Rounding, SIGN, Unpacked, signed};

/// A finite, nonzero value whose significand may have its top bit anywhere.
#[derive(Clone, Copy)]
struct Term {
    negative: bool,
    exponent: i32,
    significand: u128,
}

impl Environment {
    pub fn add(&mut self, x: u32, y: u32) -> u32 {
        if let Some(result) = self.quick(f32::from_bits(x) + f32::from_bits(y)) {
            return result;
        }
        // Both are unpacked before any NaN is looked at: the denormal flag comes first.
        let (a, b) = (self.unpack(x), self.unpack(y));
        if let Some(nan) = self.propagate_nan(&[x, y]) {
            return nan;
        }
        match (a, b) {
            (Unpacked::Infinity { negative: p }, Unpacked::Infinity { negative: q }) if p != q => self.invalid(),
            (Unpacked::Infinity { negative }, _) | (_, Unpacked::Infinity { negative }) => signed(negative, INFINITY),
            (Unpacked::Zero { negative: p }, Unpacked::Zero { negative: q }) => self.sum_of_zeros(p, q),
            _ => self.sum(term(a), term(b)),
        }
    }

    pub fn subtract(&mut self, x: u32, y: u32) -> u32 {
        // A NaN keeps its sign, so negating the operand would not do.
        if y & !SIGN > INFINITY { self.add(x, y) } else { self.add(x, y ^ SIGN) }
    }

    pub fn multiply(&mut self, x: u32, y: u32) -> u32 {
        if let Some(result) = self.quick(f32::from_bits(x) * f32::from_bits(y)) {
            return result;
        }
        let (a, b) = (self.unpack(x), self.unpack(y));
        if let Some(nan) = self.propagate_nan(&[x, y]) {
            return nan;
        }
        let negative = (x ^ y) & SIGN != 0;
        match (a, b) {
            (Unpacked::Infinity { .. }, Unpacked::Zero { .. }) | (Unpacked::Zero { .. }, Unpacked::Infinity { .. }) => {
                self.invalid()
            }
            (Unpacked::Infinity { .. }, _) | (_, Unpacked::Infinity { .. }) => signed(negative, INFINITY),
            _ => match product(a, b) {
                Some(term) => self.finish(term),
                None => signed(negative, 0),
            },
        }
    }

    /// `addend + x * y` with one rounding (FPMulAdd).
    pub fn multiply_add(&mut self, addend: u32, x: u32, y: u32) -> u32 {
        let (c, a, b) = (self.unpack(addend), self.unpack(x), self.unpack(y));
        let impossible = matches!(
            (a, b),
            (Unpacked::Infinity { .. }, Unpacked::Zero { .. }) | (Unpacked::Zero { .. }, Unpacked::Infinity { .. })
        );
        if let Some(nan) = self.propagate_nan(&[addend, x, y]) {
            // Infinity times zero is invalid even beside a quiet NaN.
            let quiet = addend & QUIET != 0;
            return if impossible && quiet { self.invalid() } else { nan };
        }
        let negative = (x ^ y) & SIGN != 0;
        let infinite = matches!(a, Unpacked::Infinity { .. }) || matches!(b, Unpacked::Infinity { .. });
        match c {
            _ if impossible => self.invalid(),
            Unpacked::Infinity { negative: other } if infinite && other != negative => self.invalid(),
            Unpacked::Infinity { negative } => signed(negative, INFINITY),
            _ if infinite => signed(negative, INFINITY),
            _ => match (product(a, b), c) {
                (None, Unpacked::Zero { negative: other }) => self.sum_of_zeros(negative, other),
                (product, _) => self.sum(product, term(c)),
            },
        }
    }

    pub fn divide(&mut self, x: u32, y: u32) -> u32 {
        if let Some(result) = self.quick(f32::from_bits(x) / f32::from_bits(y)) {
            return result;
        }
        let (a, b) = (self.unpack(x), self.unpack(y));
        if let Some(nan) = self.propagate_nan(&[x, y]) {
            return nan;
        }
        let negative = (x ^ y) & SIGN != 0;
        match (a, b) {
            (Unpacked::Infinity { .. }, Unpacked::Infinity { .. }) | (Unpacked::Zero { .. }, Unpacked::Zero { .. }) => {
                self.invalid()
            }
            (Unpacked::Infinity { .. }, _) => signed(negative, INFINITY),
            (Unpacked::Zero { .. }, _) | (_, Unpacked::Infinity { .. }) => signed(negative, 0),
            (
                Unpacked::Finite { exponent: p, significand: u, .. },
                Unpacked::Finite { exponent: q, significand: v, .. },
            ) => {
                // 62 more bits of quotient than either operand has; the rest is sticky.
                let (u, v) = (u128::from(u) << 62, u128::from(v));
                let significand = (u / v) << 1 | u128::from(!u.is_multiple_of(v));
                self.finish(Term { negative, exponent: p - q - 63, significand })
            }
            _ => {
                self.raise(DIVIDE_BY_ZERO);
                signed(negative, INFINITY)
            }
        }
    }

    pub fn square_root(&mut self, x: u32) -> u32 {
        if let Some(result) = self.quick(f32::from_bits(x).sqrt()) {
            return result;
        }
        let a = self.unpack(x);
        if let Some(nan) = self.propagate_nan(&[x]) {
            return nan;
        }
        match a {
            Unpacked::Zero { negative } => signed(negative, 0),
            Unpacked::Infinity { negative: true } | Unpacked::Finite { negative: true, .. } => self.invalid(),
            Unpacked::Finite { exponent, significand, .. } => {
                // An even exponent, and enough bits below for a root of more than 60.
                let odd = exponent & 1;
                let radicand = u128::from(significand) << (62 + odd);
                let root = radicand.isqrt();
                let significand = root << 1 | u128::from(root * root != radicand);
                self.finish(Term { negative: false, exponent: (exponent - 62 - odd) / 2 - 1, significand })
            }
            _ => INFINITY,
        }
    }

    /// FPCompare(): N, Z, C, V in the top bits.
    pub fn compare(&mut self, x: u32, y: u32, signals_quiet: bool) -> u32 {
        let (a, b) = (self.unpack(x), self.unpack(y));
        let is_nan = |bits: u32| bits & !SIGN > INFINITY;
        if is_nan(x) || is_nan(y) {
            let signalling = [x, y].iter().any(|&bits| is_nan(bits) && bits & QUIET == 0);
            if signalling || signals_quiet {
                self.raise(INVALID);
            }
            return 0b0011 << 28;
        }
        match rank(a, x).cmp(&rank(b, y)) {
            std::cmp::Ordering::Less => 0b1000 << 28,
            std::cmp::Ordering::Equal => 0b0110 << 28,
            std::cmp::Ordering::Greater => 0b0010 << 28,
        }
    }

    /// Zeros of different sign add up to plus zero, except when rounding down.
    fn sum_of_zeros(&self, p: bool, q: bool) -> u32 {
        let negative = if p == q { p } else { self.rounding() == Rounding::TowardMinus };
        signed(negative, 0)
    }

    fn sum(&mut self, x: Option<Term>, y: Option<Term>) -> u32 {
        let (x, y) = match (x, y) {
            (Some(x), Some(y)) if x.exponent >= y.exponent => (x, y),
            (Some(x), Some(y)) => (y, x),
            (Some(x), None) | (None, Some(x)) => return self.finish(x),
            (None, None) => return 0,
        };
        // The larger exponent is lowered as far as the space above its top bit allows, the smaller one raised.
        let room = x.significand.leading_zeros().saturating_sub(2);
        let distance = x.exponent.abs_diff(y.exponent);
        let down = distance.min(room);
        let big = (x.significand << down) as i128;
        let small = shift_sticky_wide(y.significand, distance - down) as i128;
        let total = if x.negative { -big } else { big } + if y.negative { -small } else { small };
        if total == 0 {
            return signed(self.rounding() == Rounding::TowardMinus, 0);
        }
        let exponent = x.exponent - down as i32;
        self.finish(Term { negative: total < 0, exponent, significand: total.unsigned_abs() })
    }

    fn finish(&mut self, term: Term) -> u32 {
        let top = 127 - term.significand.leading_zeros() as i32;
        let excess = top - 62;
        let significand = if excess > 0 {
            shift_sticky_wide(term.significand, excess as u32) as u64
        } else {
            (term.significand << -excess) as u64
        };
        self.single(term.negative, term.exponent + excess, significand)
    }
}

fn term(value: Unpacked) -> Option<Term> {
    match value {
        Unpacked::Finite { negative, exponent, significand } => {
            // Singles have 24 significant bits; the zeros below them only take space.
            Some(Term { negative, exponent: exponent + 32, significand: u128::from(significand >> 32) })
        }
        _ => None,
    }
}

fn product(a: Unpacked, b: Unpacked) -> Option<Term> {
    let (a, b) = (term(a)?, term(b)?);
    Some(Term {
        negative: a.negative != b.negative,
        exponent: a.exponent + b.exponent,
        significand: a.significand * b.significand,
    })
}

fn shift_sticky_wide(value: u128, amount: u32) -> u128 {
    match amount {
        0 => value,
        1..=127 => value >> amount | u128::from(value << (128 - amount) != 0),
        _ => u128::from(value != 0),
    }
}

/// Orders all numbers except NaNs; a number that was flushed to zero counts as zero.
fn rank(value: Unpacked, bits: u32) -> i64 {
    match value {
        Unpacked::Zero { .. } => 0,
        _ if bits & SIGN != 0 => -i64::from(bits & !SIGN),
        _ => i64::from(bits),
    }
}
