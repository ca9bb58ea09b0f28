//! The zones that the paper prints for its modes, beside those of a rig.

use serde_json::{Value, json};
use vergence_pipeline::RigView;
use vergence_rig::{rounded, zones_json};
use vergence_vision::{PAPER_FIELD, PUBLISHED_MODES, ZonesError, circle_zones, paper_eq3, paper_eq3_applies};

/// What the paper prints for a mode of this name, beside the zones of this rig on the paper's circle.
///
/// # Errors
/// [`ZonesError`] where a camera is not inside that circle.
pub fn published_zones(name: &str, view: &RigView<'_>) -> Result<Option<(String, Value)>, ZonesError> {
    let Some(mode) = PUBLISHED_MODES.iter().find(|mode| mode.name == name) else { return Ok(None) };
    let exact = circle_zones(&view.cameras, &view.middle, mode.radius)?.zones;
    let by_eq3 = paper_eq3(PAPER_FIELD, mode.separation, mode.baseline, mode.radius);
    let applies = paper_eq3_applies(PAPER_FIELD, mode.separation, mode.baseline, mode.radius);
    let origin = match (mode.name, applies) {
        ("stick-bug", _) => "no geometry gives both printed figures".to_owned(),
        (_, true) => format!("its Eq. 3 gives {:.1} and {:.1} for its nominal pose", by_eq3.stereo, by_eq3.mono),
        (_, false) => "its Eq. 3 does not apply".to_owned(),
    };
    let mono = mode.mono.map_or_else(|| "none".to_owned(), |mono| format!("{mono:.0}"));
    let sentence = format!(
        "the paper prints stereo {:.0}, mono {mono} on a circle of {:.0} ({origin}); this rig: stereo {:.2}, mono {:.2}, blind {:.2}",
        mode.stereo, mode.radius, exact.stereo, exact.mono, exact.blind
    );
    let json = json!({
        "stereo": rounded(mode.stereo.deg()),
        "mono": mode.mono.map(|mono| rounded(mono.deg())),
        "radius_mm": rounded(mode.radius.mm()),
        "exact": zones_json(&exact),
    });
    Ok(Some((sentence, json)))
}
