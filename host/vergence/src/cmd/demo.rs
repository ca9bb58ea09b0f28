//! `vergence demo`: the whole rig in simulation, scored against the truth.

use std::cell::Cell;
use std::future::pending;
use std::path::PathBuf;
use std::sync::Arc;

use serde_json::{Value, json};
use vergence_files::make_folder;
use vergence_output::check_folder;
use vergence_protocol::SessionId;
use vergence_reproduce::corridor::Corridor;
use vergence_reproduce::demo::{Pulse, SimulatedPair};
use vergence_rig::{Rig, rounded};

use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::{interrupted, on_own_thread};
use crate::rig_file;
use crate::sim::{SharedRig, SimulatedRig, board_of};
use crate::stopwatch::{Stopwatch, clock};

/// Starts a simulated rig in a simulated room, homes it, and in every mode of the rig takes a pair of images, measures it and
/// compares the points with the truth. Board, protocol, poses, matching and triangulation are the real ones; mechanics, room
/// and cameras are simulated. The truth scores the points and is used for nothing else. A rig with a trunk instead searches, passes
/// and inspects in a simulated corridor.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Sets where the stages stand at first and the noise of the images. The same seed gives the same bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The folder for clouds and pictures.
    #[arg(long, default_value = "vergence-demo", value_name = "DIR")]
    out: PathBuf,
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let whole = Stopwatch::start();
    check_folder(&args.out)?;
    let rig = rig_file::load(common.rig.as_deref())?;
    make_folder(&args.out)?;
    if rig.trunk.is_some() {
        return corridor(args, rig, console, &whole).await;
    }
    let (all, measured) = (rig.modes.len(), Cell::new(0));
    let modes = tokio::select! {
        // The simulated board ends with this process: nothing has to be disarmed.
        biased;
        () = interrupted() => Err(Failure::interrupted(format!(
            "interrupted: {} of {all} modes are measured, finished files are in {}; run the command again for all of them",
            measured.get(),
            args.out.display()
        ))),
        modes = every_mode(args, common, rig, &measured, console) => modes,
    }?;
    console.say(format!("clouds and pictures are in {}; {:.1} s in all", args.out.display(), whole.seconds()))?;
    console.result(&json!({ "modes": modes, "seconds": rounded(whole.seconds()) }))
}

/// Plays the robot's story in a simulated corridor.
async fn corridor(args: &Args, rig: Rig, console: Console, whole: &Stopwatch) -> Result<(), Failure> {
    console.say("simulated: the corridor, the cameras, joints off by their play; where the robot stands is given, no controller runs")?;
    let (out, seed) = (args.out.clone(), args.seed);
    let progress = console.progress("the corridor");
    let bar = progress.clone();
    let played = on_own_thread(move || {
        let mut lost = None;
        let mut say = |line: &str| {
            let said = bar.suspend(|| console.say(line));
            lost = lost.take().or(said.err());
        };
        let story = Corridor::new(&rig, &out, seed, clock)?.play(&mut say)?;
        lost.map_or(Ok(story), Err)
    });
    let story = tokio::select! {
        biased;
        () = interrupted() => Err(Failure::interrupted(format!("interrupted: finished files are in {}", args.out.display()))),
        story = played => story,
    }?;
    progress.finish_and_clear();
    console.say(format!(
        "clouds, pictures and a map (corridor.svg) are in {}; {:.1} s in all",
        args.out.display(),
        whole.seconds()
    ))?;
    console.result(&json!({ "modes": story.modes, "found": story.found, "seconds": rounded(whole.seconds()) }))
}

/// Homes the rig and measures in every mode; counts them in `measured`.
async fn every_mode(
    args: &Args,
    common: &CommonOptions,
    rig: Rig,
    measured: &Cell<usize>,
    console: Console,
) -> Result<Vec<Value>, Failure> {
    let simulated = SharedRig::new(SimulatedRig::new(&rig, args.seed)?);
    let (session, progress) = (SessionId((args.seed as u32).max(1)), console.progress("homing"));
    let mut board = board_of(&simulated, rig, session, common.lease, progress.clone()).await?;
    let cameras = Arc::new(SimulatedPair::new(board.rig(), &simulated, args.seed));
    let modes = board.armed(pending(), async |board| -> Result<_, Failure> {
        board.home().await?;
        let mut modes = Vec::new();
        for (mode, number) in board.rig().modes.clone().into_iter().zip(0..) {
            board.move_to(mode.number, &mode.targets).await?;
            progress.set_message(format!("{}: measuring", mode.name));
            let pulse = Pulse::fired_by(board, number).await?;
            let (cameras, out, name) = (Arc::clone(&cameras), args.out.clone(), mode.name.clone());
            let view = on_own_thread(move || {
                let view = cameras.measure(&pulse, clock)?;
                view.write(&name, &out)?;
                Ok(view)
            });
            let view = view.await?;
            progress.suspend(|| console.say(view.in_words(&mode, board.rig())))?;
            modes.push(view.json(&mode, board.rig()));
            measured.set(modes.len());
        }
        Ok(modes)
    });
    let modes = modes.await?;
    progress.finish_and_clear();
    Ok(modes)
}
