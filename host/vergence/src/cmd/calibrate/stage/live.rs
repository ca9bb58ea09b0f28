//! The rig drives itself through the stage poses while somebody holds the board.

use std::path::Path;

use rayon::prelude::*;
use tokio::task::spawn_blocking;
use vergence_calibration::{BoardSpec, Coverage};
use vergence_protocol::Mode;
use vergence_rig::{AxisPosition, Rig};
use vergence_vision::{Camera as CameraFrame, Pixel, Right, Side, UnitRay};

use super::recorded::{FOLDER, POSES, column, number};
use crate::board::{Board, fresh_session};
use crate::board_watch::{BoardWatch, NAMES, Seen, seen};
use crate::camera::{BoardStage, Camera, Frame, SimulatedBoardCamera};
use crate::cli::Globals;
use crate::cmd::camera_options::CameraOptions;
use crate::cmd::connect::{connect, port};
use crate::console::Console;
use crate::failure::Failure;
use crate::link::{HostClock, Port};
use crate::output::{make_folder, write_png, write_whole};
use crate::rig_file;
use crate::sim::{SharedRig, SimulatedRig, board_of, built};
use crate::stage_plan::stage_plan;

/// How the rig is driven.
#[derive(Debug, clap::Args)]
pub struct Options {
    /// Drive the rig itself through the stage poses and take the views.
    ///
    /// It homes the rig, moves it to poses far apart, and says at each where to show the board. A view counts where both
    /// cameras see the board held still, somewhere new. What was taken is kept in the set, whatever ends it.
    #[arg(long, requires = "set")]
    pub live: bool,
    /// With --live: how many stage poses.
    #[arg(long, default_value_t = 6, value_parser = clap::value_parser!(u16).range(3..=81))]
    poses: u16,
    /// With --live: how many views at each.
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u16).range(3..))]
    views: u16,
    /// With --live: give up after this many frames at one stage pose.
    #[arg(long, default_value_t = 100_000)]
    frames: u64,
    /// Of a simulated rig: how it was really built, where the board is held, and the noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    #[command(flatten)]
    camera: CameraOptions,
}

/// A stage that moves while views are taken is not the one that the encoders read, in encoder steps.
const STILL_STEPS: f64 = 4.0;
/// The advice is about a board this far away.
const BOARD_MM: f64 = 300.0;

/// Fills the set folder `set`. Every image is written at once and poses.csv after every stage pose: whatever ends it, what
/// was taken is kept. The rig as it was really built comes back where it is simulated.
///
/// # Errors
/// Those of the board and the cameras; a stage that does not stand still.
pub async fn fill(
    set: &Path,
    options: &Options,
    cameras: &[String],
    board: BoardSpec,
    globals: &Globals,
    console: Console,
) -> Result<Option<Rig>, Failure> {
    if set.join(POSES).exists() {
        return Err(Failure::output(set, "a set is there already: choose another folder"));
    }
    let drawn = rig_file::load(globals.rig.as_deref())?;
    let (mut rig_board, mut eyes) = open(options, cameras, &drawn, &board, globals, console).await?;
    make_folder(set)?;
    let plan = stage_plan(&drawn.axes, options.poses.into());
    let session = Session { set, options, board, drawn: &drawn, console };
    rig_board
        .armed(async |rig_board| {
            rig_board.home().await?;
            let mut rows = Vec::new();
            for (index, targets) in plan.iter().enumerate() {
                rig_board.move_to(Mode(0), targets).await?;
                let heading = format!("pose {} of {} at {}", index + 1, plan.len(), in_words(targets));
                rows.push(session.stage_pose(index, &heading, rig_board, &mut eyes).await?);
                session.write_poses(&rows)?;
            }
            Ok(())
        })
        .await?;
    Ok(match eyes {
        Eyes::Simulated(simulator) => Some(simulator.built),
        Eyes::Attached(_) => None,
    })
}

