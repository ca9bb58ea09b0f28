//! Arguments of a log entry, little-endian and without padding, in the order of their index in the format string.

use std::collections::BTreeMap;

use defmt_parser::{DisplayHint, Fragment, Parameter, ParserMode, TimePrecision, Type, parse};

use super::{FormatString, Strings};

/// The byte that ends a text of unknown length.
const END_OF_TEXT: u8 = 0xFF;

/// The bytes of an entry that are not decoded yet.
#[derive(Clone, Copy)]
pub(super) struct Arguments<'a> {
    pub bytes: &'a [u8],
    pub strings: &'a Strings,
}

impl<'a> Arguments<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (taken, rest) = self.bytes.split_at_checked(count)?;
        self.bytes = rest;
        Some(taken)
    }

    fn unsigned(&mut self, bytes: usize) -> Option<u128> {
        let mut word = [0; 16];
        word[..bytes].copy_from_slice(self.take(bytes)?);
        Some(u128::from_le_bytes(word))
    }

    fn length(&mut self) -> Option<usize> {
        usize::try_from(self.unsigned(4)?).ok()
    }

    /// Reads an index; returns the format string of that index.
    pub fn string(&mut self) -> Option<&'a FormatString> {
        let index = u16::try_from(self.unsigned(2)?).ok()?;
        self.strings.get(&index)
    }

    /// Fills in a format string. `outer` is the display hint of the parent for its parts.
    pub fn text(&mut self, format: &str, outer: Option<&DisplayHint>) -> Option<String> {
        let fragments = parse(format, ParserMode::ForwardsCompatible).ok()?;
        // An argument may be shown twice, but is encoded once.
        let parameters: BTreeMap<usize, &Parameter> = fragments
            .iter()
            .filter_map(|fragment| match fragment {
                Fragment::Parameter(parameter) => Some((parameter.index, parameter)),
                Fragment::Literal(_) => None,
            })
            .collect();
        let mut places = BTreeMap::new();
        for (index, parameter) in parameters {
            places.insert(index, *self);
            self.argument(&parameter.ty, None)?;
        }
        let shown = fragments.iter().map(|fragment| match fragment {
            Fragment::Literal(text) => Some(text.to_string()),
            Fragment::Parameter(Parameter { index, ty, hint }) => {
                // "Debug" does not decide the format of numbers: the parent does.
                let own = hint.as_ref().filter(|hint| **hint != DisplayHint::Debug || !is_number(ty));
                places.get(index)?.clone().argument(ty, own.or(outer))
            }
        });
        shown.collect()
    }

    fn argument(&mut self, of: &Type, hint: Option<&DisplayHint>) -> Option<String> {
        let quoted = |text: &str| if hint == Some(&DisplayHint::Debug) { format!("{text:?}") } else { text.to_owned() };
        Some(match of {
            Type::U8 => number(self.unsigned(1)?, hint),
            Type::U16 => number(self.unsigned(2)?, hint),
            Type::U32 | Type::Usize => number(self.unsigned(4)?, hint),
            Type::U64 => number(self.unsigned(8)?, hint),
            Type::U128 => number(self.unsigned(16)?, hint),
            Type::I8 => self.signed(1, hint)?,
            Type::I16 => self.signed(2, hint)?,
            Type::I32 | Type::Isize => self.signed(4, hint)?,
            Type::I64 => self.signed(8, hint)?,
            Type::I128 => self.signed(16, hint)?,
            Type::F32 => format!("{:?}", f32::from_bits(self.unsigned(4)? as u32)),
            Type::F64 => format!("{:?}", f64::from_bits(self.unsigned(8)? as u64)),
            Type::Bool => (self.unsigned(1)? != 0).to_string(),
            Type::Char => char::from_u32(self.unsigned(4)? as u32)?.to_string(),
            Type::Str => {
                let length = self.length()?;
                quoted(std::str::from_utf8(self.take(length)?).ok()?)
            }
            Type::IStr => quoted(&self.string()?.text),
            Type::Debug | Type::Display => {
                let length = self.bytes.iter().position(|&byte| byte == END_OF_TEXT)?;
                let text = std::str::from_utf8(self.take(length)?).ok()?;
                self.take(1)?;
                text.to_owned()
            }
            Type::U8Slice => {
                let length = self.length()?;
                bytes(self.take(length)?, hint)
            }
            Type::U8Array(length) => bytes(self.take(*length)?, hint),
            Type::Format => {
                let format = &self.string()?.text;
                self.variant(format, hint)?
            }
            Type::FormatSlice => {
                let length = self.length()?;
                self.list(length, hint)?
            }
            Type::FormatArray(length) => self.list(*length, hint)?,
            Type::FormatSequence => self.sequence(hint)?,
            // Our firmware has none; defmt-print reads them from `log --raw`.
            Type::BitField(_) => return None,
        })
    }

    fn signed(&mut self, bytes: usize, hint: Option<&DisplayHint>) -> Option<String> {
        let word = self.unsigned(bytes)?;
        let shift = 128 - 8 * bytes as u32;
        let value = (word << shift).cast_signed() >> shift;
        Some(if value < 0 && !is_digits(hint) { value.to_string() } else { number(word, hint) })
    }

    /// One of the variants of an enum, which its format string holds all of; or a format without variants.
    fn variant(&mut self, format: &str, hint: Option<&DisplayHint>) -> Option<String> {
        let bars = format.bytes().filter(|&byte| byte == b'|').count();
        if bars == 0 {
            return self.text(format, hint);
        }
        let width = if bars <= 0xFF { 1 } else { 2 };
        let variant = usize::try_from(self.unsigned(width)?).ok()?;
        self.text(format.split('|').nth(variant)?, hint)
    }

    fn list(&mut self, length: usize, hint: Option<&DisplayHint>) -> Option<String> {
        let format = &self.string()?.text;
        let items: Option<Vec<String>> = (0..length).map(|_| self.variant(format, hint)).collect();
        Some(format!("[{}]", items?.join(", ")))
    }

    /// Reads formats one after the other until index zero.
    fn sequence(&mut self, hint: Option<&DisplayHint>) -> Option<String> {
        let mut text = String::new();
        while !self.bytes.starts_with(&[0, 0]) {
            let format = &self.string()?.text;
            text.push_str(&self.text(format, hint)?);
        }
        self.take(2)?;
        Some(text)
    }
}

