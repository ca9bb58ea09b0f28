//! `vergence demo`: the whole rig in simulation, scored against the truth.

mod measure;

use std::cell::Cell;
use std::future::pending;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use image::ImageError;
use serde_json::{Value, json};
use vergence_board::Board;
use vergence_pipeline::{Spread, Stage, ZONE_RADIUS};
use vergence_protocol::SessionId;
use vergence_rig::{Mode, Rig};

use self::measure::{Pulse, SimulatedPair, View};
use super::cloud_report::{dropped_json, dropped_lines};
use super::report::{axes_json, rounded, zones_json};
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::{interrupted, on_own_thread};
use crate::output::{check_folder, depth_svg, error_svg, make_folder, match_svg, ply, write_png, write_whole};
use crate::rig_file;
use crate::sim::{SharedRig, SimulatedRig, board_of};
use crate::stopwatch::Stopwatch;

/// Starts a simulated rig in a simulated room, homes it, and in every mode of the rig takes a pair of images, measures it and
/// compares the points with the truth. Board, protocol, poses, matching and triangulation are the real ones; mechanics, room
/// and cameras are simulated. The truth scores the points and is used for nothing else.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Sets where the stages stand at first and the noise of the images. The same seed gives the same bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// The folder for clouds and pictures.
    #[arg(long, default_value = "vergence-demo", value_name = "DIR")]
    out: PathBuf,
}

pub async fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let whole = Stopwatch::start();
    check_folder(&args.out)?;
    let rig = rig_file::load(globals.rig.as_deref())?;
    make_folder(&args.out)?;
    let (all, measured) = (rig.modes.len(), Cell::new(0));
    let modes = tokio::select! {
        // The simulated board ends with this process: nothing has to be disarmed.
        biased;
        () = interrupted() => Err(Failure::interrupted(format!(
            "interrupted: {} of {all} modes are measured, finished files are in {}; run the command again for all of them",
            measured.get(),
            args.out.display()
        ))),
        modes = every_mode(args, globals, rig, &measured, console) => modes,
    }?;
    console.say(format!("clouds and pictures are in {}; {:.1} s in all", args.out.display(), whole.seconds()))?;
    console.result(&json!({ "modes": modes, "seconds": rounded(whole.seconds()) }))
}

/// Homes the rig and measures in every mode; counts them in `measured`.
async fn every_mode(
    args: &Args,
    globals: &Globals,
    rig: Rig,
    measured: &Cell<usize>,
    console: Console,
) -> Result<Vec<Value>, Failure> {
    let simulated = SharedRig::new(SimulatedRig::new(&rig, args.seed)?);
    let (session, progress) = (SessionId((args.seed as u32).max(1)), console.progress("homing"));
    let mut board = board_of(&simulated, rig, session, globals.lease, progress.clone()).await?;
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
                let view = cameras.measure(&pulse)?;
                save(&name, &view, &out)?;
                Ok(view)
            });
            let view = view.await?;
            progress.suspend(|| print(&mode, &view, board, console))?;
            modes.push(in_json(&mode, &view, board));
            measured.set(modes.len());
        }
        Ok(modes)
    });
    let modes = modes.await?;
    progress.finish_and_clear();
    Ok(modes)
}

fn print(mode: &Mode, view: &View, board: &Board, console: Console) -> Result<(), Failure> {
    let axes = board.rig().axes.iter().zip(mode.targets.iter().zip(&view.pose.axes));
    let poses: Vec<_> = axes.map(|(axis, (target, &reached))| format!("{} {target} -> {reached}", axis.name)).collect();
    let [stereo, mono, blind] = [view.zones.stereo, view.zones.mono, view.zones.blind];
    let score = &view.score;
    let percent = |share: f64| 100.0 * share;
    let dropped: String = dropped_lines(&view.cloud.dropped).iter().map(|line| format!("\n         {line}")).collect();
    console.say(format!(
        "{}\n  pose     {}\n  zones    stereo {stereo:.1}, mono {mono:.1}, blind {blind:.1} on a circle of {:.0}\n  \
         points   {} of {} matches, {} keypoints{dropped}\n  error    median {:.2} %, 95 % below {:.2} %, {:.2} % of points off by more than 10 %\n  \
         within 1.5 m: {} points, median {:.2} %\n  time     expose {:.2} s (simulated), match {:.2} s, triangulate {:.4} s",
        mode.name,
        poses.join(", "),
        ZONE_RADIUS,
        view.cloud.points.len(),
        view.cloud.matches,
        view.cloud.keypoints,
        percent(score.all.median),
        percent(score.all.p95),
        percent(score.outlier_fraction),
        score.near.points,
        percent(score.near.median),
        view.expose_seconds,
        view.times.of(Stage::Match),
        view.times.of(Stage::Triangulate),
    ))
}

/// Writes the cloud, the images that it was measured from, and pictures of matches, ranges and errors.
fn save(mode: &str, view: &View, out: &Path) -> Result<(), Failure> {
    let file = |suffix: &str| out.join(format!("{mode}{suffix}"));
    let draw = |suffix: &str, drawn: Result<String, ImageError>| {
        let path = file(suffix);
        write_whole(&path, drawn.map_err(|error| Failure::output(&path, error))?.as_bytes())
    };
    let (images, points) = (view.images(), &view.cloud.points);
    let truth = |pixel| view.true_range(pixel);
    write_whole(&file(".ply"), ply(points).as_bytes())?;
    write_png(&file("-left.png"), images.left)?;
    write_png(&file("-right.png"), images.right)?;
    draw("-matches.svg", match_svg(images, &view.cloud))?;
    draw("-depth.svg", depth_svg(images.left, points, &truth))?;
    draw("-error.svg", error_svg(images.left, points, &truth))
}

fn in_json(mode: &Mode, view: &View, board: &Board) -> Value {
    let spread = |spread: &Spread| json!({ "median": spread.median, "p95": spread.p95 });
    json!({
        "name": mode.name,
        "commanded": axes_json(board.rig(), &mode.targets),
        "achieved": axes_json(board.rig(), &view.pose.axes),
        "zones_deg": zones_json(&view.zones),
        "points": view.cloud.points.len(),
        "matches": view.cloud.matches,
        "keypoints": view.cloud.keypoints,
        "depth_rel_err": spread(&view.score.all),
        "depth_rel_err_within_1500mm": spread(&view.score.near),
        "points_within_1500mm": view.score.near.points,
        "outlier_fraction": view.score.outlier_fraction,
        "dropped": dropped_json(&view.cloud.dropped),
        "stage_seconds": {
            "expose": rounded(view.expose_seconds),
            "match": rounded(view.times.of(Stage::Match)),
            "triangulate": rounded(view.times.of(Stage::Triangulate)),
        },
    })
}
