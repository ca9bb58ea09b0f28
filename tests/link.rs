//! Host and simulated board in one process and virtual time.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

use vergence::board::Board;
use vergence::link::{Client, HostClock, OpenWire};
use vergence::move_plan::MovePlan;
use vergence::sim::{SharedRig, SimulatedRig, spawn_in_process};
use vergence_protocol::SessionId;
use vergence_rig::{BENCH_TOML, Rig};

fn bench() -> Rig {
    Rig::from_toml(BENCH_TOML).expect("the bench")
}

async fn board() -> Board {
    let rig = bench();
    let simulated = SharedRig::new(SimulatedRig::new(&rig, 1).expect("a simulated rig"));
    let wire = OpenWire::in_process(spawn_in_process(simulated));
    let client = Client::connect(wire, SessionId(7), HostClock::start()).await.expect("a session");
    Board::new(client, rig, 100, indicatif::ProgressBar::hidden()).await.expect("a board")
}

#[tokio::test(start_paused = true)]
async fn a_plan_takes_as_long_as_the_move() {
    let mut board = board().await;
    let modes = board.rig().modes.clone();
    let plan = MovePlan::new(&bench(), &board.limits().await.expect("limits"), &modes[0].targets, &modes[1].targets);
    board
        .armed(async |board| {
            board.home().await?;
            board.move_to(modes[0].number, &modes[0].targets).await?;
            let start = tokio::time::Instant::now();
            board.move_to(modes[1].number, &modes[1].targets).await?;
            let took = start.elapsed().as_secs_f64();
            println!("planned {:.3} s, moved and settled in {took:.3} s", plan.duration);
            // Settling takes a dwell, and poses come each 10 ms.
            assert!((0.0..0.2).contains(&(took - plan.duration)));
            Ok(())
        })
        .await
        .expect("it moves");
}