fn is_number(of: &Type) -> bool {
    !matches!(of, Type::Str | Type::IStr | Type::Format | Type::FormatSlice | Type::FormatArray(_))
}

/// Whether the hint asks for the digits of the word, not for a value with a sign.
fn is_digits(hint: Option<&DisplayHint>) -> bool {
    use DisplayHint::{Binary, Hexadecimal, Octal};
    matches!(hint, Some(Binary { .. } | Hexadecimal { .. } | Octal { .. }))
}

fn number(value: u128, hint: Option<&DisplayHint>) -> String {
    use DisplayHint::{Binary, Hexadecimal, NoHint, Octal, Seconds};
    match hint {
        Some(NoHint { zero_pad }) => format!("{value:0zero_pad$}"),
        Some(Hexadecimal { alternate: true, uppercase: false, zero_pad }) => format!("{value:#0zero_pad$x}"),
        Some(Hexadecimal { alternate: true, uppercase: true, zero_pad }) => format!("{value:#0zero_pad$X}"),
        Some(Hexadecimal { alternate: false, uppercase: false, zero_pad }) => format!("{value:0zero_pad$x}"),
        Some(Hexadecimal { alternate: false, uppercase: true, zero_pad }) => format!("{value:0zero_pad$X}"),
        Some(Octal { alternate: true, zero_pad }) => format!("{value:#0zero_pad$o}"),
        Some(Octal { alternate: false, zero_pad }) => format!("{value:0zero_pad$o}"),
        Some(Binary { alternate: true, zero_pad }) => format!("{value:#0zero_pad$b}"),
        Some(Binary { alternate: false, zero_pad }) => format!("{value:0zero_pad$b}"),
        Some(Seconds(TimePrecision::Micros)) => format!("{}.{:06}", value / 1_000_000, value % 1_000_000),
        Some(Seconds(TimePrecision::Millis)) => format!("{}.{:03}", value / 1_000, value % 1_000),
        _ => value.to_string(),
    }
}

