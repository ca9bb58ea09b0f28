//! The board's settings in a file: TOML, one table for each axis.

use vergence_protocol::{Refusal, SettingItem};

use crate::board::Board;
use crate::error::BoardError;
use crate::setting_check::why_refused;
use crate::setting_text::{NamedSetting, settings};

/// Why the settings of a file were not made those of the board.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SettingsFileError {
    /// The link ended, or the board refuses whatever the settings are.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// The text names anything that is no setting, or no value of it.
    #[error("{0}")]
    Wrong(String),
    /// The board refuses these settings, for the reason given.
    #[error("nothing was changed: the board refuses {0}")]
    Refused(String),
}

/// What a file of settings changed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SettingsChanged {
    /// The changes in words.
    pub changed: Vec<String>,
    /// The speed of the line that the file asks for, where it is another one: [`crate::change_line_speed`] makes it.
    pub baud: Option<u32>,
}

impl Board {
    /// Every setting that the board has, and its value in wire units.
    ///
    /// # Errors
    /// [`BoardError`] where the link ended.
    pub async fn settings(&self) -> Result<Vec<(NamedSetting, i64)>, BoardError> {
        let mut present = Vec::new();
        for setting in settings(self.rig()) {
            if let Some(value) = self.setting(setting.key).await? {
                present.push((setting, value));
            }
        }
        Ok(present)
    }

    /// These settings and their values, of this board, as the text of a file.
    #[must_use]
    pub fn settings_text(&self, settings: &[(NamedSetting, i64)]) -> String {
        let mut text = format!("# Settings of the board of rig '{}': vergence config set --file\n", self.rig().name);
        let mut axis = None;
        for (setting, value) in settings {
            if setting.axis != axis {
                axis.clone_from(&setting.axis);
                text += &format!("\n[{}]\n", axis.as_deref().unwrap_or_default());
            }
            text += &format!("{} = {}\n", setting.item, setting.toml(*value));
        }
        text
    }

    /// Sets everything that the text of a file names and that is different now, or nothing. The speed of the line is left
    /// as it is, because this link would end.
    ///
    /// # Errors
    /// [`SettingsFileError`]: anything that is no setting, or a value that the board refuses.
    pub async fn set_all(&self, text: &str) -> Result<SettingsChanged, SettingsFileError> {
        let table: toml::Table =
            text.parse().map_err(|error: toml::de::Error| SettingsFileError::Wrong(error.message().to_owned()))?;
        let mut wanted = wanted(&table, &self.settings().await?).map_err(SettingsFileError::Wrong)?;
        let baud = wanted.extract_if(.., |change| change.setting.key.item == SettingItem::Baud).last();
        let baud = baud.and_then(|change| u32::try_from(change.value).ok());
        let mut done = Vec::new();
        let outcome = set_each(self, wanted, &mut done).await;
        if outcome.is_err() {
            // Each was accepted beside the ones before it, so the way back is open in the opposite order.
            for Change { setting, before, .. } in done.iter().rev() {
                self.set(setting.key, *before).await?.map_err(|refusal| self.refused(refusal))?;
            }
        }
        outcome?;
        let in_words = |change: &Change| {
            let Change { setting, before, value } = change;
            format!("{} is {}, it was {}", setting.name(), setting.write(*value), setting.write(*before))
        };
        Ok(SettingsChanged { changed: done.iter().map(in_words).collect(), baud })
    }
}

/// A setting that becomes another.
struct Change {
    setting: NamedSetting,
    before: i64,
    value: i64,
}

/// What the file changes.
fn wanted(table: &toml::Table, present: &[(NamedSetting, i64)]) -> Result<Vec<Change>, String> {
    let mut named = Vec::new();
    for (key, value) in table {
        match value {
            toml::Value::Table(axis) => named.extend(axis.iter().map(|(item, value)| (format!("{key}.{item}"), value))),
            _ => named.push((key.clone(), value)),
        }
    }
    let mut changes = Vec::new();
    for (name, value) in named {
        let known = present.iter().find(|(setting, _)| setting.name() == name);
        let (setting, before) = known.ok_or_else(|| format!("this board has no setting '{name}'"))?;
        let value = setting.from_toml(value)?;
        if value != *before {
            changes.push(Change { setting: setting.clone(), before: *before, value });
        }
    }
    Ok(changes)
}

/// Sets one after the other. One that does not fit beside the others now may fit once they have changed too. The place of a home
/// switch comes after the range: it may lie on either side of it, and on the wrong one it would be in the way of a range that
/// moves past itself.
async fn set_each(board: &Board, mut wanted: Vec<Change>, done: &mut Vec<Change>) -> Result<(), SettingsFileError> {
    wanted.sort_by_key(|change| change.setting.key.item == SettingItem::HomeSwitchAt);
    loop {
        let mut misfits = Vec::new();
        let before = wanted.len();
        for change in wanted {
            match board.set(change.setting.key, change.value).await? {
                Ok(()) => done.push(change),
                Err(Refusal::BadSetting) => misfits.push(change),
                Err(refusal) => return Err(board.refused(refusal).into()),
            }
        }
        if misfits.is_empty() {
            return Ok(());
        }
        if misfits.len() == before {
            let names = misfits
                .iter()
                .map(|change| format!("{} = {}", change.setting.name(), change.setting.write(change.value)));
            let names = names.collect::<Vec<_>>().join(", ");
            let changes = misfits.iter().map(|change| (change.setting.key, change.value));
            let reason = why_refused(board.rig(), &board.settings().await?, changes);
            let reason = reason.map_or_else(String::new, |reason| format!(": {reason}"));
            return Err(SettingsFileError::Refused(format!("{names} beside the others{reason}")));
        }
        wanted = misfits;
    }
}
