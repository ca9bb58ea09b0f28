//! `vergence demo`: the whole rig in simulation, scored against the truth.

use std::cell::Cell;
use std::future::pending;
use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::Arc;

use serde_json::{Value, json};
use vergence_files::make_folder;
use vergence_output::check_folder;
use vergence_protocol::SessionId;
use vergence_reproduce::corridor::{Comparison, Corridor, Sight, WIDTH, compare};
use vergence_reproduce::demo::{Pulse, SimulatedPair};
use vergence_reproduce::{DemoError, LensedRig, TRUE_LENS};
use vergence_rig::{Rig, rounded};
use vergence_scene::LensChoice;

use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::{interrupted, on_own_thread};
use crate::rig_file;
use crate::sim::{SharedRig, SimulatedRig, SimulatedRobot, board_of, lensed};
use crate::stopwatch::{Stopwatch, clock};

/// Starts a simulated rig in a simulated room, homes it, and in every mode of the rig takes a pair of images, measures it and
/// compares the points with the truth. Board, protocol, poses, matching and triangulation are the real ones; mechanics, room
/// and cameras are simulated. The truth scores the points and is used for nothing else. A rig with a trunk instead searches, passes
/// and inspects in a simulated corridor: its controller moves the joints from mode to mode, and where the robot stands is given.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Sets where the stages stand at first and the noise of the images. The same seed gives the same bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The lenses of the simulated cameras: a published design that is traced, sigma8_f18 or nikkor6_f28, or ideal, as the rig's file has
    /// them. Without it sigma8_f18, and ideal ones of a rig with a trunk. A rig with traced lenses is calibrated first, from simulated targets,
    /// and measured by the file that this gives, rig.toml.
    #[arg(long, conflicts_with = "corridors")]
    lens: Option<LensChoice>,
    /// The folder for clouds and pictures.
    #[arg(long, default_value = "vergence-demo", value_name = "DIR")]
    out: PathBuf,
    /// A rig with a trunk chooses its modes itself, by task, predicted error, coverage and travel time, and says why.
    #[arg(long, conflicts_with = "corridors")]
    auto: bool,
    /// A rig with a trunk instead runs its mission in so many random corridors, with modes by itself, by the paper's order, and in
    /// each mode alone, and compares them. Joints are placed, off by their play, and matches drawn from the true geometry, with noise: no
    /// controller runs, and nothing is rendered or written.
    #[arg(long, value_name = "COUNT", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    corridors: Option<u32>,
    /// Shows the rig on a page instead, on which it is driven: 'vergence panel' of a simulated rig, with ideal lenses unless --lens says
    /// otherwise. Nothing is written.
    #[arg(long, value_name = "ADDRESS", num_args = 0..=1, default_missing_value = "127.0.0.1:8088", conflicts_with_all = ["corridors", "auto", "out"])]
    panel: Option<SocketAddr>,
}

impl Args {
    /// Where the rig is shown on a page instead, with which lenses and seed.
    pub fn on_a_page(&self) -> Option<(SocketAddr, LensChoice, u64)> {
        Some((self.panel?, self.lens.unwrap_or(LensChoice::Ideal), self.seed))
    }
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let whole = Stopwatch::start();
    check_folder(&args.out)?;
    let rig = rig_file::load(common.rig.as_deref())?;
    if rig.trunk.is_none() && (args.auto || args.corridors.is_some()) {
        let why = format!(
            "rig '{}' has no trunk: --auto and --corridors are for one, such as docs/rigs/origaker.toml",
            rig.name
        );
        return Err(Failure::usage(why));
    }
    if let Some(count) = args.corridors {
        return compared(count, rig, console, &whole).await;
    }
    make_folder(&args.out)?;
    let lens = args.lens.unwrap_or(if rig.trunk.is_some() { LensChoice::Ideal } else { TRUE_LENS });
    // Other lenses of a trunk are refused below.
    if rig.trunk.is_some() && lens == LensChoice::Ideal {
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
        modes = every_mode(args, lens, common, rig, &measured, console) => modes,
    }?;
    console.say(format!("clouds and pictures are in {}; {:.1} s in all", args.out.display(), whole.seconds()))?;
    console.result(&json!({ "lens": lens.to_string(), "modes": modes, "seconds": rounded(whole.seconds()) }))
}

/// Plays the robot's story in a simulated corridor.
async fn corridor(args: &Args, rig: Rig, console: Console, whole: &Stopwatch) -> Result<(), Failure> {
    console.say(
        "simulated: the corridor, the cameras, the servos, the trunk with play and springs; where the robot stands is given",
    )?;
    let (out, seed, auto) = (args.out.clone(), args.seed, args.auto);
    let progress = console.progress("the corridor");
    let bar = progress.clone();
    let played = on_own_thread(move || {
        let mut lost = None;
        let mut say = |line: &str| {
            let said = bar.suspend(|| console.say(line));
            lost = lost.take().or(said.err());
        };
        let corridor = Corridor::new(&rig, &out, seed, clock)?;
        let mut robot = SimulatedRobot::start(&rig, seed)?;
        let story = if auto { corridor.play_auto(&mut robot, &mut say) } else { corridor.play(&mut robot, &mut say) }?;
        robot.release()?;
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
    let mut figures = json!({
        "modes": story.modes, "changes": story.changes, "found": story.found, "seconds": rounded(whole.seconds()),
    });
    if args.auto {
        figures["mission"] = story.mission;
    }
    console.result(&figures)
}

/// Compares orders of the modes in random corridors.
async fn compared(count: u32, rig: Rig, console: Console, whole: &Stopwatch) -> Result<(), Failure> {
    console.say(
        "simulated: corridors, cameras, joints placed off by their play, matches with noise; times by a model of walking",
    )?;
    let progress = console.progress("corridors");
    let bar = progress.clone();
    let work = on_own_thread(move || {
        let rig = rig.with_sensors(WIDTH).map_err(|error| DemoError::UnknownPose(error.to_string()))?;
        Ok(compare(&rig, count, Sight::Sampled, &|| bar.inc(1))?)
    });
    let rows = tokio::select! {
        biased;
        () = interrupted() => Err(Failure::interrupted("interrupted: nothing was written".to_owned())),
        rows = work => rows,
    }?;
    progress.finish_and_clear();
    console.say(Comparison::HEAD)?;
    rows.iter().try_for_each(|row| console.say(row.in_words()))?;
    console.say(format!("{count} corridors; {:.1} s in all", whole.seconds()))?;
    let rows: Vec<_> = rows.iter().map(Comparison::json).collect();
    console.result(&json!({ "corridors": count, "modes_by": rows, "seconds": rounded(whole.seconds()) }))
}

/// Homes the rig and measures in every mode; counts them in `measured`.
async fn every_mode(
    args: &Args,
    lens: LensChoice,
    common: &CommonOptions,
    drawn: Rig,
    measured: &Cell<usize>,
    console: Console,
) -> Result<Vec<Value>, Failure> {
    let LensedRig { lenses, known, .. } = lensed(&drawn, (lens, args.seed), Some(&args.out), console).await?;
    let simulated = SharedRig::new(SimulatedRig::new(&drawn, args.seed)?);
    let (session, progress) = (SessionId((args.seed as u32).max(1)), console.progress("homing"));
    let mut board = board_of(&simulated, known, session, common.lease, progress.clone()).await?;
    let cameras = Arc::new(SimulatedPair::new(lenses, &simulated, args.seed));
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
