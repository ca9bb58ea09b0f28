//! A sheet of paper with a calibration target, as SVG and as PDF: both in true size.

use std::fmt::Write;

use crate::error::OutputError;

/// A printed target in the middle of a sheet, and a ruler. All lengths are millimetres, from the top left corner of the sheet.
#[derive(Clone, Debug)]
pub struct Sheet {
    /// Width and height of the sheet.
    pub size: (f64, f64),
    /// Black rectangles of the target: left, top, width, height.
    pub black: Vec<[f64; 4]>,
    /// What is printed at the lower edge.
    pub label: String,
}

/// Height of the label's letters, and how far its base line is above the lower edge.
const LETTERS: f64 = 3.0;
const LABEL_ABOVE: f64 = 2.0;
/// Distance of the label and the ruler from the sides of the sheet.
const ASIDE: f64 = 10.0;
/// Length of the ruler, and height and width of its marks, of which one is at every centimetre.
const RULER: f64 = 100.0;
const MARK: [f64; 2] = [2.0, 0.2];

impl Sheet {
    /// A target of the black rectangles `black` (left, top, width, height), which with its white border is `needed` wide and
    /// high, on `paper`. `label` names it, in ASCII letters.
    ///
    /// # Errors
    /// [`OutputError::SmallSheet`] where the target does not fit.
    pub fn with_target(paper: Paper, black: &[[f64; 4]], needed: [f64; 2], label: String) -> Result<Self, OutputError> {
        let (width, height) = paper.size();
        if needed[0] > width || needed[1] > height {
            return Err(OutputError::SmallSheet { target: label, needed: needed.into(), paper, size: (width, height) });
        }
        let (left, top) = (0.5 * (width - needed[0]), 0.5 * (height - needed[1]));
        let black = black.iter().map(|[x, y, width, height]| [left + x, top + y, *width, *height]).collect();
        Ok(Self { size: (width, height), black, label })
    }

    /// The sheet as SVG.
    #[must_use]
    pub fn svg(&self) -> String {
        let (width, height) = self.size;
        let mut text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}mm\" height=\"{height}mm\" viewBox=\"0 0 {width} {height}\">\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n<g fill=\"black\" shape-rendering=\"crispEdges\">\n"
        );
        let write = |text: &mut String, rectangles: &[[f64; 4]]| {
            for rectangle in rectangles {
                let [x, y, width, height] = rectangle.map(in_print);
                let _ = writeln!(text, "<rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"/>");
            }
        };
        write(&mut text, &self.black);
        text.push_str("</g>\n<g fill=\"#888\">\n");
        write(&mut text, &self.ruler());
        let _ = writeln!(
            text,
            "</g>\n<text x=\"{ASIDE}\" y=\"{}\" font-family=\"sans-serif\" font-size=\"{LETTERS}\" fill=\"#888\">{}</text>\n</svg>",
            height - LABEL_ABOVE,
            self.text()
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
        let write = |drawing: &mut String, rectangles: &[[f64; 4]]| {
            for [x, y, wide, high] in rectangles {
                let _ = writeln!(drawing, "{x:.3} {:.3} {wide:.3} {high:.3} re", height - y - high);
            }
        };
        write(&mut drawing, &self.black);
        drawing.push_str("f\n0.53 g\n");
        write(&mut drawing, &self.ruler());
        // A string holds no parentheses or backslashes unless escaped; the label has none.
        let _ = write!(drawing, "f\nBT /F1 {LETTERS} Tf {ASIDE} {LABEL_ABOVE} Td ({}) Tj ET", self.text());
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

    fn text(&self) -> String {
        format!("{}; the ruler is {RULER} mm long", self.label)
    }

    /// A line with marks at the lower edge, on the right.
    fn ruler(&self) -> Vec<[f64; 4]> {
        let [high, thick] = MARK;
        let (left, bottom) = (self.size.0 - ASIDE - RULER, self.size.1 - LABEL_ABOVE);
        // The marks' outer edges at both ends are the length apart.
        let marks = (0..=10).map(|mark| [left + f64::from(mark) * (RULER - thick) / 10.0, bottom - high, thick, high]);
        [[left, bottom - thick, RULER, thick]].into_iter().chain(marks).collect()
    }
}

/// A length as it is written: without the rounding of its last digits.
fn in_print(mm: f64) -> f64 {
    (mm * 1e6).round() / 1e6
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
        let squares = (0..7).flat_map(|row| (0..10).map(move |column| (column, row)));
        let black = squares.filter(|(column, row)| (column + row) % 2 == 0);
        let black: Vec<_> =
            black.map(|(x, y)| [25.0 * f64::from(x) + 12.5, 25.0 * f64::from(y) + 12.5, 25.0, 25.0]).collect();
        Sheet::with_target(Paper::A4, &black, [275.0, 200.0], "9x6 inner corners".into()).unwrap()
    }

    #[test]
    fn the_pdf_has_every_black_square_and_a_table_that_is_right() {
        let file = String::from_utf8(sheet().pdf()).unwrap();
        let squares: Vec<&str> = file.lines().filter(|line| line.ends_with("25.000 re")).collect();
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
        let svg = sheet().svg();
        assert_eq!(svg.matches("width=\"25\" height=\"25\"").count(), 35);
        assert_eq!(svg.matches("width=\"100\"").count(), 1, "the ruler");
    }
}
