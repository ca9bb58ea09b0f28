//! Options for the files of results that come one after the other.

use std::path::PathBuf;

use vergence_files::make_folder;
use vergence_output::{CloudFormat, LatestFiles, TableFormat, check_folder};

use super::options::TableOption;
use crate::failure::Failure;

/// Where results go as files.
#[derive(Debug, clap::Args)]
pub struct ResultOptions {
    /// The folder for `cloud.ply` (or `.pcd`, `.las`, `.e57`), always the newest cloud.
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Keep every cloud, in files with numbers.
    #[arg(long, requires = "out")]
    keep: bool,
    /// The format of clouds.
    #[arg(long, requires = "out", default_value = "ply", value_parser = CloudFormat::ENDINGS, value_name = "FORMAT")]
    format: String,
    /// Write points and bearings as tables too.
    #[arg(long, requires = "out", value_delimiter = ',', value_name = "FORMAT")]
    also: Vec<TableOption>,
    /// Write clouds as text, for a person to read; the default is binary.
    #[arg(long)]
    ascii: bool,
}

impl ResultOptions {
    /// Makes the folder, and says what goes there.
    ///
    /// # Errors
    /// A name that is a file's, a folder that cannot be made.
    pub fn files(&self) -> Result<LatestFiles, Failure> {
        if let Some(folder) = &self.out {
            check_folder(folder)?;
            make_folder(folder)?;
        }
        Ok(LatestFiles {
            folder: self.out.clone(),
            keep: self.keep,
            also: self.also.iter().copied().map(TableFormat::from).collect(),
            format: CloudFormat::of_ending(&self.format),
            encoding: CloudFormat::of_ending(&self.format).encoding(self.ascii)?,
        })
    }
}