fn in_words(positions: &[AxisPosition]) -> String {
    positions.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")
}

/// The cameras of the rig.
enum Eyes {
    Attached(Vec<Box<dyn Camera>>),
    Simulated(Box<Simulator>),
}

/// Cameras that ride on simulated mechanics, and somebody who knows where they look and holds a simulated board.
struct Simulator {
    rig: SharedRig,
    built: Rig,
    board: vergence_scene::Board,
    seed: u64,
}

async fn open(
    options: &Options,
    cameras: &[String],
    drawn: &Rig,
    board: &BoardSpec,
    globals: &Globals,
    console: Console,
) -> Result<(Board, Eyes), Failure> {
    match (port(globals)?, cameras) {
        (Port::Simulated, [only]) if only == "sim" => {
            let built = built(drawn, options.seed);
            let rig = SharedRig::new(SimulatedRig::new(&built, options.seed)?);
            let (session, progress) = (fresh_session()?, console.progress("homing"));
            let board_of_rig = board_of(&rig, drawn.clone(), session, globals.lease, progress).await?;
            let board = vergence_scene::Board { columns: board.columns, rows: board.rows, square: board.square };
            Ok((board_of_rig, Eyes::Simulated(Box::new(Simulator { rig, built, board, seed: options.seed }))))
        }
        (Port::Simulated, _) => {
            Err(Failure::usage("on a simulated rig ride simulated cameras: --port sim --cameras sim"))
        }
        (_, [left, right]) => {
            let clock = HostClock::start();
            let attached = [left, right].map(|device| options.camera.open(device, clock));
            let attached = attached.into_iter().collect::<Result<_, _>>()?;
            Ok((connect(globals, console, "homing").await?, Eyes::Attached(attached)))
        }
        _ => Err(Failure::usage("name the left and the right camera: --cameras /dev/video0 /dev/video2")),
    }
}

impl Eyes {
    /// The cameras where the stage stands now, for its `index`th pose.
    fn here(&mut self, index: usize) -> Vec<Box<dyn Camera>> {
        match self {
            Self::Attached(cameras) => std::mem::take(cameras),
            Self::Simulated(simulator) => simulator.cameras(index),
        }
    }

    fn give_back(&mut self, cameras: Vec<Box<dyn Camera>>) {
        if let Self::Attached(own) = self {
            *own = cameras;
        }
    }
}

impl Simulator {
    fn cameras(&self, index: usize) -> Vec<Box<dyn Camera>> {
        let stage = BoardStage {
            left: self.built.left_camera,
            right: (self.built.right_camera, self.rig.lock().true_pose().left_from_right),
            both: true,
            board: self.board,
            // Another seed for each stage pose, so that the board is held elsewhere.
            seed: self.seed.wrapping_mul(1009).wrapping_add(index as u64),
        };
        let camera = |side| Box::new(SimulatedBoardCamera { stage, side, frames: 0 }) as Box<dyn Camera>;
        vec![camera(Side::Left), camera(Side::Right)]
    }
}

/// What stays the same over all stage poses.
struct Session<'a> {
    set: &'a Path,
    options: &'a Options,
    board: BoardSpec,
    drawn: &'a Rig,
    console: Console,
}

