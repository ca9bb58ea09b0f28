//! A homed simulated rig whose cameras feed the live loop, as `vergence run` sets it up: trigger, images paired with pulses, encoder stream.

use std::future::pending;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::mpsc;
use vergence::sim::{SharedRig, SimulatedRig, board_of};
use vergence_board::Board;
use vergence_live::{LiveLoop, MatchingTime, drive};
use vergence_matching::TrackingMatcher;
use vergence_pipeline::Exposures;
use vergence_protocol::SessionId;
use vergence_rig::Rig;
use vergence_sim::{LiveCamera, Room, RoomCamera};
use vergence_vision::Side;

/// The rig, the host's board, and the live loop.
pub struct LiveBench {
    pub simulated: SharedRig,
    pub board: Board,
    pub live: LiveLoop,
}

/// What a live bench is made of.
pub struct Setting<'a> {
    /// The rig as it is, and the one that the host believes.
    pub rigs: [&'a Rig; 2],
    pub room: &'a Arc<Room>,
    /// Of the rig, and of the noise of the cameras.
    pub seeds: [u64; 2],
    /// From one pulse to the next.
    pub period_us: u32,
    /// What matching a pair takes.
    pub matching: Duration,
}

impl LiveBench {
    pub async fn homed(Setting { rigs: [built, believed], room, seeds, period_us, matching }: Setting<'_>) -> Self {
        let simulated = SharedRig::new(SimulatedRig::new(built, seeds[0]).expect("a simulated rig"));
        let hidden = indicatif::ProgressBar::hidden();
        let mut board = board_of(&simulated, believed.clone(), SessionId(7), 1000, hidden).await.expect("a board");
        board.compare_clocks().await.expect("the link holds");
        board.armed(pending(), async |board| board.home().await).await.expect("homed");
        let (listener, events) = mpsc::channel(16);
        let clock = board.client().clock();
        for (side, shutter) in [Side::Left, Side::Right].into_iter().zip(built.shutters) {
            let camera = RoomCamera { side, lens: *built.camera(side), room: Arc::clone(room), seed: seeds[1] };
            tokio::spawn(drive(LiveCamera::new(camera, shutter, &[]), simulated.clone(), clock, listener.clone()));
        }
        let live = LiveLoop {
            rig: Arc::new(believed.clone()),
            matcher: Arc::new(TrackingMatcher::default()),
            search: Arc::default(),
            memory: Arc::default(),
            events,
            marks: Some(board.client_mut().take_marks()),
            board: Some(board.client().knowledge()),
            clock,
            exposures: Exposures::new(Some(f64::from(period_us))),
            matching_time: MatchingTime::Fixed(matching),
            stopwatch: || Duration::ZERO,
            budget: None,
            dense: false,
        };
        Self { simulated, board, live }
    }
}
