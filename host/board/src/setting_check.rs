//! The reason why a board refuses a setting, found by the board's own rules: the board itself answers only that it refuses.

use vergence_control::{BoardSettings, SettingsError};
use vergence_protocol::SettingKey;
use vergence_rig::Rig;

use crate::setting_text::{NamedSetting, settings};

/// The reason why a board of `rig` with the settings `present` refuses these `changes`, in words; `None` where this
/// program would accept them, as it does if the board's firmware has other rules.
#[must_use]
pub fn why_refused(
    rig: &Rig,
    present: &[(NamedSetting, i64)],
    changes: impl IntoIterator<Item = (SettingKey, i64)>,
) -> Option<String> {
    let kinds: Vec<_> = rig.axes.iter().map(|axis| axis.kind).collect();
    let values = present.iter().map(|(setting, value)| (setting.key, *value)).chain(changes);
    let changed = BoardSettings::from_values(&kinds, values).ok()?;
    changed.validate().err().map(|error| in_words(rig, error))
}

fn in_words(rig: &Rig, error: SettingsError) -> String {
    let name = |axis: usize| rig.axes.get(axis).map_or_else(|| axis.to_string(), |axis| axis.name.clone());
    match error {
        SettingsError::NotPositive { axis } => {
            format!("speeds, accelerations, scales and distances of {} must be positive", name(axis))
        }
        SettingsError::Range { axis } => {
            let axis = name(axis);
            format!(
                "{axis}.min must lie below {axis}.max, and {axis}.home_switch_at below {axis}.min less {axis}.backlash or \
                 above {axis}.max"
            )
        }
        SettingsError::StepRate { axis } => {
            let most = vergence_control::LARGEST_STEP_RATE;
            format!("at full speed the motor of {} would have to make more than {most} steps a second", name(axis))
        }
        SettingsError::Outside { axis, item, least, most, why } => {
            let key = u8::try_from(axis).ok().map(|axis| SettingKey { item, axis });
            let named = settings(rig).into_iter().find(|setting| Some(setting.key) == key);
            named.map_or_else(
                || error.to_string(),
                |setting| {
                    let [least, most] = [least, most].map(|bound| setting.write(bound));
                    format!("{} must lie between {least} and {most}: {why}", setting.name())
                },
            )
        }
        SettingsError::Microsteps { axis } => {
            format!("{}.microsteps must be a power of two, at most 256", name(axis))
        }
        SettingsError::Braking { axis, milliseconds } => {
            let most = vergence_control::LONGEST_BRAKING_MS;
            format!(
                "braking from full speed would take {} {milliseconds} ms, longer than {most} ms: raise acceleration or \
                 jerk, or lower the speed",
                name(axis)
            )
        }
        other => other.to_string(),
    }
}
