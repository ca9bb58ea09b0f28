//! The calibration's tables in the rig file: `[calibration_sigma]`, or `[calibration]` with a covariance.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use vergence_vision::{Angle, Length};

use super::{CalibratedNumbers, InvalidCovariance, RigCalibration, RigNumber};
use crate::file::RigError;
use crate::repeatability::Repeatability;
use crate::rig::Rig;
use crate::text::quantity;

/// The version that this program writes, and the latest that it reads.
const VERSION: u32 = 1;

/// Standard deviations of each component of the relative pose.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SigmaFile {
    #[serde(deserialize_with = "quantity")]
    rotation: Angle,
    #[serde(deserialize_with = "quantity")]
    translation: Length,
}

/// The covariance of the rig's numbers.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct CalibrationTables {
    version: u32,
    /// Names of the numbers.
    numbers: Vec<String>,
    /// Lower triangle: row i holds the covariances of number i with the numbers 0 to i.
    covariance: Vec<Vec<f64>>,
}

impl SigmaFile {
    pub(crate) fn calibration(&self) -> Result<RigCalibration, RigError> {
        let (rotation, translation) = self.checked("calibration_sigma")?;
        Ok(RigCalibration::Sigmas { rotation, translation })
    }

    pub(crate) fn repeatability(&self) -> Result<Repeatability, RigError> {
        let (rotation, translation) = self.checked("repeatability")?;
        Ok(Repeatability { rotation, translation })
    }

    fn checked(&self, table: &str) -> Result<(Angle, Length), RigError> {
        let (rotation, translation) = (self.rotation, self.translation);
        if rotation.rad() < 0.0 || translation.mm() < 0.0 {
            return Err(contradiction(format!(
                "[{table}] has rotation {rotation} and translation {translation}: a standard deviation cannot be negative"
            )));
        }
        Ok((rotation, translation))
    }
}

impl CalibrationTables {
    /// The covariance of `rig`, checked against its screws and axes.
    pub(crate) fn calibration(&self, rig: &Rig) -> Result<RigCalibration, RigError> {
        let place = "[calibration]";
        if self.version != VERSION {
            let version = self.version;
            return Err(contradiction(format!(
                "{place} has version {version}; this program reads version {VERSION}: use the program that wrote it, or calibrate anew"
            )));
        }
        let number = |name: &String| {
            RigNumber::named(name, rig)
                .ok_or_else(|| contradiction(format!("{place} numbers: the rig has no number '{name}'")))
        };
        let numbers = self.numbers.iter().map(number).collect::<Result<Vec<_>, _>>()?;
        let refused = |error: &InvalidCovariance| {
            contradiction(format!("{place} covariance: {error}; let 'vergence calibrate' write it anew"))
        };
        let rows = &self.covariance;
        if rows.len() != numbers.len() || rows.iter().enumerate().any(|(row, values)| values.len() != row + 1) {
            return Err(refused(&InvalidCovariance::Shape(numbers.len())));
        }
        let covariance = DMatrix::from_fn(numbers.len(), numbers.len(), |i, j| rows[i.max(j)][i.min(j)]);
        if let Some(twice) = self.numbers.iter().enumerate().find(|(index, name)| self.numbers[..*index].contains(name))
        {
            return Err(refused(&InvalidCovariance::Twice(twice.1.clone())));
        }
        CalibratedNumbers::new(numbers, covariance).map(RigCalibration::Covariance).map_err(|error| refused(&error))
    }

    /// The table of `rig`, where its calibration has a covariance.
    pub(crate) fn of(rig: &Rig) -> Option<Self> {
        let RigCalibration::Covariance(found) = &rig.calibration else { return None };
        let covariance = found.covariance();
        let row = |row: usize| (0..=row).map(|column| covariance[(row, column)]).collect();
        Some(Self {
            version: VERSION,
            numbers: found.numbers().iter().map(|number| number.name(rig)).collect(),
            covariance: (0..covariance.nrows()).map(row).collect(),
        })
    }
}

fn contradiction(text: String) -> RigError {
    RigError::Contradiction(text)
}
