//! Formats of a cloud's file.

use std::path::Path;

use vergence_pipeline::ColouredPoint;

use super::columns::DenseRow;
use super::pcd::{dense_pcd, pcd};
use super::ply::{dense_ply, ply};

/// How the numbers of a cloud are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CloudEncoding {
    /// Little-endian.
    #[default]
    Binary,
    /// As text.
    Ascii,
}

impl CloudEncoding {
    /// Text where it `is_ascii`.
    #[must_use]
    pub const fn of(is_ascii: bool) -> Self {
        if is_ascii { Self::Ascii } else { Self::Binary }
    }
}

/// The format of a cloud's file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CloudFormat {
    /// G. Turk's polygon format, Stanford 1994.
    #[default]
    Ply,
    /// The Point Cloud Library's format, version 0.7.
    Pcd,
}

impl CloudFormat {
    /// The endings of all formats, without the dot.
    pub const ENDINGS: [&str; 2] = [Self::Ply.ending(), Self::Pcd.ending()];

    /// The format of a file with this ending, in upper or lower case; PLY where it is none of [`Self::ENDINGS`].
    #[must_use]
    pub fn of_ending(ending: &str) -> Self {
        if ending.eq_ignore_ascii_case(Self::Pcd.ending()) { Self::Pcd } else { Self::Ply }
    }

    /// The format that the ending of `path` says, as [`Self::of_ending`].
    #[must_use]
    pub fn of_file(path: &Path) -> Self {
        Self::of_ending(&path.extension().unwrap_or_default().to_string_lossy())
    }

    /// The ending of a file in this format, without the dot.
    #[must_use]
    pub const fn ending(self) -> &'static str {
        match self {
            Self::Ply => "ply",
            Self::Pcd => "pcd",
        }
    }

    /// The file of a cloud: points in the left camera's frame in millimetres, with colour, pixels, uncertainty and track.
    #[must_use]
    pub fn cloud(self, points: &[ColouredPoint], encoding: CloudEncoding) -> Vec<u8> {
        match self {
            Self::Ply => ply(points, encoding),
            Self::Pcd => pcd(points, encoding),
        }
    }

    /// The file of a dense cloud, binary.
    #[must_use]
    pub fn dense_cloud(self, rows: &[DenseRow]) -> Vec<u8> {
        match self {
            Self::Ply => dense_ply(rows),
            Self::Pcd => dense_pcd(rows),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_says_the_format() {
        for ending in CloudFormat::ENDINGS {
            let file = format!("clouds.pcd/a.{}", ending.to_uppercase());
            assert_eq!(CloudFormat::of_file(Path::new(&file)).ending(), ending);
        }
    }
}
