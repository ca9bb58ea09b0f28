//! Settings in a file: TOML, one table for each axis.

use std::path::Path;

use vergence_board::{Board, NamedSetting, why_refused};
use vergence_protocol::Refusal;

use super::read_all;
use crate::failure::Failure;

/// The settings as a file.
pub fn text(board: &Board, settings: &[(NamedSetting, i64)]) -> String {
    let mut text = format!("# Settings of the board of rig '{}': vergence config set --file\n", board.rig().name);
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

/// Sets everything that the file names and that is different now, or nothing. Returns the changes in words.
///
/// # Errors
/// A file with anything that is no setting, or a value that the board refuses.
pub async fn apply(board: &mut Board, path: &Path) -> Result<Vec<String>, Failure> {
    let text = std::fs::read_to_string(path).map_err(|error| Failure::input(path, error))?;
    let table: toml::Table = text.parse().map_err(|error: toml::de::Error| Failure::input(path, error.message()))?;
    let present = read_all(board).await?;
    let wanted = wanted(&table, &present).map_err(|problem| Failure::input(path, problem))?;
    let mut done = Vec::new();
    let outcome = set_all(board, wanted, &mut done).await;
    if outcome.is_err() {
        // Each was accepted beside the ones before it, so the way back is open in the opposite order.
        for Change { setting, before, .. } in done.iter().rev() {
            board.set(setting.key, *before).await?.map_err(|refusal| board.refused(refusal))?;
        }
    }
    outcome?;
    let in_words = |change: &Change| {
        let Change { setting, before, value } = change;
        format!("{} is {}, it was {}", setting.name(), setting.write(*value), setting.write(*before))
    };
    Ok(done.iter().map(in_words).collect())
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

/// Sets one after the other. One that does not fit beside the others now may fit once they have changed too.
async fn set_all(board: &Board, mut wanted: Vec<Change>, done: &mut Vec<Change>) -> Result<(), Failure> {
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
            let reason = why_refused(board.rig(), &read_all(board).await?, changes);
            let reason = reason.map_or_else(String::new, |reason| format!(": {reason}"));
            return Err(Failure::usage(format!(
                "nothing was changed: the board refuses {names} beside the others{reason}"
            )));
        }
        wanted = misfits;
    }
}
