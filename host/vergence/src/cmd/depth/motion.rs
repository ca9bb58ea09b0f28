//! The pose of images taken while the stages moved at constant speed.

use vergence_pipeline::PairPose;
use vergence_rig::{AxisPosition, Rig};
use vergence_vision::{Angle, Length};

use crate::failure::Failure;

/// How fast the stages moved while the images were taken. It matters where the rig file says that a camera exposes row after
/// row (`line_time`).
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct StageSpeed {
    /// Speed at which the baseline grew, such as 80mm/s; the baseline itself is that of the middle row.
    #[arg(long, value_name = "SPEED", value_parser = linear, allow_hyphen_values = true, conflicts_with_all = ["points", "kernel"])]
    baseline_speed: Option<Length>,
    /// Speed at which the separation angle grew, such as 60deg/s.
    #[arg(long, value_name = "SPEED", value_parser = rotary, allow_hyphen_values = true, conflicts_with_all = ["points", "kernel"])]
    separation_speed: Option<Angle>,
}

fn per_second(text: &str) -> Result<&str, String> {
    text.trim().strip_suffix("/s").ok_or_else(|| format!("'{text}' is no speed: write it like 80mm/s or 60deg/s"))
}

fn linear(text: &str) -> Result<Length, String> {
    per_second(text)?.parse().map_err(|error: vergence_vision::InvalidQuantity| error.to_string())
}

fn rotary(text: &str) -> Result<Angle, String> {
    per_second(text)?.parse().map_err(|error: vergence_vision::InvalidQuantity| error.to_string())
}

impl StageSpeed {
    /// The pose of every row, for images whose middle rows were exposed with the axes at `positions`; `None` where no speed is
    /// given.
    ///
    /// # Errors
    /// The speed of an axis that the rig does not have.
    pub fn pose(&self, rig: &Rig, positions: &[AxisPosition]) -> Result<Option<PairPose>, Failure> {
        if self.baseline_speed.is_none() && self.separation_speed.is_none() {
            return Ok(None);
        }
        let named = [
            ("baseline", self.baseline_speed.map(AxisPosition::Linear)),
            ("separation", self.separation_speed.map(AxisPosition::Rotary)),
        ];
        let mut speeds = vec![0.0; rig.axes.len()];
        for (name, speed) in named {
            let Some(speed) = speed else { continue };
            let axis = rig.axes.iter().zip(&mut speeds).find(|(axis, _)| axis.name == name && speed.is_of(axis.kind));
            let Some((_, of_axis)) = axis else {
                return Err(Failure::usage(format!("rig '{}' has no axis '{name}' that moves like this", rig.name)));
            };
            *of_axis = speed.value();
        }
        let moving = PairPose::at_speed(rig, positions, &speeds);
        moving.map(Some).map_err(|error| Failure::usage(error.to_string()))
    }
}
