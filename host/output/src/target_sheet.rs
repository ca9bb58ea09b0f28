//! A sheet of paper with a chessboard, as SVG and as PDF: both in true size.

use std::fmt::Write;

use vergence_vision::Length;

use crate::error::OutputError;

/// A chessboard in the middle of a sheet. All lengths are millimetres, from the top left corner of the sheet.
#[derive(Clone, Debug)]
pub struct Sheet {
    /// Width and height of the sheet.
    pub size: (f64, f64),
    /// Squares side by side: columns and rows.
    pub squares: (u32, u32),
    /// Side of a square.
    pub side: f64,
    /// What is printed at the lower edge.
    pub label: String,
}

/// Height of the label's letters, and how far its base line is above the lower edge.
const LETTERS: f64 = 3.0;
const LABEL_ABOVE: f64 = 2.0;

impl Sheet {
    /// A chessboard with so many inner corners (columns, rows) and squares of the side `square` on `paper`, with the white
    /// border that detectors need.
    ///
    /// # Errors
    /// [`OutputError::Square`] where the square has no size, [`OutputError::SmallSheet`] where the board does not fit.
    pub fn with_target(paper: Paper, (columns, rows): (u32, u32), square: Length) -> Result<Self, OutputError> {
        let (width, height) = paper.size();
        let side = square.mm();
        if side.is_nan() || side <= 0.0 {
            return Err(OutputError::Square(square));
        }
        // The squares around the inner corners, and a white border of half a square.
        let needed = (side * (f64::from(columns) + 2.0), side * (f64::from(rows) + 2.0));
        if needed.0 > width || needed.1 > height {
            return Err(OutputError::SmallSheet { columns, rows, side, needed, paper, size: (width, height) });
        }
        Ok(Self {
            size: (width, height),
            squares: (columns + 1, rows + 1),
            side,
            label: format!("{columns}x{rows} inner corners, {side} mm squares"),
        })
    }

    /// The sheet as SVG.
    #[must_use]
    pub fn svg(&self) -> String {
        let (width, height) = self.size;
        let mut text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}mm\" height=\"{height}mm\" viewBox=\"0 0 {width} {height}\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n<g fill=\"black\" shape-rendering=\"crispEdges\">\n"
        );
        let side = self.side;
        for (x, y) in self.black() {
            let _ = writeln!(text, "<rect x=\"{x}\" y=\"{y}\" width=\"{side}\" height=\"{side}\"/>");
        }
        let _ = writeln!(
            text,
            "</g>\n<text x=\"{}\" y=\"{}\" font-family=\"sans-serif\" font-size=\"{LETTERS}\" fill=\"#888\">{}</text>\n</svg>",
            self.left(),
            height - LABEL_ABOVE,
            self.label
        );
        text
    }

    /// The sheet as PDF 1.4 (ISO 32000-1): one page with filled rectangles, exact to a thousandth of a millimetre.
    #[must_use]
    pub fn pdf(&self) -> Vec<u8> {
        /// PDF counts in points of 1/72 inch.
        const POINTS_PER_MM: f64 = 72.0 / 25.4;
        let (width, height) = self.size;
        // Millimetres from here on; y points upwards.
        let mut drawing = format!("{POINTS_PER_MM:.9} 0 0 {POINTS_PER_MM:.9} 0 0 cm\n0 g\n");
        for (x, y) in self.black() {
            let _ = writeln!(drawing, "{x:.3} {:.3} {side:.3} {side:.3} re", height - y - self.side, side = self.side);
        }
        // A string holds no parentheses or backslashes unless escaped; the label has none.
        let _ = write!(
            drawing,
            "f\n0.53 g\nBT /F1 {LETTERS} Tf {:.3} {LABEL_ABOVE} Td ({}) Tj ET",
            self.left(),
            self.label
        );
        let page = format!(
            "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {:.3} {:.3}] /Contents 4 0 R /Resources << /Font << /F1 5 0 R >> >> >>",
            width * POINTS_PER_MM,
            height * POINTS_PER_MM
        );
        document(&[
            "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>".into(),
            "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".into(),
            page,
            format!("<< /Length {} >>\nstream\n{drawing}\nendstream", drawing.len() + 1),
            "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>".into(),
        ])
    }

    /// Top left corners of the black squares.
    fn black(&self) -> impl Iterator<Item = (f64, f64)> {
        let (columns, rows) = self.squares;
        let (left, top, side) = (self.left(), (self.size.1 - self.side * f64::from(rows)) / 2.0, self.side);
        let places = (0..rows).flat_map(move |row| (0..columns).map(move |column| (row, column)));
        places
            .filter(|(row, column)| (row + column).is_multiple_of(2))
            .map(move |(row, column)| (left + side * f64::from(column), top + side * f64::from(row)))
    }

    fn left(&self) -> f64 {
        (self.size.0 - self.side * f64::from(self.squares.0)) / 2.0
    }
}

