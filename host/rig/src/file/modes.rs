//! The `[modes]` tables of a rig file: a position for every axis, and a number.

use std::collections::BTreeMap;

use serde::Deserialize;

use super::{RigError, contradiction, position};
use crate::axis::RigAxis;
use crate::mode::Mode;

/// The key of a mode's number, beside the names of the axes.
pub(super) const NUMBER: &str = "number";

/// Modes by name; each with its values by key.
pub(super) type ModesFile = BTreeMap<String, BTreeMap<String, ModeValue>>;

#[derive(Deserialize)]
#[serde(untagged, expecting = "expected a position such as \"145mm\" or \"120deg\", or number = 1")]
pub(super) enum ModeValue {
    Integer(i64),
    Text(String),
}

/// All modes, by name.
pub(super) fn modes(file: &ModesFile, axes: &[RigAxis]) -> Result<Vec<Mode>, RigError> {
    let modes = file.iter().map(|(name, values)| mode(name, values, axes)).collect::<Result<Vec<_>, _>>()?;
    for (index, mode) in modes.iter().enumerate() {
        if let Some(other) = modes.iter().take(index).find(|other| other.number == mode.number) {
            let derived =
                if file.get(&mode.name).is_some_and(|values| values.contains_key(NUMBER)) { other } else { mode };
            return Err(contradiction(format!(
                "modes '{}' and '{}' both have number {}: write `{NUMBER} = N` under [modes.{}], from 1 to 255 and \
                 unlike that of every other mode",
                other.name, mode.name, mode.number.0, derived.name
            )));
        }
    }
    Ok(modes)
}

fn mode(name: &str, values: &BTreeMap<String, ModeValue>, axes: &[RigAxis]) -> Result<Mode, RigError> {
    let is_stranger = |key: &String| key != NUMBER && axes.iter().all(|axis| axis.name != *key);
    if let Some(stranger) = values.keys().find(|key| is_stranger(key)) {
        return Err(contradiction(format!("mode '{name}' names an axis '{stranger}' that the rig does not have")));
    }
    let number = values.get(NUMBER).map_or(Ok(Mode::number_from_name(name)), |value| number(name, value))?;
    let targets = axes.iter().map(|axis| target(name, values, axis)).collect::<Result<_, _>>()?;
    Ok(Mode { name: name.to_owned(), number, targets })
}

fn number(name: &str, value: &ModeValue) -> Result<vergence_protocol::Mode, RigError> {
    let number = match value {
        ModeValue::Integer(number) => u8::try_from(*number).ok().filter(|number| *number != 0),
        ModeValue::Text(_) => None,
    };
    number
        .map(vergence_protocol::Mode)
        .ok_or_else(|| contradiction(format!("mode '{name}': {NUMBER} must be a whole number from 1 to 255")))
}

fn target(
    name: &str,
    values: &BTreeMap<String, ModeValue>,
    axis: &RigAxis,
) -> Result<crate::axis::AxisPosition, RigError> {
    let place = format!("mode '{name}', axis '{}'", axis.name);
    let text = match values.get(&axis.name) {
        Some(ModeValue::Text(text)) => text.clone(),
        // A number without its unit: the parser of positions says what is missing.
        Some(ModeValue::Integer(number)) => number.to_string(),
        None => return Err(contradiction(format!("mode '{name}' has no position of axis '{}'", axis.name))),
    };
    let target = position(axis.kind, &text, &place)?;
    if !axis.contains(target) {
        let [low, high] = axis.range;
        return Err(contradiction(format!(
            "mode '{name}' puts axis '{}' at {target}, outside {low} to {high}",
            axis.name
        )));
    }
    Ok(target)
}
