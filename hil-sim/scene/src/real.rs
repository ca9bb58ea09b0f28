//! Numbers of double precision, for exact images, and of single precision, for images in real time: what both do with them is written once.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// A number with a fraction. In double precision its functions are those of the standard library; in single precision they are
/// approximations that the compiler makes vector instructions of.
pub trait Real:
    Copy
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Whether places are taken one by one, so that what one does not need is left out; otherwise many side by side do the same.
    const ONE_BY_ONE: bool;

    /// The nearest number of this precision.
    fn of(value: f64) -> Self;
    /// The nearest number of single precision.
    fn single(self) -> f32;
    fn double(self) -> f64;
    fn abs(self) -> Self;
    fn sqrt(self) -> Self;
    fn max(self, other: Self) -> Self;
    fn min(self, other: Self) -> Self;
    /// The angle of the point (`x`, `self`) to the x axis, in radians.
    fn atan2(self, x: Self) -> Self;
    /// Splits a number below 2^31 (2^22 in single precision) into whole cells and the rest.
    fn split(self) -> (i32, f32);
    /// Sine and cosine of a part of a full turn, 0 to 1.
    fn sin_cos_of_turn(part: f32) -> (f32, f32);
    /// The distance of (`x`, `y`) from the origin.
    fn hypot(x: f32, y: f32) -> f32;
}

/// The functions that are the same in both precisions.
macro_rules! basics {
    () => {
        #[inline(always)]
        fn abs(self) -> Self {
            self.abs()
        }

        #[inline(always)]
        fn sqrt(self) -> Self {
            self.sqrt()
        }

        #[inline(always)]
        fn max(self, other: Self) -> Self {
            self.max(other)
        }

        #[inline(always)]
        fn min(self, other: Self) -> Self {
            self.min(other)
        }
    };
}

impl Real for f64 {
    const ONE_BY_ONE: bool = true;

    basics!();

    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn single(self) -> f32 {
        self as f32
    }

    #[inline(always)]
    fn double(self) -> f64 {
        self
    }

    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        self.atan2(x)
    }

    #[inline(always)]
    fn split(self) -> (i32, f32) {
        // 1.5 times 2^52: added to a number of that size it leaves the nearest whole one in the last bits.
        const TO_WHOLE: f64 = 6_755_399_441_055_744.0;
        let nearest = (self + TO_WHOLE) - TO_WHOLE;
        let whole = nearest - if nearest > self { 1.0 } else { 0.0 };
        ((whole + TO_WHOLE).to_bits() as i32, (self - whole) as f32)
    }

    #[inline(always)]
    fn sin_cos_of_turn(part: f32) -> (f32, f32) {
        (std::f32::consts::TAU * part).sin_cos()
    }

    #[inline(always)]
    fn hypot(x: f32, y: f32) -> f32 {
        x.hypot(y)
    }
}

impl Real for f32 {
    const ONE_BY_ONE: bool = false;

    basics!();

    #[inline(always)]
    fn of(value: f64) -> Self {
        value as Self
    }

    #[inline(always)]
    fn single(self) -> f32 {
        self
    }

    #[inline(always)]
    fn double(self) -> f64 {
        Self::into(self)
    }

    /// To 1e-5 rad: by the polynomial of least error for the arctangent of numbers from 0 to 1.
    #[inline(always)]
    fn atan2(self, x: Self) -> Self {
        const TERMS: [f32; 6] = [0.999_977_3, -0.332_623_5, 0.193_543_5, -0.116_432_9, 0.052_653_3, -0.011_721_2];
        let (rise, run) = (self.abs(), x.abs());
        let (low, high) = (rise.min(run), rise.max(run));
        let ratio = low / high.max(Self::MIN_POSITIVE);
        let square = ratio * ratio;
        let mut sum = TERMS[5];
        for term in [TERMS[4], TERMS[3], TERMS[2], TERMS[1], TERMS[0]] {
            sum = sum * square + term;
        }
        let steep = sum * ratio;
        let acute = if rise > run { std::f32::consts::FRAC_PI_2 - steep } else { steep };
        let angle = if x < 0.0 { std::f32::consts::PI - acute } else { acute };
        if self < 0.0 { -angle } else { angle }
    }

    #[inline(always)]
    fn split(self) -> (i32, f32) {
        // 1.5 times 2^23: as in double precision.
        const TO_WHOLE: f32 = 12_582_912.0;
        let nearest = (self + TO_WHOLE) - TO_WHOLE;
        let whole = nearest - if nearest > self { 1.0 } else { 0.0 };
        ((whole + TO_WHOLE).to_bits().wrapping_sub(TO_WHOLE.to_bits()).cast_signed(), self - whole)
    }

    /// To 5e-6.
    #[inline(always)]
    fn sin_cos_of_turn(part: f32) -> (f32, f32) {
        (sine_of_turn(part), sine_of_turn(part + 0.25))
    }

    #[inline(always)]
    fn hypot(x: f32, y: f32) -> f32 {
        (x * x + y * y).sqrt()
    }
}

/// The sine of 0 to 1.25 turns, by its series about the nearest zero.
#[inline(always)]
fn sine_of_turn(part: f32) -> f32 {
    // Half a turn back the sign changes: -1/2 to 3/4, folded to -1/4 to 1/4.
    let back = part - 0.5;
    let folded = if back > 0.25 { 0.5 - back } else { back };
    let folded = if folded < -0.25 { -0.5 - folded } else { folded };
    let angle = std::f32::consts::TAU * folded;
    let square = angle * angle;
    let series = 1.0 + square * (-1.0 / 6.0 + square * (1.0 / 120.0 + square * (-1.0 / 5040.0 + square / 362_880.0)));
    -angle * series
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_splits_into_its_floor_and_the_rest() {
        for (x, whole, rest) in
            [(2.75, 2, 0.75), (-2.75, -3, 0.25), (0.0, 0, 0.0), (-7.0, -7, 0.0), (0.5, 0, 0.5), (1.5, 1, 0.5)]
        {
            assert_eq!(x.split(), (whole, rest), "{x}");
            assert_eq!((x as f32).split(), (whole, rest), "{x} in single precision");
        }
    }

    #[test]
    fn functions_of_single_precision_are_near_those_of_the_library() {
        for step in 0..10_000_u16 {
            let part = f32::from(step) / 10_000.0;
            let (exact, quick) = (<f64 as Real>::sin_cos_of_turn(part), <f32 as Real>::sin_cos_of_turn(part));
            assert!((exact.0 - quick.0).abs() < 1e-5 && (exact.1 - quick.1).abs() < 1e-5, "{part}: {quick:?}");
            let angle = f64::atan2(f64::from(exact.0), f64::from(exact.1));
            assert!((angle - f64::from(Real::atan2(exact.0, exact.1))).abs() < 2e-5, "{part}: {angle}");
        }
    }
}
