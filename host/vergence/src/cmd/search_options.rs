//! Where in both images points are sought.

use vergence_pipeline::Search;
use vergence_rig::{LensField, Rig};
use vergence_vision::Length;

use super::mask_options::MaskOptions;
use crate::failure::Failure;

/// Ranges between which points are sought, and the parts of the images that are used.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct SearchOptions {
    /// The nearest range from the left camera at which points are sought, such as 200mm. Unless given, the distance of the
    /// cameras.
    #[arg(long, value_name = "LENGTH")]
    nearest: Option<Length>,
    /// The farthest range of a point, such as 5m. Unless given, as far as the parallax of a point is larger than its error.
    #[arg(long, value_name = "LENGTH")]
    farthest: Option<Length>,
    #[command(flatten)]
    masks: MaskOptions,
    #[command(flatten)]
    field: FieldOption,
}

/// Which part of the lenses' fields is used.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub struct FieldOption {
    /// The part of each lens's field that is used: `measured`, where its calibration had corners, or `extrapolated`, all for which its
    /// model is valid. What lies beyond the measured part is marked, with the sigma that the lens's covariance gives.
    #[arg(long, value_name = "FIELD", default_value_t)]
    field: LensField,
}

impl FieldOption {
    /// The rig as it sees.
    pub fn seeing(self, rig: Rig) -> Rig {
        rig.with_field(self.field)
    }

    /// The rig to measure with.
    ///
    /// # Errors
    /// Lenses that are to be extrapolated, and nobody knows how well they are known.
    pub fn measuring(self, rig: Rig) -> Result<Rig, Failure> {
        rig.measuring_in(self.field).map_err(|error| Failure::usage(error.to_string()))
    }
}

impl SearchOptions {
    /// Whether it is said where to look.
    pub const fn is_given(&self) -> bool {
        self.nearest.is_some() || self.farthest.is_some() || self.masks.is_given()
    }

    /// The rig to measure with: see [`FieldOption::measuring`].
    pub fn measuring(&self, rig: Rig) -> Result<Rig, Failure> {
        self.field.measuring(rig)
    }

    /// Where to look in images of the cameras of `rig`.
    ///
    /// # Errors
    /// Ranges that are none or leave nothing between them; files that are no masks of these cameras.
    pub fn search(&self, rig: &Rig) -> Result<Search, Failure> {
        Search::between(self.nearest, self.farthest, self.masks.read(rig)?)
            .map_err(|error| Failure::usage(error.to_string()))
    }
}
