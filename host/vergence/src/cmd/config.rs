//! `vergence config`: the board's settings.

use std::path::PathBuf;

use serde_json::{Map, Value, json};
use vergence_board::{
    Board, ManagementLink, NamedSetting, Port, SettingsChanged, SettingsFileError, SpeedChange, change_line_speed,
    restart, settings, why_refused,
};
use vergence_files::write_whole;
use vergence_protocol::{ControllerState, Refusal, Request, SettingItem, SettingKey};

use super::connect::{connect_any, is_wire, port};
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;

/// Prints and changes the board's settings of its axes and its link. The board checks every value beside all others, and
/// changes nothing while it is armed.
///
/// `stream_period` is how often the board sends its pose, 1ms to 10s or 0s for never, from the next session on. Every verb
/// takes it as it is; one that must follow the board more closely than every 100ms asks for more while it runs, and says so.
///
/// `baud` is the speed of the serial line. `set baud` opens the line at the new speed and saves all present settings once the
/// board was heard at it; where it is not, board and host go back to the speed before, and the exit code is 3.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Prints one setting, or all.
    Get {
        /// The setting, such as baseline.speed, or baseline for all settings of that axis.
        key: Option<String>,
        /// Writes all settings to a file that `set --file` reads.
        #[arg(long, value_name = "FILE", conflicts_with = "key")]
        out: Option<PathBuf>,
    },
    /// Changes a setting, or all that a file names. The change works at once, and until the next start unless saved.
    Set {
        /// The setting, such as baseline.speed.
        #[arg(required_unless_present = "file", conflicts_with = "file", requires = "value")]
        key: Option<String>,
        /// The value with its unit, such as 40mm/s.
        #[arg(allow_hyphen_values = true)]
        value: Option<String>,
        /// A file that `get --out` wrote.
        #[arg(long, value_name = "FILE")]
        file: Option<PathBuf>,
    },
    /// Saves the present settings: they stay through the next start.
    Save,
    /// Go back to the settings that the firmware came with, until the next start unless saved. Also called `restore`.
    #[command(alias = "restore")]
    Factory,
    /// Go back to the settings that were saved: the board starts again with them, and its axes must be homed again.
    Reload,
}

/// What is forgotten at the next start is said where it is changed.
const UNSAVED: &str = "'vergence config save' keeps it through the next start";

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    // Settings must stay reachable when they contradict the rig file: they may be what has to be mended.
    let mut board = connect_any(common, console, "settings").await?;
    // A refusal names the latched fault, which poses tell.
    board.next_pose().await?;
    match &args.what {
        What::Get { key: Some(key), .. } if board.rig().axis_index(key).is_none() => {
            get_one(&board, key, console).await
        }
        What::Get { key: axis, out } => get_all(&board, axis.as_deref(), out.as_ref(), console).await,
        What::Set { file: Some(path), .. } => {
            let SettingsChanged { changed, baud } =
                board.set_all(&vergence_files::read_text(path)?).await.map_err(|error| match error {
                    SettingsFileError::Wrong(problem) => Failure::input(path, problem),
                    _ => error.into(),
                })?;
            let list = changed.iter().map(|change| format!("\n  {change}")).collect::<String>();
            console.say(format!("{} settings changed{list}", changed.len()))?;
            say_unsaved(console, !changed.is_empty())?;
            if let Some(baud) = baud {
                change_baud(board, common, baud, false).await?;
                console.say(format!("the line is at {baud} baud, and wants --baud {baud} from now on"))?;
            }
            console.result(&json!({ "changed": changed, "baud": baud }))
        }
        What::Set { key, value, .. } => {
            let (key, value) = (key.as_deref().unwrap_or_default(), value.as_deref().unwrap_or_default());
            set_one(board, key, value, common, console).await
        }
        What::Save => {
            board.ask(Request::SaveSettings).await?;
            console.say("the settings are saved")?;
            console.result(&json!({ "saved": true }))
        }
        What::Reload => reload(board, common, console).await,
        What::Factory => {
            board.ask(Request::RestoreSettings).await?;
            console.say("the settings are those that the firmware came with")?;
            say_unsaved(console, true)?;
            let baud = board.setting(SettingKey { item: SettingItem::Baud, axis: 0 }).await?;
            if let Some(baud) = baud.filter(|&baud| is_wire(common) && baud != i64::from(common.baud)) {
                console.warn(format!("the line goes to {baud} baud once the board has heard nobody for 5 s"));
            }
            console.result(&json!({ "restored": true }))
        }
    }
}

/// Starts the board again, so that it reads its saved settings.
async fn reload(board: Board, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let port = port(common)?;
    if matches!(port, Port::Simulated(_)) {
        return Err(Failure::usage("a board in this process ends with it and saves nothing: name one with --port"));
    }
    if board.pose().state != ControllerState::Idle {
        let state = board.pose().state;
        let remedy = if board.pose().fault.is_some() { "vergence clear" } else { "vergence disarm" };
        return Err(Failure::device(format!(
            "the board is {state}, and starts again only when idle: run '{remedy}' first"
        )));
    }
    board.close().await;
    let mut link = ManagementLink::open(port, common.baud).await?;
    restart(&mut link).await?;
    console.say("the board has started again with its saved settings: run 'vergence home' before moving")?;
    console.result(&json!({ "reloaded": true }))
}

