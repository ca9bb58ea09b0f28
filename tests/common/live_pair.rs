//! One pair measured by the live loop on a simulated rig whose file is not quite what was built.

use std::future::pending;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::mpsc;
use vergence::failure::Failure;
use vergence::sim::{SharedRig, SimulatedRig, board_of};
use vergence_live::{Limits, LiveLoop, LiveResult, MatchingTime, Totals, drive};
use vergence_matching::GuidedMatcher;
use vergence_pipeline::{Exposures, Observation, PairCloud};
use vergence_protocol::{Mode, Request, SessionId, Trigger};
use vergence_rig::{AxisPosition, Rig, RigPose};
use vergence_sim::{LiveCamera, Room, RoomCamera};
use vergence_vision::Side;

const PERIOD_US: u32 = 100_000;

/// Homes the rig that was `built`, moves it to `targets`, and measures one pair by the rig file `written`, as `vergence run` does: trigger, images paired
/// with pulses, encoder stream, matching. Also returns the true pose.
pub async fn live_pair(
    (built, written): (&Rig, &Rig),
    room: &Arc<Room>,
    targets: &[AxisPosition],
    seed: u64,
) -> (PairCloud, RigPose) {
    let simulated = SharedRig::new(SimulatedRig::new(built, seed).expect("a simulated rig"));
    let hidden = indicatif::ProgressBar::hidden();
    let mut board = board_of(&simulated, written.clone(), SessionId(7), 1000, hidden).await.expect("a board");
    board.compare_clocks().await.expect("the link holds");
    board.armed(pending(), async |board| board.home().await).await.expect("homed");
    let (listener, events) = mpsc::channel(16);
    let clock = board.client().clock();
    for (side, shutter) in [Side::Left, Side::Right].into_iter().zip(built.shutters) {
        let camera = RoomCamera { side, lens: *built.camera(side), room: Arc::clone(room), seed };
        tokio::spawn(drive(LiveCamera::new(camera, shutter, &[]), simulated.clone(), clock, listener.clone()));
    }
    let mut live = LiveLoop {
        rig: Arc::new(written.clone()),
        matcher: Arc::new(GuidedMatcher::default()),
        search: Arc::default(),
        memory: Arc::default(),
        events,
        marks: Some(board.client_mut().take_marks()),
        board: Some(board.client().knowledge()),
        clock,
        exposures: Exposures::new(Some(f64::from(PERIOD_US))),
        matching_time: MatchingTime::Fixed(Duration::from_millis(50)),
        stopwatch: || Duration::ZERO,
    };
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