fn bytes(bytes: &[u8], hint: Option<&DisplayHint>) -> String {
    if hint == Some(&DisplayHint::Ascii) {
        return format!("b\"{}\"", bytes.escape_ascii());
    }
    let numbers: Vec<String> = bytes.iter().map(|&byte| number(byte.into(), hint)).collect();
    format!("[{}]", numbers.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What a format string makes of these bytes, which must be used up; indices 7 and 8 are an enum and a name.
    fn text(format: &str, bytes: &[u8]) -> Option<String> {
        let string = |text: &str| FormatString { tag: "defmt_derived".into(), text: text.into() };
        let strings = Strings::from([(7, string("Idle|At({=u8})")), (8, string("name")), (9, string("{=u32}"))]);
        let mut arguments = Arguments { bytes, strings: &strings };
        let text = arguments.text(format, None)?;
        assert!(arguments.bytes.is_empty(), "{format} leaves {:?}", arguments.bytes);
        Some(text)
    }

    /// From the chapters "Primitives", "Display hints" and "Encoding" of the defmt book.
    #[test]
    fn each_type_has_its_bytes() {
        for (format, bytes, shown) in [
            ("{=u8} {=u16}", &[42, 1, 2][..], "42 513"),
            ("{=i8} {=i32}", &[0xFF, 0xFE, 0xFF, 0xFF, 0xFF], "-1 -2"),
            ("{=i16:#x}", &[0xFE, 0xFF], "0xfffe"),
            ("{=u32:#010x} {=u8:08b} {=u8:X}", &[0, 0, 1, 8, 5, 0xAB], "0x08010000 00000101 AB"),
            ("{=u64:us}", &[0x40, 0x42, 0x0F, 0, 0, 0, 0, 0], "1.000000"),
            ("{=f32} {=bool} {=char}", &[0, 0, 0xC0, 0x3F, 1, b'a', 0, 0, 0], "1.5 true a"),
            ("{=str} {=str:?}", &[2, 0, 0, 0, b'o', b'k', 1, 0, 0, 0, b'q'], "ok \"q\""),
            ("{=istr}", &[8, 0], "name"),
            ("{=[u8]} {=[u8; 2]:#x}", &[2, 0, 0, 0, 1, 2, 3, 4], "[1, 2] [0x3, 0x4]"),
            ("{=[u8]:a}", &[2, 0, 0, 0, b'a', 0xFF], "b\"a\\xff\""),
            ("{=__internal_Debug}", &[b'x', 0xFF], "x"),
            ("{} {}", &[7, 0, 0, 7, 0, 1, 5], "Idle At(5)"),
            ("{:#x}", &[9, 0, 16, 0, 0, 0], "0x10"),
            ("{=[?]:#x}", &[2, 0, 0, 0, 9, 0, 16, 0, 0, 0, 17, 0, 0, 0], "[0x10, 0x11]"),
            ("{=[?; 2]}", &[7, 0, 1, 1, 0], "[At(1), Idle]"),
            ("{=__internal_FormatSequence}", &[8, 0, 9, 0, 5, 0, 0, 0, 0, 0], "name5"),
            ("{1=u8} {0=u16} {1=u8:#x}", &[1, 0, 16], "16 1 0x10"),
            ("{{}}", &[], "{}"),
        ] {
            assert_eq!(text(format, bytes).as_deref(), Some(shown), "{format}");
        }
    }

    #[test]
    fn what_is_cut_off_or_unknown_is_no_text() {
        for (format, bytes) in [
            ("{=u32}", &[1, 2][..]),
            ("{=str}", &[9, 0, 0, 0, b'x']),
            ("{=str}", &[1, 0, 0, 0, 0xFF]),
            ("{}", &[1, 0]),
            ("{}", &[7, 0, 2]),
            ("{=__internal_Display}", b"x"),
            ("{=0..3}", &[1]),
        ] {
            assert_eq!(text(format, bytes), None, "{format}");
        }
    }
}