fn say_unsaved(console: Console, changed: bool) -> Result<(), Failure> {
    if changed { console.say(UNSAVED) } else { Ok(()) }
}

/// The setting called `name`.
fn find(board: &Board, name: &str) -> Result<NamedSetting, Failure> {
    let all = settings(board.rig());
    let near: Vec<_> = all.iter().filter(|setting| setting.item == name).map(NamedSetting::name).collect();
    let hint = if near.is_empty() { "'vergence config get' lists all".into() } else { near.join(", ") };
    let found = all.into_iter().find(|setting| setting.name() == name);
    found.ok_or_else(|| Failure::usage(format!("there is no setting '{name}': {hint}")))
}

async fn get_one(board: &Board, name: &str, console: Console) -> Result<(), Failure> {
    let setting = find(board, name)?;
    let Some(value) = board.setting(setting.key).await? else {
        return Err(Failure::device(format!("this board has no setting '{name}'")));
    };
    console.say(setting.write(value))?;
    console.result(&json!({ name: json_value(&setting, value) }))
}

/// All settings, or those of one axis.
async fn get_all(board: &Board, axis: Option<&str>, out: Option<&PathBuf>, console: Console) -> Result<(), Failure> {
    let mut present = board.settings().await?;
    present.retain(|(setting, _)| axis.is_none() || setting.axis.as_deref() == axis);
    if let Some(path) = out {
        write_whole(path, board.settings_text(&present).as_bytes())?;
        console.say(format!("{} settings written to {}", present.len(), path.display()))?;
    } else {
        let width = present.iter().map(|(setting, _)| setting.name().len()).max().unwrap_or(0);
        for (setting, value) in &present {
            console.say(format!("{:width$}  {}", setting.name(), setting.write(*value)))?;
        }
    }
    let entries = present.iter().map(|(setting, value)| (setting.name(), json_value(setting, *value)));
    console.result(&Value::Object(entries.collect::<Map<_, _>>()))
}

async fn set_one(
    board: Board,
    name: &str,
    text: &str,
    common: &CommonOptions,
    console: Console,
) -> Result<(), Failure> {
    let setting = find(&board, name)?;
    let value = setting.read(text).map_err(Failure::usage)?;
    let before = board.setting(setting.key).await?;
    if setting.key.item == SettingItem::Baud && before.is_some_and(|before| before != value) {
        let baud = u32::try_from(value).map_err(|_| Failure::usage(format!("{name} cannot be {text}")))?;
        change_baud(board, common, baud, true).await?;
        console.say(format!("{name} is {baud}, and saved with all present settings; use --baud {baud} from now on"))?;
        return console.result(&json!({ "setting": name, "value": text, "saved": true }));
    }
    match board.set(setting.key, value).await? {
        Ok(()) => {}
        Err(Refusal::BadSetting) => {
            let reason = why_refused(board.rig(), &board.settings().await?, [(setting.key, value)]);
            let reason = reason.unwrap_or_else(|| "it does not go with the other settings of the board".into());
            return Err(Failure::usage(format!("{name} cannot be {text}: {reason}")));
        }
        Err(refusal) => return Err(board.refused(refusal).into()),
    }
    let (now, before) = (setting.write(value), before.map(|before| setting.write(before)));
    console.say(format!("{name} is {now}, it was {}", before.as_deref().unwrap_or("unknown")))?;
    say_unsaved(console, before.as_ref() != Some(&now))?;
    console.result(&json!({ "setting": name, "value": now, "before": before }))
}

/// Changes the speed of the line to `baud`, where board and adapter can both make it.
async fn change_baud(board: Board, common: &CommonOptions, baud: u32, save: bool) -> Result<(), Failure> {
    let port = port(common)?;
    if matches!(port, Port::Simulated(_)) {
        return Err(Failure::usage("a board in this process has no line: name one with --port"));
    }
    let key = SettingKey { item: SettingItem::Baud, axis: 0 };
    if let Some(reason) = why_refused(board.rig(), &board.settings().await?, [(key, i64::from(baud))]) {
        return Err(Failure::usage(format!("baud cannot be {baud}: {reason}")));
    }
    let before = common.baud;
    match change_line_speed(board, &port, [before, baud], save).await? {
        SpeedChange::Changed => Ok(()),
        SpeedChange::WentBack => Err(Failure::device(format!(
            "nothing is heard at {baud} baud: the board is back at {before} baud, and nothing was saved; the adapter or the \
             cable cannot make {baud}"
        ))),
        SpeedChange::Refused(refusal) => Err(Failure::device(format!("the board refuses: {refusal}"))),
    }
}

fn json_value(setting: &NamedSetting, value: i64) -> Value {
    serde_json::to_value(setting.toml(value)).unwrap_or(Value::Null)
}
