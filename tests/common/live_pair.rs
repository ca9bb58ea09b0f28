//! One pair measured by the live loop on a simulated rig whose file is not quite what was built.

use std::future::pending;
use std::sync::Arc;
use std::time::Duration;

use vergence::failure::Failure;
use vergence_live::{Limits, LiveResult, Totals};
use vergence_pipeline::{Observation, PairCloud};
use vergence_protocol::{Mode, Request, Trigger};
use vergence_rig::{AxisPosition, Rig, RigPose};
use vergence_sim::Room;

use crate::live_bench::{LiveBench, Setting};

const PERIOD_US: u32 = 100_000;

/// Homes the rig that was `built`, moves it to `targets`, and measures one pair by the rig file `written`, as `vergence run` does: trigger, images paired
/// with pulses, encoder stream, matching. Also returns the true pose.
pub async fn live_pair(
    (built, written): (&Rig, &Rig),
    room: &Arc<Room>,
    targets: &[AxisPosition],
    seed: u64,
) -> (PairCloud, RigPose) {
    let (rigs, matching) = ([built, written], Duration::from_millis(50));
    let setting = Setting { rigs, room, seeds: [seed; 2], period_us: PERIOD_US, matching };
    let LiveBench { simulated, mut board, mut live } = LiveBench::homed(setting).await;
    let (mut found, mut totals) = (None, Totals::default());
    board
        .armed(pending(), async |board| -> Result<_, Failure> {
            board.move_to(Mode(0), targets).await?;
            board.ask(Request::SetTrigger(Trigger::Every { period_us: PERIOD_US })).await?;
            let publish = |result: LiveResult<'_>| {
                let middle = result.measurement.middle.us;
                let pose = simulated.lock().history().pose_at(built, middle).expect("remembered");
                if let Observation::Points { cloud, .. } = &result.measurement.observation {
                    found = Some((cloud.as_ref().clone(), pose));
                }
                Ok::<(), Failure>(())
            };
            let limits = Limits { results: Some(1), time: Some(Duration::from_secs(20)) };
            live.run(limits, &mut totals, publish, |warning| println!("{warning}")).await?;
            Ok(())
        })
        .await
        .expect("it moves and measures");
    found.expect("both cameras are there")
}
