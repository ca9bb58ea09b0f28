//! Host and simulated board in one process and virtual time.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

use std::future::pending;
use std::time::Duration;

use vergence::sim::{self, SharedRig, SimulatedRig};
use vergence_board::{Board, BoardError, MovePlan, MoveStart};
use vergence_protocol::{SessionId, SettingItem, SettingKey};
use vergence_rig::{BENCH_TOML, Rig};

fn bench() -> Rig {
    Rig::from_toml(BENCH_TOML).expect("the bench")
}

fn simulated() -> SharedRig {
    SharedRig::new(SimulatedRig::new(&bench(), 1).expect("a simulated rig"))
}

async fn board() -> Board {
    board_of(&simulated(), 7).await
}

/// A session with a simulated board.
async fn board_of(simulated: &SharedRig, session: u32) -> Board {
    let hidden = indicatif::ProgressBar::hidden();
    sim::board_of(simulated, bench(), SessionId(session), 100, hidden).await.expect("a board")
}

/// Microseconds from one pose to the next.
async fn pose_period(board: &mut Board) -> u64 {
    let first = board.next_pose().await.expect("a pose").at.0;
    board.next_pose().await.expect("a pose").at.0 - first
}

/// What is set means something: every session takes the pose stream as the board is set to, and one that could not follow it
/// asks for more, says so, and leaves the setting alone.
#[tokio::test(start_paused = true)]
async fn the_board_s_own_stream_period_is_kept_to() {
    let (simulated, key) = (simulated(), SettingKey { item: SettingItem::StreamPeriod, axis: 0 });
    let cases = [
        (2_000, 2_000, None),
        (50_000, 50_000, None),
        (0, 10_000, Some("no poses")),
        (2_000_000, 10_000, Some("2000 ms")),
    ];
    for (session, (set, period, note)) in (10..).step_by(2).zip(cases) {
        let setter = board_of(&simulated, session).await;
        setter.set(key, set).await.expect("the link holds").expect("a period");
        drop(setter);
        let mut board = board_of(&simulated, session + 1).await;
        assert_eq!(pose_period(&mut board).await, period, "set to {set}");
        match (board.stream_note(), note) {
            (Some(said), Some(part)) => assert!(said.contains(part) && said.contains("stays"), "{said}"),
            (said, part) => assert_eq!(said, part),
        }
        assert_eq!(board.setting(key).await, Ok(Some(set)));
    }
}

#[tokio::test(start_paused = true)]
async fn a_plan_takes_as_long_as_the_move() {
    let mut board = board().await;
    let modes = board.rig().modes.clone();
    let start = MoveStart { positions: &modes[0].targets, from_below: true };
    let plan = MovePlan::new(&bench(), &board.limits().await.expect("limits"), start, &modes[1].targets);
    board
        .armed(pending(), async |board| -> Result<_, BoardError> {
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

#[tokio::test(start_paused = true)]
async fn settings_are_refused_while_armed() {
    let mut board = board().await;
    let key = SettingKey { item: SettingItem::Speed, axis: 0 };
    let refusal = board
        .armed(pending(), async |board| -> Result<_, BoardError> {
            assert_eq!(board.setting(key).await?, Some(80_000));
            board.set(key, 40_000).await
        })
        .await
        .expect("the link holds")
        .expect_err("it is armed");
    let said = board.refused(refusal).to_string();
    assert!(said.contains("only while disarmed") && said.contains("vergence disarm"), "{said}");
    assert_eq!(board.setting(key).await, Ok(Some(80_000)));
    board.set(key, 40_000).await.expect("the link holds").expect("it is disarmed");
    assert_eq!(board.setting(key).await, Ok(Some(40_000)));
}

/// Regression: every session numbered its moves from 1, and a pose that was on its way when a move was ordered still told of
/// the move of the session before, as settled. The new move then counted as reached where it had not begun.
#[tokio::test(start_paused = true)]
#[allow(clippy::disallowed_methods, reason = "virtual time")]
async fn a_move_of_the_session_before_is_not_taken_for_this_one() {
    let (simulated, modes) = (simulated(), bench().modes);
    let mut before = board_of(&simulated, 10).await;
    let homed = before.armed(pending(), async |board| -> Result<_, BoardError> {
        board.home().await?;
        board.move_to(modes[0].number, &modes[0].targets).await
    });
    homed.await.expect("it moves");
    drop(before);

    let mut board = board_of(&simulated, 11).await;
    board
        .armed(pending(), async |board| -> Result<_, BoardError> {
            // Long enough for a pose to come that nobody has looked at when the move is ordered.
            tokio::time::sleep(Duration::from_millis(25)).await;
            board.move_to(modes[1].number, &modes[1].targets).await
        })
        .await
        .expect("it moves");
    for (reached, target) in board.positions().iter().zip(&modes[1].targets) {
        assert!(reached.minus(*target).value().abs() < 0.001, "{reached} is not {target}");
    }
}
