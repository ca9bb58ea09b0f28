//! CSV files, with errors that name the line as an editor counts it.

use std::path::{Path, PathBuf};

use crate::InputError;

/// A CSV file that has been read. The header is line 1.
pub struct CsvFile {
    path: PathBuf,
    bytes: Vec<u8>,
}

impl CsvFile {
    /// Reads the file.
    ///
    /// # Errors
    /// Where it cannot be read.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        Ok(Self { path: path.to_owned(), bytes: vergence_files::read(path)? })
    }

    /// The rows after the header, whose cells may have blanks around them.
    pub fn reader(&self) -> csv::Reader<&[u8]> {
        csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(&self.bytes)
    }

    /// Line of the row at `position`. The reader's own line is wrong after blank lines and in files with CRLF.
    pub fn line(&self, position: &csv::Position) -> usize {
        let start = usize::try_from(position.byte()).unwrap_or(usize::MAX).min(self.bytes.len());
        let (before, after) = self.bytes.split_at(start);
        // A position may lie before the line ends that precede its row.
        let ends = after.iter().take_while(|byte| matches!(byte, b'\r' | b'\n'));
        1 + before.iter().chain(ends).filter(|byte| **byte == b'\n').count()
    }

    /// An error that is about the file.
    pub fn wrong(&self, problem: impl std::fmt::Display) -> InputError {
        InputError::wrong(&self.path, problem)
    }

    /// An error that is about the row at `position`, where that is known.
    pub fn wrong_row(&self, position: Option<&csv::Position>, problem: impl std::fmt::Display) -> InputError {
        match position {
            Some(position) => self.wrong(format!("line {}: {problem}", self.line(position))),
            None => self.wrong(problem),
        }
    }

    /// An error for one of the reader; `headers` name its columns.
    pub fn unreadable(&self, error: &csv::Error, headers: &csv::StringRecord) -> InputError {
        match error.kind() {
            csv::ErrorKind::Deserialize { pos, err } => {
                let name = err.field().and_then(|index| headers.get(usize::try_from(index).ok()?));
                let column = name.map(|name| format!("column {name}: ")).unwrap_or_default();
                self.wrong_row(pos.as_ref(), format!("{column}{}", err.kind()))
            }
            csv::ErrorKind::UnequalLengths { pos, expected_len, len } => {
                self.wrong_row(pos.as_ref(), format!("it has {len} columns, and the header has {expected_len}"))
            }
            csv::ErrorKind::Utf8 { pos, .. } => self.wrong_row(pos.as_ref(), "it is not UTF-8 text"),
            _ => self.wrong(error),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Lines of the rows of a file.
    fn lines(text: &str) -> Vec<usize> {
        let file = CsvFile { path: "points.csv".into(), bytes: text.as_bytes().to_vec() };
        let rows: Vec<csv::StringRecord> = file.reader().into_records().map(|row| row.expect("a row")).collect();
        rows.iter().map(|row| file.line(row.position().expect("a position"))).collect()
    }

    #[test]
    fn lines_are_counted_as_an_editor_does() {
        assert_eq!(lines("a,b\n1,2\n3,4\n"), [2, 3]);
        assert_eq!(lines("a,b\r\n1,2\r\n3,4\r\n"), [2, 3]);
        assert_eq!(lines("a,b\n\n1,2\n\n\n3,4"), [3, 6]);
    }
}
