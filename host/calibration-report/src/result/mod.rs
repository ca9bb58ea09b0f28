//! Results of the calibrations as lines of text for people and as JSON for programs.

mod extrinsics;
mod intrinsics;
mod stage;
mod trunk;

use serde_json::{Value, json};
use vergence_calibration::Validation;

pub use self::extrinsics::{extrinsics_json, extrinsics_lines, fixed_pair};
pub use self::intrinsics::{intrinsics_json, intrinsics_lines, pupil_in_words, step_in_words};
pub use self::stage::{stage_json, stage_lines};
pub(crate) use self::trunk::{in_unit, play_in_words, unit};
pub use self::trunk::{trunk_json, trunk_lines};
use crate::{LeftOut, PlaceVerdict, Verdict};

/// A line that says how well held-out views are predicted; `None` where none were held out.
#[must_use]
pub fn held_out_line(validation: Option<&Validation>) -> Option<String> {
    let Validation { folds, rms_px, views } = validation?;
    Some(format!("  held out: {rms_px:.3} px rms over {} views in {folds} parts", views.len()))
}

/// How well held-out views are predicted, for programs; null where none were held out.
#[must_use]
pub fn held_out_json(validation: Option<&Validation>) -> Value {
    let Some(Validation { folds, rms_px, views }) = validation else { return Value::Null };
    let views: Vec<_> =
        views.iter().map(|view| json!({ "name": view.view, "corners": view.corners, "rms_px": view.rms_px })).collect();
    json!({ "folds": folds, "rms_px": rms_px, "views": views })
}

/// Views that were left out before a calibration, for programs.
#[must_use]
pub fn left_out_json(left_out: &[LeftOut]) -> Value {
    left_out.iter().map(|left_out| json!({ "view": left_out.view, "reason": left_out.reason })).collect()
}

impl Verdict {
    /// The verdict for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let place = |place: &PlaceVerdict| {
            let [along, across] = [0, 1].map(|index: usize| place.sigma.map(|sigma| sigma[index].mm()));
            json!({
                "mode": place.mode, "range_mm": place.range.mm(), "angle_deg": place.angle.deg(),
                "along_sigma_mm": along, "across_sigma_mm": across,
            })
        };
        json!({
            "text": self.sentence,
            "depth_sigma_mm": self.depth_sigma.map(|sigma| sigma.mm()),
            "worst_sigma_mm": self.worst_sigma.map(|sigma| sigma.mm()),
            "range_mm": self.range.mm(),
            "places": self.places.iter().map(place).collect::<Vec<_>>(),
        })
    }
}
