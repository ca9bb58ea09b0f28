//! Drives the simulated rig over the real protocol: where it stands while it is calibrated and while it measures, by its
//! encoders and in truth.

use vergence_board::{Board, Shared};
use vergence_calibration::stage_plan;
use vergence_protocol::{Mode, PoseReport, SessionId};
use vergence_rig::{AxisPosition, Rig, RigAxis};
use vergence_sim::{Random, SimulatedRig};
use vergence_vision::{Left, Right, Transform};

use crate::bench::{Bench, MODES};
use crate::error::ReproduceError;

/// Lease of the simulated boards, in milliseconds.
const LEASE_MS: u16 = 100;
/// Stage poses of a calibration.
pub const STAGE_POSES: usize = 6;

/// Where the stage came to stand.
#[derive(Clone, Debug)]
pub struct Stop {
    /// What the encoders read.
    pub readings: Vec<AxisPosition>,
    /// Where the right camera really is.
    pub truth: Transform<Left, Right>,
}

/// Where axes stand that were sent somewhere without a board.
pub struct Standing {
    /// What the encoders read.
    pub readings: Vec<AxisPosition>,
    /// Where the axes truly are, in millimetres or radians.
    pub values: Vec<f64>,
}

impl Standing {
    /// At the counts nearest to `targets`, and anywhere within them.
    pub fn sent_to(axes: &[RigAxis], targets: &[AxisPosition], random: &mut Random) -> Self {
        let read = |(axis, to): (&RigAxis, &AxisPosition)| axis.value_at(axis.counts_at(to.value()).round());
        let read: Vec<f64> = axes.iter().zip(targets).map(read).collect();
        let within =
            axes.iter().zip(&read).map(|(axis, read)| read + random.between(-0.5, 0.5) * axis.value_per_count());
        let values = within.collect();
        let position = |(axis, value): (&RigAxis, &f64)| AxisPosition::from_value(axis.kind, *value);
        Self { readings: axes.iter().zip(&read).map(position).collect(), values }
    }
}

/// All stops of one seed.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Where the stage is calibrated.
    pub calibration: Vec<Stop>,
    /// Where the bench measures, one for each of [`MODES`].
    pub modes: Vec<Stop>,
}

/// The targets of all axes at every stop, in the order in which the stage drives to them, and the mode of each.
#[derive(Clone, Debug, PartialEq)]
pub struct Route {
    /// The poses of a stage calibration.
    pub calibration: Vec<(Mode, Vec<AxisPosition>)>,
    /// The modes that the bench compares.
    pub modes: Vec<(Mode, Vec<AxisPosition>)>,
}

impl Route {
    /// The route of a bench.
    #[must_use]
    pub fn of(bench: &Bench) -> Self {
        let drawn = &bench.drawn;
        let modes = MODES.iter().filter_map(|name| drawn.mode(name));
        Self {
            calibration: stage_plan(&drawn.axes, STAGE_POSES).into_iter().map(|targets| (Mode(0), targets)).collect(),
            modes: modes.map(|mode| (mode.number, mode.targets.clone())).collect(),
        }
    }
}

/// Homes the simulated rig of `bench` and drives it along its route over the real protocol; `observer` hears of every pose.
/// The same `seed` gives the same readings.
///
/// # Errors
/// Those of the simulation and of the board.
pub async fn drive(
    bench: &Bench,
    seed: u64,
    observer: impl FnMut(&Rig, &PoseReport) + Send + 'static,
) -> Result<Drive, ReproduceError> {
    let simulated = Shared::new(SimulatedRig::new(&bench.built, seed)?);
    let session = SessionId((seed as u32).max(1));
    let board = Board::in_process(simulated.clone(), bench.drawn.clone(), session, LEASE_MS).await?;
    let mut board = board.observed(observer);
    let route = Route::of(bench);
    board
        .armed(std::future::pending(), async |board| -> Result<Drive, ReproduceError> {
            board.home().await?;
            let mut drive = Drive { calibration: Vec::new(), modes: Vec::new() };
            for (stops, targets) in [(&mut drive.calibration, &route.calibration), (&mut drive.modes, &route.modes)] {
                for (mode, targets) in targets {
                    stops.push(stop(board, &simulated, *mode, targets).await?);
                }
            }
            Ok(drive)
        })
        .await
}

async fn stop(
    board: &mut Board,
    rig: &Shared<SimulatedRig>,
    mode: Mode,
    targets: &[AxisPosition],
) -> Result<Stop, ReproduceError> {
    board.move_to(mode, targets).await?;
    board.next_pose().await?;
    Ok(Stop { readings: board.positions(), truth: rig.lock().true_pose().left_from_right })
}
