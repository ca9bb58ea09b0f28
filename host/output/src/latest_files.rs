//! The files of the live loop: always the newest result, or one for every result.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use image::RgbImage;
use vergence_files::{FileError, write_png, write_whole};
use vergence_pipeline::{Bearing, ColouredPoint, DenseRanges, LiveDense};
use vergence_rig::{Rig, RigPose};

use crate::dense_cloud::dense_rows;
use crate::pictures::{range_image, sigma_image};
use crate::{CloudEncoding, CloudFormat, OutputError, Table, TableFormat};

/// Names of the images of ranges and of their standard deviations.
const DENSE_IMAGES: [&str; 2] = ["dense-range", "dense-sigma"];

/// Where results go as files.
///
/// In a folder, `cloud.ply` (or `.pcd`, `.las`, `.e57`) is always the newest cloud, written whole; it is removed while one camera is dead, so that nobody takes an old cloud for a
/// new one, and `bearings.csv` is written instead. Where every pixel is measured, `dense.ply`, `dense-range.png` and `dense-sigma.png` are beside it, and are removed
/// while there are none.
#[derive(Clone, Debug)]
pub struct LatestFiles {
    /// The folder; `None` writes nothing.
    pub folder: Option<PathBuf>,
    /// Write a numbered file for every result, instead of one file with the newest.
    pub keep: bool,
    /// The format of clouds.
    pub format: CloudFormat,
    /// Tables beside the clouds.
    pub also: Vec<TableFormat>,
    /// How clouds are written.
    pub encoding: CloudEncoding,
}

impl LatestFiles {
    /// Writes the points of result `number`, and the ranges of all its pixels, made by `pose` of `rig`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_pair(
        &self,
        number: u64,
        (points, dense): (&[ColouredPoint], Option<&LiveDense>),
        made_by: (&Rig, &RigPose),
    ) -> Result<(), OutputError> {
        self.write_cloud(number, points)?;
        match dense {
            Some(LiveDense { ranges: Some(ranges), left, .. }) => self.write_dense(number, (ranges, left), made_by),
            _ => self.withdraw_dense(),
        }
    }

    /// Writes the cloud of all pixels, and their ranges and standard deviations as images.
    fn write_dense(
        &self,
        number: u64,
        (ranges, left): (&DenseRanges, &RgbImage),
        made_by: (&Rig, &RigPose),
    ) -> Result<(), OutputError> {
        let Some(folder) = &self.folder else { return Ok(()) };
        let rows = dense_rows(&ranges.depth, left, made_by);
        let file = self.file(folder, ("dense", number), self.format.ending());
        let bytes = self.format.dense_cloud(&rows, self.encoding).map_err(|error| FileError::write(&file, error))?;
        write_whole(&file, &bytes)?;
        write_png(&self.file(folder, (DENSE_IMAGES[0], number), "png"), &range_image(&ranges.depth))?;
        Ok(write_png(&self.file(folder, (DENSE_IMAGES[1], number), "png"), &sigma_image(&ranges.depth))?)
    }

    fn withdraw_dense(&self) -> Result<(), OutputError> {
        let Some(folder) = &self.folder else { return Ok(()) };
        self.withdraw(folder, "dense", &CloudFormat::ENDINGS)?;
        DENSE_IMAGES.iter().try_for_each(|image| self.withdraw(folder, image, &["png"]))
    }

    /// Writes the cloud of result `number`.
    fn write_cloud(&self, number: u64, points: &[ColouredPoint]) -> Result<(), OutputError> {
        let Some(folder) = &self.folder else { return Ok(()) };
        self.withdraw(folder, "bearings", &["csv", "json"])?;
        let others: Vec<_> =
            CloudFormat::ENDINGS.into_iter().filter(|&ending| ending != self.format.ending()).collect();
        self.withdraw(folder, "cloud", &others)?;
        let file = self.file(folder, ("cloud", number), self.format.ending());
        let bytes = self.format.cloud(points, self.encoding).map_err(|error| FileError::write(&file, error))?;
        write_whole(&file, &bytes)?;
        self.write_tables(folder, ("cloud", number), &Table::of_points(points), &self.also)
    }

    /// Writes the bearings of result `number`.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write_bearings(&self, number: u64, bearings: &[Bearing]) -> Result<(), OutputError> {
        let Some(folder) = &self.folder else { return Ok(()) };
        self.withdraw(folder, "cloud", &CloudFormat::ENDINGS)?;
        self.withdraw(folder, "cloud", &["csv", "json"])?;
        self.withdraw_dense()?;
        let formats = if self.also.is_empty() { &[TableFormat::Csv][..] } else { &self.also };
        self.write_tables(folder, ("bearings", number), &Table::of_bearings(bearings), formats)
    }

    fn write_tables(
        &self,
        folder: &Path,
        name: (&str, u64),
        table: &Table,
        formats: &[TableFormat],
    ) -> Result<(), OutputError> {
        formats.iter().try_for_each(|&format| {
            Ok(write_whole(&self.file(folder, name, format.extension()), table.text(format).as_bytes())?)
        })
    }

    fn file(&self, folder: &Path, (stem, number): (&str, u64), extension: &str) -> PathBuf {
        match self.keep {
            true => folder.join(format!("{stem}{number:06}.{extension}")),
            false => folder.join(format!("{stem}.{extension}")),
        }
    }

    /// Removes files that are no longer the newest result.
    fn withdraw(&self, folder: &Path, stem: &str, extensions: &[&str]) -> Result<(), OutputError> {
        if self.keep {
            return Ok(());
        }
        for extension in extensions {
            let path = folder.join(format!("{stem}.{extension}"));
            match std::fs::remove_file(&path) {
                Err(error) if error.kind() != ErrorKind::NotFound => return Err(FileError::write(&path, error).into()),
                _ => {}
            }
        }
        Ok(())
    }
}
