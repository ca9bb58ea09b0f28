//! Lengths, angles and times as types, parsed and printed with their units.

use std::fmt;
use std::ops::{Add, Div, Mul, Neg, Sub};
use std::str::FromStr;

/// A length, stored in millimetres.
///
/// ```
/// # use vergence_vision::Length;
/// let baseline: Length = "14.5 cm".parse()?;
/// assert_eq!(baseline.mm(), 145.0);
/// assert_eq!(format!("{baseline:.1}"), "145.0 mm");
/// assert!("145".parse::<Length>().is_err(), "a number without a unit is refused");
/// # Ok::<(), vergence_vision::InvalidQuantity>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Length {
    mm: f64,
}

/// A plane angle, stored in radians.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Angle {
    rad: f64,
}

impl Length {
    /// Makes a length of `mm` millimetres.
    #[must_use]
    pub const fn from_mm(mm: f64) -> Self {
        Self { mm }
    }

    /// The length in millimetres.
    #[must_use]
    pub const fn mm(self) -> f64 {
        self.mm
    }
}

impl Angle {
    /// Makes an angle of `rad` radians.
    #[must_use]
    pub const fn from_rad(rad: f64) -> Self {
        Self { rad }
    }

    /// Makes an angle of `deg` degrees.
    #[must_use]
    pub const fn from_deg(deg: f64) -> Self {
        Self { rad: deg.to_radians() }
    }

    /// The angle in radians.
    #[must_use]
    pub const fn rad(self) -> f64 {
        self.rad
    }

    /// The angle in degrees.
    #[must_use]
    pub const fn deg(self) -> f64 {
        self.rad.to_degrees()
    }

    /// The angle without its sign.
    #[must_use]
    pub const fn abs(self) -> Self {
        Self { rad: self.rad.abs() }
    }
}

/// A duration of either sign, stored in microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Time {
    us: f64,
}

impl Time {
    /// Makes a duration of `us` microseconds.
    #[must_use]
    pub const fn from_us(us: f64) -> Self {
        Self { us }
    }

    /// The duration in microseconds.
    #[must_use]
    pub const fn us(self) -> f64 {
        self.us
    }
}

/// Error of parsing a quantity: the text is not a number followed by a known unit.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("'{text}' is not {expected}: write a number and its unit, such as {example}")]
pub struct InvalidQuantity {
    text: String,
    expected: &'static str,
    example: &'static str,
}

/// Parses a finite number followed by one of `units`, each with its factor; returns their product.
fn parse_quantity(text: &str, units: &[(&str, f64)]) -> Option<f64> {
    let text = text.trim();
    let unit_start = text.find(|c: char| c.is_alphabetic() && c != 'e' && c != 'E' || c == '°')?;
    let (number, unit) = text.split_at(unit_start);
    let number: f64 = number.trim().parse().ok()?;
    let (_, factor) = units.iter().find(|(name, _)| *name == unit.trim())?;
    let value = number * factor;
    value.is_finite().then_some(value)
}

impl FromStr for Length {
    type Err = InvalidQuantity;

    /// Parses `145mm`, `14.5 cm`, `0.145m` or `20um`. A number without a unit is refused.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        const UNITS: [(&str, f64); 5] = [("mm", 1.0), ("cm", 10.0), ("m", 1e3), ("um", 1e-3), ("µm", 1e-3)];
        parse_quantity(text, &UNITS).map(Self::from_mm).ok_or_else(|| InvalidQuantity {
            text: text.to_owned(),
            expected: "a length",
            example: "145mm",
        })
    }
}

impl FromStr for Angle {
    type Err = InvalidQuantity;

    /// Parses `120deg`, `120°`, `2.09rad` or `5mrad`. A number without a unit is refused.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        const DEG: f64 = std::f64::consts::PI / 180.0;
        const UNITS: [(&str, f64); 4] = [("deg", DEG), ("°", DEG), ("rad", 1.0), ("mrad", 1e-3)];
        parse_quantity(text, &UNITS).map(Self::from_rad).ok_or_else(|| InvalidQuantity {
            text: text.to_owned(),
            expected: "an angle",
            example: "120deg",
        })
    }
}

impl FromStr for Time {
    type Err = InvalidQuantity;

    /// Parses `15us`, `14.8 µs`, `30ns`, `-2ms` or `0.1s`. A number without a unit is refused.
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        const UNITS: [(&str, f64); 5] = [("us", 1.0), ("µs", 1.0), ("ns", 1e-3), ("ms", 1e3), ("s", 1e6)];
        parse_quantity(text, &UNITS).map(Self::from_us).ok_or_else(|| InvalidQuantity {
            text: text.to_owned(),
            expected: "a time",
            example: "15us",
        })
    }
}

impl fmt::Display for Length {
    /// Prints millimetres, with the precision of the format (`{:.3}`).
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.mm(), f)?;
        f.write_str(" mm")
    }
}

impl fmt::Display for Angle {
    /// Prints degrees, with the precision of the format (`{:.2}`).
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.deg(), f)?;
        f.write_str("°")
    }
}

impl fmt::Display for Time {
    /// Prints microseconds, with the precision of the format (`{:.0}`).
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.us(), f)?;
        f.write_str(" us")
    }
}

macro_rules! linear_arithmetic {
    ($quantity:ident, $field:ident) => {
        impl Add for $quantity {
            type Output = Self;
            fn add(self, other: Self) -> Self {
                Self { $field: self.$field + other.$field }
            }
        }
        impl Sub for $quantity {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                Self { $field: self.$field - other.$field }
            }
        }
        impl Neg for $quantity {
            type Output = Self;
            fn neg(self) -> Self {
                Self { $field: -self.$field }
            }
        }
        impl Mul<f64> for $quantity {
            type Output = Self;
            fn mul(self, factor: f64) -> Self {
                Self { $field: self.$field * factor }
            }
        }
        impl Div<f64> for $quantity {
            type Output = Self;
            fn div(self, divisor: f64) -> Self {
                Self { $field: self.$field / divisor }
            }
        }
    };
}
linear_arithmetic!(Length, mm);
linear_arithmetic!(Angle, rad);
linear_arithmetic!(Time, us);
