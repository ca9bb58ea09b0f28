//! The families of encodings (ARM DDI 0403E, A5, A6).

use crate::encodings::{D, Family, Field, M, N, T, VD, VM, VN, bits};

/// A NOP after a 16-bit instruction.
const NOP: u16 = 0xbf00;
const LOW: Field = Field(0, 0, 5);
const MIDDLE: Field = Field(0, 3, 5);
const HIGH: Field = Field(0, 6, 5);
const TOP: Field = Field(0, 8, 5);

/// Data-processing operations that exist, except PKH.
fn operation(first: u16, _: u16) -> bool {
    matches!(bits(first, 8, 5), 0..=4 | 8 | 10 | 11 | 13 | 14)
}

/// Widths and signs of single loads and stores that exist, with a defined addressing form.
fn single(first: u16, second: u16) -> bool {
    let (signed, size, load) = (bits(first, 8, 8) != 0, bits(first, 6, 5), bits(first, 4, 4) != 0);
    let indexed = bits(first, 7, 7) == 0;
    let defined = !indexed || bits(second, 10, 10) != 0 || bits(second, 8, 8) != 0;
    size < 3 && (!signed || load && size < 2) && defined
}

pub const INTEGER: &[Family] = &[
    Family::new("shift by immediate", [0x0000, NOP], [0x07c0, 0], &[LOW, MIDDLE]),
    Family::new("shift right by immediate", [0x0800, NOP], [0x07c0, 0], &[LOW, MIDDLE]),
    Family::new("arithmetic shift by immediate", [0x1000, NOP], [0x07c0, 0], &[LOW, MIDDLE]),
    Family::new("narrow add and subtract", [0x1800, NOP], [0x0600, 0], &[LOW, MIDDLE, HIGH]),
    Family::new("narrow immediates", [0x2000, NOP], [0x18ff, 0], &[TOP]),
    Family::new("narrow data processing", [0x4000, NOP], [0x03c0, 0], &[LOW, MIDDLE]),
    Family::new("narrow extensions", [0xb200, NOP], [0x00c0, 0], &[LOW, MIDDLE]),
    Family::new("narrow words", [0x6028, NOP], [0x09c0, 0], &[LOW]),
    Family::new("narrow bytes", [0x7028, NOP], [0x0fc0, 0], &[LOW]),
    Family::new("narrow halves", [0x8028, NOP], [0x0bc0, 0], &[LOW]),
    Family::new("modified immediate", [0xf000, 0], [0x05f0, 0x70ff], &[N, D]).when(operation),
    Family::new("move modified immediate", [0xf04f, 0], [0x0430, 0x70ff], &[D]),
    Family::new("test immediate", [0xf010, 0x0f00], [0x0480, 0x70ff], &[N]),
    Family::new("compare negative immediate", [0xf110, 0x0f00], [0x0400, 0x70ff], &[N]),
    Family::new("compare immediate", [0xf1b0, 0x0f00], [0x0400, 0x70ff], &[N]),
    Family::new("shifted register", [0xea00, 0], [0x01f0, 0x70f0], &[N, D, M]).when(operation),
    Family::new("move shifted register", [0xea4f, 0], [0x0030, 0x70f0], &[D, M]),
    Family::new("test shifted register", [0xea10, 0x0f00], [0x0080, 0x70f0], &[N, M]),
    Family::new("compare negative shifted register", [0xeb10, 0x0f00], [0, 0x70f0], &[N, M]),
    Family::new("compare shifted register", [0xebb0, 0x0f00], [0, 0x70f0], &[N, M]),
    Family::new("pack halves", [0xeac0, 0], [0, 0x70e0], &[N, D, M]),
    Family::new("add wide immediate", [0xf200, 0], [0x0400, 0x70ff], &[N, D]),
    Family::new("subtract wide immediate", [0xf2a0, 0], [0x0400, 0x70ff], &[N, D]),
    Family::new("move half", [0xf240, 0], [0x048f, 0x70ff], &[D]),
    Family::new("bit field extract", [0xf340, 0], [0x0080, 0x70df], &[N, D])
        .when(|_, second| (bits(second, 14, 12) << 2 | bits(second, 7, 6)) + bits(second, 4, 0) < 32),
    Family::new("bit field insert", [0xf360, 0], [0, 0x70df], &[N, D])
        .when(|_, second| (bits(second, 14, 12) << 2 | bits(second, 7, 6)) <= bits(second, 4, 0)),
    Family::new("bit field clear", [0xf36f, 0], [0, 0x70df], &[D])
        .when(|_, second| (bits(second, 14, 12) << 2 | bits(second, 7, 6)) <= bits(second, 4, 0)),
    // The 16-bit forms take the place of an arithmetic shift by zero, and saturate to fewer bits.
    Family::new("saturate", [0xf300, 0], [0x00a0, 0x70df], &[N, D])
        .when(|first, second| bits(first, 5, 5) == 0 || second & 0x70c0 != 0 || bits(second, 4, 4) == 0),
    Family::new("extend and add", [0xfa00, 0xf080], [0x0070, 0x0030], &[N, D, M])
        .when(|first, _| bits(first, 6, 4) <= 5),
    Family::new("extend", [0xfa0f, 0xf080], [0x0070, 0x0030], &[D, M]).when(|first, _| bits(first, 6, 4) <= 5),
    Family::new("shift by register", [0xfa00, 0xf000], [0x0070, 0], &[N, D, M]),
    Family::new("parallel", [0xfa80, 0xf000], [0x0070, 0x0070], &[N, D, M])
        .when(|first, second| bits(first, 5, 4) < 3 && bits(second, 5, 4) < 3),
    Family::new("saturating sums", [0xfa80, 0xf080], [0, 0x0030], &[N, D, M]),
    Family::new("multiply", [0xfb00, 0xf000], [0x0070, 0x0030], &[N, D, M]).when(|first, second| {
        match (bits(first, 6, 4), bits(second, 5, 4)) {
            (0 | 7, option) => option == 0,
            (1, _) => true,
            (operation, option) => operation != 6 && option < 2,
        }
    }),
    Family::new("multiply and accumulate", [0xfb00, 0], [0x0070, 0x0030], &[N, D, M, T]).when(|first, second| {
        match (bits(first, 6, 4), bits(second, 5, 4)) {
            (7, option) => option == 0,
            (1, _) => true,
            (_, option) => option < 2,
        }
    }),
    Family::new("long multiply", [0xfb80, 0], [0x0070, 0x00f0], &[N, D, M, T]).when(|first, second| {
        let defined =
            matches!((bits(first, 6, 4), bits(second, 7, 4)), (0 | 2 | 4 | 6, 0) | (4, 8..=13) | (5, 12 | 13) | (6, 6));
        defined && bits(second, 11, 8) != bits(second, 15, 12)
    }),
    Family::new("divide", [0xfb90, 0xf0f0], [0x0020, 0], &[N, D, M]),
    Family::new("load and store with offset", [0xf885, 0], [0x0170, 0x001f], &[T]).when(single),
    Family::new("load and store indexed", [0xf805, 0x0800], [0x0170, 0x071f], &[T]).when(single),
    Family::new("load and store dual", [0xe845, 0], [0x01b0, 0x0007], &[T, D])
        .when(|first, second| first & 0x0120 != 0 && bits(second, 15, 12) != bits(second, 11, 8)),
    Family::new("load and store multiple up", [0xe885, 0], [0x0030, 0x001f], &[])
        .when(|_, second| second.count_ones() > 1),
    Family::new("load and store multiple down", [0xe905, 0], [0x0030, 0x001f], &[])
        .when(|_, second| second.count_ones() > 1),
];

pub const FLOAT: &[Family] = &[
    Family::new("float arithmetic", [0xee00, 0x0a00], [0x00f0, 0x00e0], &[VN, VD, VM]).when(|first, second| {
        match (bits(first, 7, 7), bits(first, 5, 4)) {
            (1, 0) => bits(second, 6, 6) == 0,
            (1, 3) => false,
            _ => true,
        }
    }),
    Family::new("float with one operand", [0xeeb0, 0x0a40], [0x004f, 0x00a0], &[VD, VM]).when(
        |first, second| match bits(first, 3, 0) {
            0..=4 | 8 | 12 | 13 => true,
            5 => second & 0x2f == 0,
            _ => false,
        },
    ),
    Family::new("float and fixed point", [0xeeba, 0x0a40], [0x0045, 0x00af], &[VD]).when(|_, second| {
        let size = if bits(second, 7, 7) != 0 { 32 } else { 16 };
        bits(second, 3, 0) << 1 | bits(second, 5, 5) <= size
    }),
    Family::new("float immediate", [0xeeb0, 0x0a00], [0x004f, 0x000f], &[VD]),
    Family::new("float to and from core", [0xee00, 0x0a10], [0x0010, 0x0080], &[VN, T]),
];
