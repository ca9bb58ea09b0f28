//! `vergence calibrate list`, `use` and `rollback`: calibrations kept under names.

use serde_json::json;
use vergence_calibration_input::SlotKind;

use crate::cmd::options::StoreOptions;
use crate::console::Console;
use crate::failure::Failure;

/// Lists the calibrations that are kept, with their origin, and marks the active one.
#[derive(Debug, clap::Args)]
pub struct List {
    #[command(flatten)]
    store: StoreOptions,
}

/// Makes a calibration of a pair or stage the active one: every verb that is given no --rig then uses it.
#[derive(Debug, clap::Args)]
pub struct Use {
    /// Name of the calibration.
    name: String,
    #[command(flatten)]
    store: StoreOptions,
}

/// Makes the previously active calibration active again.
#[derive(Debug, clap::Args)]
pub struct Rollback {
    #[command(flatten)]
    store: StoreOptions,
}

pub fn list(args: &List, console: Console) -> Result<(), Failure> {
    let slots = args.store.open()?.list()?;
    if slots.is_empty() {
        console.say("no calibration is kept: vergence calibrate ... --slot NAME keeps one")?;
    }
    let mut all = Vec::new();
    for slot in &slots {
        let kind = match slot.kind {
            SlotKind::Rig => "rig",
            SlotKind::Camera => "camera",
            SlotKind::Unreadable => "unreadable",
        };
        let origin = slot.provenance.as_ref();
        let date = origin.and_then(|origin| origin.date.clone());
        let program = origin.map(|origin| origin.program.clone());
        let inputs = origin.map(|origin| origin.inputs_sha256.clone());
        console.say(format!(
            "{} {}  {kind}  {}  {}  inputs {}",
            if slot.active { "*" } else { " " },
            slot.name,
            date.as_deref().unwrap_or("no date"),
            program.as_deref().unwrap_or("unknown program"),
            inputs.as_deref().and_then(|hash| hash.get(..12)).unwrap_or("unknown"),
        ))?;
        all.push(json!({
            "name": slot.name, "kind": kind, "active": slot.active, "date": date, "program": program,
            "inputs_sha256": inputs, "file": slot.path,
        }));
    }
    console.result(&json!({ "calibrations": all }))
}

pub fn activate(args: &Use, console: Console) -> Result<(), Failure> {
    args.store.open()?.activate(&args.name)?;
    console.say(format!("'{}' is active", args.name))?;
    console.result(&json!({ "active": args.name }))
}

pub fn rollback(args: &Rollback, console: Console) -> Result<(), Failure> {
    let before = args.store.open()?.rollback()?;
    match &before {
        Some(name) => console.say(format!("'{name}' is active again"))?,
        None => console.say("none is active: the built-in rig is used")?,
    }
    console.result(&json!({ "active": before }))
}
