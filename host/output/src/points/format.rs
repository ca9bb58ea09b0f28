//! Formats of a cloud's file.

use std::path::Path;

use vergence_pipeline::ColouredPoint;

use super::columns::DenseRow;
use super::e57::{dense_e57, sparse_e57};
use super::las::{dense_las, sparse_las};
use super::pcd::{dense_pcd, pcd};
use super::ply::{dense_ply, ply};
use crate::endings::check_ending;
use crate::error::OutputError;

/// How the numbers of a cloud are written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum CloudEncoding {
    /// Little-endian.
    #[default]
    Binary,
    /// As text.
    Ascii,
}

/// Why a cloud is not written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CloudError {
    /// The format has no text.
    #[error("a cloud in .{0} has no form as text: leave out --ascii, or name one in .ply or .pcd")]
    NoText(&'static str),
    /// The encoder refused it.
    #[error("the cloud cannot be encoded: {0}")]
    Encoder(String),
}

impl CloudError {
    fn encoder(error: impl std::fmt::Display) -> Self {
        Self::Encoder(error.to_string())
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
    /// The format of the American Society for Photogrammetry, version 1.4.
    Las,
    /// The format of ASTM E2807, in metres.
    E57,
}

impl CloudFormat {
    /// The endings of all formats, without the dot.
    pub const ENDINGS: [&str; 4] = [Self::Ply.ending(), Self::Pcd.ending(), Self::Las.ending(), Self::E57.ending()];
    const ALL: [Self; 4] = [Self::Ply, Self::Pcd, Self::Las, Self::E57];

    /// The format of a file with this ending, in upper or lower case; PLY where it is none of [`Self::ENDINGS`].
    #[must_use]
    pub fn of_ending(ending: &str) -> Self {
        Self::ALL.into_iter().find(|format| ending.eq_ignore_ascii_case(format.ending())).unwrap_or_default()
    }

    /// The format that the ending of `path` says, as [`Self::of_ending`].
    #[must_use]
    pub fn of_file(path: &Path) -> Self {
        Self::of_ending(&path.extension().unwrap_or_default().to_string_lossy())
    }

    /// Checks that the ending of `path` says a format, and one that has text where the file shall be text.
    ///
    /// # Errors
    /// Names the endings that are known; [`CloudError::NoText`].
    pub fn check_name(path: &Path, is_ascii: bool) -> Result<(), OutputError> {
        let ending = check_ending(path, &Self::ENDINGS)?;
        Ok(Self::of_ending(ending).encoding(is_ascii).map(drop)?)
    }

    /// The ending of a file in this format, without the dot.
    #[must_use]
    pub const fn ending(self) -> &'static str {
        match self {
            Self::Ply => "ply",
            Self::Pcd => "pcd",
            Self::Las => "las",
            Self::E57 => "e57",
        }
    }

    /// How the numbers are written: as text where it `is_ascii`.
    ///
    /// # Errors
    /// [`CloudError::NoText`].
    pub fn encoding(self, is_ascii: bool) -> Result<CloudEncoding, CloudError> {
        match (self, is_ascii) {
            (_, false) => Ok(CloudEncoding::Binary),
            (Self::Ply | Self::Pcd, true) => Ok(CloudEncoding::Ascii),
            (Self::Las | Self::E57, true) => Err(CloudError::NoText(self.ending())),
        }
    }

    /// The file of a cloud: points in the left camera's frame in millimetres (metres in E57), with colour, pixels, uncertainty and track.
    ///
    /// # Errors
    /// [`CloudError`].
    pub fn cloud(self, points: &[ColouredPoint], encoding: CloudEncoding) -> Result<Vec<u8>, CloudError> {
        match (self, encoding) {
            (Self::Ply, _) => Ok(ply(points, encoding)),
            (Self::Pcd, _) => Ok(pcd(points, encoding)),
            (Self::Las, CloudEncoding::Binary) => sparse_las(points).map_err(CloudError::encoder),
            (Self::E57, CloudEncoding::Binary) => sparse_e57(points).map_err(CloudError::encoder),
            (Self::Las | Self::E57, CloudEncoding::Ascii) => Err(CloudError::NoText(self.ending())),
        }
    }

    /// The file of a dense cloud.
    ///
    /// # Errors
    /// [`CloudError`].
    pub fn dense_cloud(self, rows: &[DenseRow], encoding: CloudEncoding) -> Result<Vec<u8>, CloudError> {
        match (self, encoding) {
            (Self::Ply, _) => Ok(dense_ply(rows, encoding)),
            (Self::Pcd, _) => Ok(dense_pcd(rows, encoding)),
            (Self::Las, CloudEncoding::Binary) => dense_las(rows).map_err(CloudError::encoder),
            (Self::E57, CloudEncoding::Binary) => dense_e57(rows).map_err(CloudError::encoder),
            (Self::Las | Self::E57, CloudEncoding::Ascii) => Err(CloudError::NoText(self.ending())),
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
