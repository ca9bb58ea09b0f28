//! Square tags with a code of black and white cells.

mod codes;
mod dictionaries;
mod quads;
mod read;

pub use quads::{Quad, dark_quads};
pub use read::{TagPlace, read_tag};

/// A family of tags: square codes with a black border.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TagFamily {
    /// Name: OpenCV's, such as `DICT_4X4_50`, or `tag36h11`.
    pub name: &'static str,
    /// Cells along a side of the code, without its border.
    pub side: u32,
    /// The codes by number: cells row by row from the upper left, the first one the highest bit, 1 is white.
    pub codes: &'static [u64],
    /// Most wrong cells of a code that is accepted: less than half the distance of the family's codes.
    pub correctable: u32,
}

/// A code that was read: which one, and how it stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ReadCode {
    /// Number of the code in its family.
    pub id: u32,
    /// Quarters by which the tag stands turned clockwise, as seen.
    pub quarters: usize,
}

impl TagFamily {
    /// Kalibr's: AprilTag's 36h11, whose codes differ in 11 cells at least however they are turned.
    pub const TAG_36H11: Self = Self { name: "tag36h11", side: 6, codes: &codes::TAG_36H11, correctable: 3 };

    /// The code with number below `most` that differs in the fewest cells from `seen`, if these are few enough.
    #[must_use]
    pub fn read(&self, seen: u64, most: u32) -> Option<ReadCode> {
        let upright: Vec<u64> =
            (0..4).scan(seen, |code, _| Some(std::mem::replace(code, self.turned_back(*code)))).collect();
        let known = self.codes.iter().take(most as usize).zip(0..);
        let read = known.flat_map(|(code, id)| {
            let differing =
                upright.iter().enumerate().map(move |(quarters, seen)| ((code ^ seen).count_ones(), quarters));
            differing.map(move |(wrong, quarters)| (wrong, ReadCode { id, quarters }))
        });
        read.min_by_key(|(wrong, _)| *wrong).filter(|(wrong, _)| *wrong <= self.correctable).map(|(_, code)| code)
    }

    /// Whether the cell in `column` and `row` of a code is white.
    #[must_use]
    pub fn is_white(&self, code: u64, column: u32, row: u32) -> bool {
        code >> (self.side * self.side - 1 - row * self.side - column) & 1 == 1
    }

    /// The black cells of a tag with a border of so many cells: x, y, width and height in cells from its upper left corner.
    /// Neighbouring cells of a row make one rectangle: no seams in print.
    pub(crate) fn black_cells(&self, code: u64, border: u32) -> Vec<[f64; 4]> {
        let across = self.side + 2 * border;
        let inner = border..across - border;
        let is_black = |column: u32, row: u32| {
            let inside = inner.contains(&column) && inner.contains(&row);
            !inside || !self.is_white(code, column - border, row - border)
        };
        let mut black = Vec::new();
        for row in 0..across {
            let mut column = 0;
            while column < across {
                let run = (column..across).take_while(|column| is_black(*column, row)).count() as u32;
                if run > 0 {
                    black.push([f64::from(column), f64::from(row), f64::from(run), 1.0]);
                }
                column += run.max(1);
            }
        }
        black
    }

    /// `code` after a quarter turn against the clock.
    fn turned_back(&self, code: u64) -> u64 {
        let last = self.side - 1;
        let cells = (0..self.side).flat_map(|row| (0..self.side).map(move |column| (column, row)));
        // The new upper left cell is the old upper right one.
        cells.fold(0, |turned, (column, row)| turned << 1 | u64::from(self.is_white(code, last - row, column)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tag_is_read_however_it_stands_and_with_wrong_cells() {
        let family = TagFamily::TAG_36H11;
        for (id, &code) in (0..).zip(family.codes) {
            let mut turned = code;
            for back in 0..4 {
                let read = ReadCode { id, quarters: (4 - back) % 4 };
                assert_eq!(family.read(turned, 587), Some(read));
                assert_eq!(family.read(turned ^ 0b1001_0000_0010, 587), Some(read));
                assert_eq!(family.read(turned ^ 0b1001_0000_0010, id), None);
                turned = family.turned_back(turned);
            }
        }
    }
}
