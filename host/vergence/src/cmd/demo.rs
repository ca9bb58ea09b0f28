//! `vergence demo`: the whole rig in simulation, scored against the truth.

mod see;

use std::path::PathBuf;

use serde_json::{Value, json};
use vergence_protocol::SessionId;
use vergence_rig::Mode;

use self::see::{SimulatedEyes, View};
use super::report::{axes_json, rounded};
use crate::board::Board;
use crate::cli::Globals;
use crate::console::Console;
use crate::failure::Failure;
use crate::output::{DepthPicture, depth_picture, make_folder, match_picture, ply, write_png, write_whole};
use crate::rig_file;
use crate::rig_zones::ZONE_RADIUS;
use crate::score::Spread;
use crate::sim::{SharedRig, SimulatedRig, board_of};
use crate::stopwatch::Stopwatch;

/// Starts a simulated rig in a simulated room, homes it, and in every mode of the rig looks, measures and compares with
/// the truth. Board, protocol, poses, matching and triangulation are the real ones; mechanics, room and cameras are
/// simulated. The truth scores the points and is used for nothing else.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Decides where the stages stand and the noise of the images. The same seed gives the same bytes.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Where clouds and pictures go.
    #[arg(long, default_value = "vergence-demo", value_name = "DIR")]
    out: PathBuf,
}

pub async fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let whole = Stopwatch::start();
    let rig = rig_file::load(globals.rig.as_deref())?;
    make_folder(&args.out)?;
    let simulated = SharedRig::new(SimulatedRig::new(&rig, args.seed)?);
    let (session, progress) = (SessionId((args.seed as u32).max(1)), console.progress("homing"));
    let mut board = board_of(&simulated, rig, session, globals.lease, progress.clone()).await?;
    let mut eyes = SimulatedEyes::new(board.rig(), &simulated, board.client().clock(), args.seed);
    let modes = board
        .armed(async |board| {
            board.home().await?;
            let mut modes = Vec::new();
            for mode in board.rig().modes.clone() {
                board.move_to(mode.number, &mode.targets).await?;
                progress.set_message(format!("{}: looking", mode.name));
                let view = eyes.see(board).await?;
                progress.suspend(|| tell(&mode, &view, board, console))?;
                save(&mode, &view, args)?;
                modes.push(in_json(&mode, &view, board));
            }
            Ok(modes)
        })
        .await?;
    progress.finish_and_clear();
    console.say(format!("clouds and pictures are in {}; {:.1} s in all", args.out.display(), whole.seconds()))?;
    console.result(&json!({ "modes": modes, "seconds": rounded(whole.seconds()) }))
}

fn tell(mode: &Mode, view: &View, board: &Board, console: Console) -> Result<(), Failure> {
    let axes = board.rig().axes.iter().zip(mode.targets.iter().zip(&view.pose.axes));
    let poses: Vec<_> = axes.map(|(axis, (target, &reached))| format!("{} {target} -> {reached}", axis.name)).collect();
    let [stereo, mono, blind] = [view.zones.stereo, view.zones.mono, view.zones.blind];
    let score = &view.score;
    let percent = |share: f64| 100.0 * share;
    console.say(format!(
        "{}\n  pose     {}\n  zones    stereo {stereo:.1}, mono {mono:.1}, blind {blind:.1} on a circle of {:.0}\n  \
         points   {} of {} matches\n  error    median {:.2} %, 95 % below {:.2} %, {:.2} % of points off by more than 10 %\n  \
         within 1.5 m: {} points, median {:.2} %\n  time     expose {:.2} s (simulated), match {:.2} s, triangulate {:.4} s",
        mode.name,
        poses.join(", "),
        ZONE_RADIUS,
        view.look.points.len(),
        view.look.matches,
        percent(score.all.median),
        percent(score.all.p95),
        percent(score.outlier_fraction),
        score.near.points,
        percent(score.near.median),
        view.expose_seconds,
        view.look.match_seconds,
        view.look.triangulate_seconds,
    ))
}

fn save(mode: &Mode, view: &View, args: &Args) -> Result<(), Failure> {
    let file = |suffix: &str| args.out.join(format!("{}{suffix}", mode.name));
    write_whole(&file(".ply"), ply(&view.look.points).as_bytes())?;
    write_png(&file("-matches.png"), &match_picture(view.eyes(), &view.look.points))?;
    let truth = |pixel| view.true_range(pixel);
    let depth = DepthPicture { left: view.eyes().left, points: &view.look.points, truth: Some(&truth) };
    write_png(&file("-depth.png"), &depth_picture(&depth))
}

fn in_json(mode: &Mode, view: &View, board: &Board) -> Value {
    let spread = |spread: &Spread| json!({ "median": spread.median, "p95": spread.p95 });
    json!({
        "name": mode.name,
        "commanded": axes_json(board.rig(), &mode.targets),
        "achieved": axes_json(board.rig(), &view.pose.axes),
        "zones_deg": super::zones::in_degrees(&view.zones),
        "points": view.look.points.len(),
        "depth_rel_err": spread(&view.score.all),
        "depth_rel_err_within_1500mm": spread(&view.score.near),
        "points_within_1500mm": view.score.near.points,
        "outlier_fraction": view.score.outlier_fraction,
        "dropped": view.look.dropped,
        "stage_seconds": {
            "expose": rounded(view.expose_seconds),
            "match": rounded(view.look.match_seconds),
            "triangulate": rounded(view.look.triangulate_seconds),
        },
    })
}
