//! The dictionaries of ArUco markers that OpenCV has, by OpenCV's names.
//!
//! S. Garrido-Jurado et al., "Automatic generation and detection of highly reliable fiducial markers under occlusion", Pattern
//! Recognition 47(6), 2014. The bits are those that OpenCV 5.0 prints (Apache-2.0, `tests/opencv_targets/dictionaries.py`). A
//! dictionary of fewer markers is the beginning of that of a thousand.

use super::TagFamily;
use super::codes::decode;

static MARKERS_4X4: [u64; 1000] = decode(include_str!("dict_4x4_1000.txt"), 4);
static MARKERS_5X5: [u64; 1000] = decode(include_str!("dict_5x5_1000.txt"), 7);
static MARKERS_6X6: [u64; 1000] = decode(include_str!("dict_6x6_1000.txt"), 9);
static MARKERS_7X7: [u64; 1000] = decode(include_str!("dict_7x7_1000.txt"), 13);

const fn dictionary(name: &'static str, side: u32, all: &'static [u64], markers: usize, correctable: u32) -> TagFamily {
    TagFamily { name, side, codes: all.split_at(markers).0, correctable }
}

/// By cells along a side, then by number of markers. Correctable are as many cells as less than half the distance of the
/// dictionary's markers, but 3 at most, as for AprilTags.
static DICTIONARIES: [TagFamily; 16] = [
    dictionary("DICT_4X4_50", 4, &MARKERS_4X4, 50, 1),
    dictionary("DICT_4X4_100", 4, &MARKERS_4X4, 100, 1),
    dictionary("DICT_4X4_250", 4, &MARKERS_4X4, 250, 1),
    dictionary("DICT_4X4_1000", 4, &MARKERS_4X4, 1000, 0),
    dictionary("DICT_5X5_50", 5, &MARKERS_5X5, 50, 3),
    dictionary("DICT_5X5_100", 5, &MARKERS_5X5, 100, 3),
    dictionary("DICT_5X5_250", 5, &MARKERS_5X5, 250, 2),
    dictionary("DICT_5X5_1000", 5, &MARKERS_5X5, 1000, 2),
    dictionary("DICT_6X6_50", 6, &MARKERS_6X6, 50, 3),
    dictionary("DICT_6X6_100", 6, &MARKERS_6X6, 100, 3),
    dictionary("DICT_6X6_250", 6, &MARKERS_6X6, 250, 3),
    dictionary("DICT_6X6_1000", 6, &MARKERS_6X6, 1000, 3),
    dictionary("DICT_7X7_50", 7, &MARKERS_7X7, 50, 3),
    dictionary("DICT_7X7_100", 7, &MARKERS_7X7, 100, 3),
    dictionary("DICT_7X7_250", 7, &MARKERS_7X7, 250, 3),
    dictionary("DICT_7X7_1000", 7, &MARKERS_7X7, 1000, 3),
];

impl TagFamily {
    /// The dictionaries of ArUco markers: OpenCV's `DICT_4X4_50` to `DICT_7X7_1000`.
    #[must_use]
    pub const fn dictionaries() -> &'static [Self] {
        &DICTIONARIES
    }

    /// The dictionary of ArUco markers that OpenCV calls `name`.
    #[must_use]
    pub fn dictionary(name: &str) -> Option<Self> {
        DICTIONARIES.iter().copied().find(|dictionary| dictionary.name == name)
    }
}
