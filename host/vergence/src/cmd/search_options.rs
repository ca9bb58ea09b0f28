//! Where in both images points are sought.

use std::path::PathBuf;

use vergence_camera::read_mask;
use vergence_pipeline::Search;
use vergence_rig::Rig;
use vergence_vision::{KannalaBrandt, Length};

use crate::failure::Failure;

/// Ranges between which points are sought, and what of the images shows the robot itself.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct SearchOptions {
    /// The nearest range from the left camera at which points are sought, such as 200mm. Unless given, the distance of the
    /// cameras.
    #[arg(long, value_name = "LENGTH")]
    nearest: Option<Length>,
    /// The farthest range of a point, such as 5m. Unless given, as far as the parallax of a point is larger than its error.
    #[arg(long, value_name = "LENGTH")]
    farthest: Option<Length>,
    /// What the left image shows of the robot itself, a hood or the mount: a PNG image of the camera's size, black there. Nothing
    /// is sought in it.
    #[arg(long, value_name = "IMAGE")]
    left_mask: Option<PathBuf>,
    /// The same of the right image.
    #[arg(long, value_name = "IMAGE")]
    right_mask: Option<PathBuf>,
}

impl SearchOptions {
    /// Whether any of them is given.
    pub fn is_given(&self) -> bool {
        let Self { nearest, farthest, left_mask, right_mask } = self;
        nearest.is_some() || farthest.is_some() || left_mask.is_some() || right_mask.is_some()
    }

    /// Where to look in images of the cameras of `rig`.
    ///
    /// # Errors
    /// Ranges that are none or leave nothing between them; masks that are no image, or of another size than the camera's.
    pub fn search(&self, rig: &Rig) -> Result<Search, Failure> {
        for (name, range) in [("nearest", self.nearest), ("farthest", self.farthest)] {
            if let Some(range) = range.filter(|range| range.mm().is_nan() || range.mm() <= 0.0) {
                return Err(Failure::usage(format!("--{name} {range}: a range is positive, such as 150mm")));
            }
        }
        if let (Some(nearest), Some(farthest)) = (self.nearest, self.farthest)
            && nearest >= farthest
        {
            return Err(Failure::usage(format!("--nearest {nearest} leaves nothing before --farthest {farthest}")));
        }
        let mask = |path: &Option<PathBuf>, camera: &KannalaBrandt| {
            path.as_deref().map(|path| read_mask(path, camera.size())).transpose()
        };
        let masks = [mask(&self.left_mask, &rig.left_camera)?, mask(&self.right_mask, &rig.right_camera)?];
        Ok(Search { nearest: self.nearest, farthest: self.farthest, masks })
    }
}
