//! A program whose moving loop hangs does not keep its lease: the board brakes.
#![allow(clippy::expect_used, reason = "a test fails loudly")]

use std::convert::Infallible;
use std::future::pending;
use std::time::Duration;

use vergence_board::{Board, BoardError, Served, Shared};
use vergence_plant::{NativeBoard, bench_mechanics, bench_settings};
use vergence_protocol::{
    ControllerState, FaultCode, Micro, Microseconds, Mode, Move, MoveId, MovePhase, Permille, Request, SessionId,
};
use vergence_rig::{BENCH_TOML, Rig};

/// Age of the board when the host connects: its self test is over.
const STARTED_US: u64 = 1_000_000;

/// The native board at the pace of tokio's clock.
struct Bench {
    board: NativeBoard,
    output: Vec<u8>,
}

impl Served for Bench {
    type Error = Infallible;

    fn run_until(&mut self, elapsed_us: u64) {
        self.board.advance(Microseconds(STARTED_US + elapsed_us));
        self.output.append(&mut self.board.transmit());
    }

    fn receive(&mut self, bytes: &[u8]) {
        self.board.receive(bytes);
    }

    fn take_output(&mut self) -> Vec<u8> {
        self.output.append(&mut self.board.transmit());
        std::mem::take(&mut self.output)
    }

    fn settle(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// Homed and armed, does this; returns what the board says in the end.
async fn armed<T>(work: impl AsyncFnOnce(&mut Board) -> Result<T, BoardError>) -> Result<T, BoardError> {
    let board = NativeBoard::standing_at(&bench_settings(), &bench_mechanics(), &[61_000.0, 3_000.0], 1);
    let shared = Shared::new(Bench { board: board.expect("the bench works"), output: Vec::new() });
    let rig = Rig::from_toml(BENCH_TOML).expect("the bench is a rig");
    let mut board = Board::in_process(shared, rig, SessionId(7), 100).await?;
    board
        .armed(pending(), async |board| {
            board.home().await?;
            work(board).await
        })
        .await
}

/// Two seconds of motion.
async fn set_off(board: &Board) -> Result<(), BoardError> {
    let targets = [220_000, 2_000_000].into_iter().map(Micro).collect();
    board.ask(Request::MoveTo(Move { id: MoveId(99), mode: Mode(0), targets, speed: Permille::FULL })).await
}

#[tokio::test(start_paused = true)]
async fn a_loop_that_hangs_in_mid_move_loses_its_lease_and_the_board_brakes() {
    let mut seen = None;
    let outcome = armed(async |board| {
        set_off(board).await?;
        tokio::time::sleep(Duration::from_millis(1_500)).await;
        let pose = board.next_pose().await?;
        seen = Some((pose.state, pose.fault_code(), pose.phase));
        Ok(())
    });
    assert!(outcome.await.is_err(), "the lease is lost");
    assert_eq!(seen, Some((ControllerState::LinkLost, Some(FaultCode::LeaseExpired), MovePhase::Stopped)));
}

#[tokio::test(start_paused = true)]
async fn a_loop_that_follows_keeps_its_lease_to_the_end_and_so_does_one_at_rest() {
    let settled = armed(async |board| {
        set_off(board).await?;
        while board.next_pose().await?.phase != MovePhase::Settled {}
        // Work between two moves.
        tokio::time::sleep(Duration::from_secs(60)).await;
        Ok(board.next_pose().await?.state)
    });
    assert_eq!(settled.await, Ok(ControllerState::Ready));
}

#[tokio::test(start_paused = true)]
async fn a_program_that_hangs_for_long_at_rest_does_not_stay_armed() {
    let mut seen = None;
    let outcome = armed(async |board| {
        tokio::time::sleep(Duration::from_secs(130)).await;
        let pose = board.next_pose().await?;
        seen = Some((pose.state, pose.fault_code()));
        Ok(())
    });
    assert!(outcome.await.is_err(), "the lease is lost");
    assert_eq!(seen, Some((ControllerState::LinkLost, Some(FaultCode::LeaseExpired))));
}