/// A sheet of ISO 216 whose long side lies across.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paper {
    /// 297 x 210 mm.
    A4,
    /// 420 x 297 mm.
    A3,
    /// 594 x 420 mm.
    A2,
    /// 841 x 594 mm.
    A1,
    /// 1189 x 841 mm.
    A0,
}

impl std::str::FromStr for Paper {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text.to_ascii_lowercase().as_str() {
            "a4" => Ok(Self::A4),
            "a3" => Ok(Self::A3),
            "a2" => Ok(Self::A2),
            "a1" => Ok(Self::A1),
            "a0" => Ok(Self::A0),
            _ => Err("choose A4, A3, A2, A1 or A0".into()),
        }
    }
}

impl std::fmt::Display for Paper {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::A4 => "A4",
            Self::A3 => "A3",
            Self::A2 => "A2",
            Self::A1 => "A1",
            Self::A0 => "A0",
        })
    }
}

impl Paper {
    /// Long and short side in millimetres.
    const fn size(self) -> (f64, f64) {
        match self {
            Self::A4 => (297.0, 210.0),
            Self::A3 => (420.0, 297.0),
            Self::A2 => (594.0, 420.0),
            Self::A1 => (841.0, 594.0),
            Self::A0 => (1189.0, 841.0),
        }
    }
}

/// A PDF file of `objects`, the first of which is the catalogue, with the table of their places.
fn document(objects: &[String]) -> Vec<u8> {
    let mut file = "%PDF-1.4\n".to_owned();
    let mut places = Vec::new();
    for (object, number) in objects.iter().zip(1..) {
        places.push(file.len());
        let _ = write!(file, "{number} 0 obj\n{object}\nendobj\n");
    }
    let (table, count) = (file.len(), objects.len() + 1);
    let _ = write!(file, "xref\n0 {count}\n0000000000 65535 f \n");
    for place in places {
        let _ = writeln!(file, "{place:010} 00000 n ");
    }
    let _ = write!(file, "trailer\n<< /Size {count} /Root 1 0 R >>\nstartxref\n{table}\n%%EOF\n");
    file.into_bytes()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may fail")]

    use super::*;

    fn sheet() -> Sheet {
        Sheet { size: (297.0, 210.0), squares: (10, 7), side: 25.0, label: "9x6 inner corners".into() }
    }

    #[test]
    fn the_pdf_has_every_black_square_and_a_table_that_is_right() {
        let file = String::from_utf8(sheet().pdf()).unwrap();
        let squares: Vec<&str> = file.lines().filter(|line| line.ends_with(" re")).collect();
        assert_eq!(squares.len(), 35);
        // The first square: 23.5 mm from the left, 17.5 mm from the top.
        assert_eq!(squares[0], "23.500 167.500 25.000 25.000 re");
        assert!(file.contains("/MediaBox [0 0 841.890 595.276]"), "A4 in points");
        let table = file.split("startxref\n").nth(1).unwrap().lines().next().unwrap().parse::<usize>().unwrap();
        assert!(file[table..].starts_with("xref\n0 6\n"));
        for (line, number) in file[table..].lines().skip(3).take(5).zip(1..) {
            let place: usize = line.split(' ').next().unwrap().parse().unwrap();
            assert!(file[place..].starts_with(&format!("{number} 0 obj\n")), "{line}");
        }
        let stream = file.split("stream\n").nth(1).unwrap().strip_suffix("end").unwrap();
        assert!(file.contains(&format!("/Length {} ", stream.len())), "{}", stream.len());
    }

    #[test]
    fn both_formats_have_the_same_squares() {
        assert_eq!(sheet().svg().matches("<rect x=").count(), 35);
    }
}