impl Session<'_> {
    /// Takes the views of one stage pose; its row of poses.csv.
    async fn stage_pose(
        &self,
        index: usize,
        heading: &str,
        rig_board: &mut Board,
        eyes: &mut Eyes,
    ) -> Result<String, Failure> {
        let name = format!("pose{:02}", index + 1);
        let folder = self.set.join(&name);
        make_folder(&folder)?;
        rig_board.next_pose().await?;
        let readings = rig_board.positions();
        let mut watch = BoardWatch::new(vec![self.coverage(&readings)]);
        let mut cameras = eyes.here(index);
        let progress = self.console.progress(heading);
        let wanted = usize::from(self.options.views);
        let mut frames_seen = 0;
        while watch.taken() < wanted {
            let (frames, views);
            (cameras, frames, views) = look(cameras, self.board).await?;
            frames_seen += 1;
            if frames_seen > self.options.frames {
                return Err(Failure::device(format!(
                    "{heading}: {} of {wanted} views in {frames_seen} frames",
                    watch.taken()
                )));
            }
            if watch.look(views) && (watch.is_news() || watch.is_elsewhere()) {
                for (frame, side) in frames.iter().zip(NAMES) {
                    write_png(&folder.join(format!("{side}{:03}.png", watch.taken())), &frame.image)?;
                }
                watch.take();
            }
            let advice = watch.advice().unwrap_or_else(|| "show the board elsewhere, or tilted".into());
            progress.set_message(format!("{heading}: view {} of {wanted}; {advice}", watch.taken()));
            progress.tick();
        }
        progress.finish_and_clear();
        eyes.give_back(cameras);
        rig_board.next_pose().await?;
        self.check_still(&readings, &rig_board.positions())?;
        let more = match watch.advice() {
            None => "the shared field is covered".to_owned(),
            Some(advice) => format!("better still: {advice}"),
        };
        self.console.say(format!("{heading}: {wanted} views in {frames_seen} frames; {more}"))?;
        let numbers = readings.iter().map(|&reading| format!("{:.6}", number(reading)));
        Ok([name].into_iter().chain(numbers).collect::<Vec<_>>().join(","))
    }

    fn check_still(&self, before: &[AxisPosition], after: &[AxisPosition]) -> Result<(), Failure> {
        for ((axis, &before), &after) in self.drawn.axes.iter().zip(before).zip(after) {
            let moved = after.minus(before);
            if moved.value().abs() > STILL_STEPS * axis.value_per_count() {
                return Err(Failure::device(format!(
                    "axis '{}' moved by {moved} while views were taken: it must stand still",
                    axis.name
                )));
            }
        }
        Ok(())
    }

    /// Of the left camera, as far as the right one sees the same by the drawing.
    fn coverage(&self, readings: &[AxisPosition]) -> Coverage {
        let (left, right) = (&self.drawn.left_camera, &self.drawn.right_camera);
        let values: Vec<f64> = readings.iter().map(|reading| reading.value()).collect();
        let right_from_left = self.drawn.pose_at_values(&values).right_from_left();
        Coverage::within(left.size(), |pixel: Pixel| {
            let Ok(ray) = left.unproject::<CameraFrame>(pixel) else { return false };
            let point = right_from_left * ray.renamed().at(BOARD_MM);
            UnitRay::<Right>::new(point.mm())
                .and_then(|ray| right.project(&ray).ok())
                .is_some_and(|p| right.on_sensor(p))
        })
    }

    fn write_poses(&self, rows: &[String]) -> Result<(), Failure> {
        let columns = self.drawn.axes.iter().map(column);
        let header = [FOLDER.to_owned()].into_iter().chain(columns).collect::<Vec<_>>().join(",");
        let text = [header].iter().chain(rows).map(|line| format!("{line}\n")).collect::<String>();
        write_whole(&self.set.join(POSES), text.as_bytes())
    }
}

/// Exposes all cameras and looks for the board, beside the link, which must not wait.
async fn look(
    mut cameras: Vec<Box<dyn Camera>>,
    board: BoardSpec,
) -> Result<(Vec<Box<dyn Camera>>, Vec<Frame>, Seen), Failure> {
    let looked = spawn_blocking(move || {
        let grab = |camera: &mut Box<dyn Camera>| camera.grab()?.ok_or_else(|| Failure::device("a camera ended"));
        let frames: Vec<Frame> = cameras.par_iter_mut().map(grab).collect::<Result<_, Failure>>()?;
        let views = seen(&frames, &board);
        Ok((cameras, frames, views))
    });
    looked.await.map_err(|error| Failure::device(format!("looking through the cameras failed: {error}")))?
}
