//! The units of a rig's axes. A message of joints has metres or radians and does not say which; a rig tells it beside its health.

use vergence_protocol::AxisKind;
use vergence_rig::{AxisPosition, Rig};

const METRES: &str = "m";
const RADIANS: &str = "rad";

/// The units of all axes: `baseline=m,separation=rad`.
pub fn units(rig: &Rig) -> String {
    let unit = |kind| if kind == AxisKind::Linear { METRES } else { RADIANS };
    let all: Vec<_> = rig.axes.iter().map(|axis| format!("{}={}", axis.name, unit(axis.kind))).collect();
    all.join(",")
}

/// Where an axis is, as a message says it: `baseline 145.0 mm`. The number alone where `units` do not have the axis.
pub fn in_words(axis: &str, at: f64, units: &str) -> String {
    let of_axis = units.split(',').filter_map(|unit| unit.rsplit_once('=')).find(|(name, _)| *name == axis);
    match of_axis {
        Some((_, METRES)) => format!("{axis} {:.1}", AxisPosition::from_value(AxisKind::Linear, 1e3 * at)),
        Some((_, RADIANS)) => format!("{axis} {:.1}", AxisPosition::from_value(AxisKind::Rotary, at)),
        _ => format!("{axis} {at:.4}"),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test fails loudly")]

    use vergence_rig::BENCH_TOML;

    use super::*;

    #[test]
    fn axes_are_told_in_millimetres_and_degrees() {
        let units = units(&Rig::from_toml(BENCH_TOML).expect("the bench"));
        assert_eq!(units, "baseline=m,separation=rad");
        assert_eq!(in_words("baseline", 0.145, &units), "baseline 145.0 mm");
        assert_eq!(in_words("separation", std::f64::consts::FRAC_PI_3, &units), "separation 60.0°");
        assert_eq!(in_words("lift", 0.145, &units), "lift 0.1450");
    }
}
