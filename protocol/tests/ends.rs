//! Each end alone, frame by frame: order, priorities and log.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test ends by panicking")]

mod common;

use common::board::{ask, deliver, header, hello_report, host_frame, open_board, refused, sent};
use common::{SESSION, answer, board_info, hello, move_to, pose};
use vergence_protocol::frame::{Kind, encode};
use vergence_protocol::management::Management;
use vergence_protocol::{
    BoardEvent, BoardSession, FaultCode, FaultRecord, HostEvent, HostSession, LOG_CHUNK, MAX_FRAME, Microseconds,
    MoveId, MovePhase, PROTOCOL, Receiver, Refusal, Report, Request, SessionId, Status, StopKind, SubmitError,
    schema_hash,
};

#[test]
fn a_new_session_drops_queued_reports_and_late_answers() {
    let mut board = open_board();
    let late = ask(&mut board, header(Kind::Control, 0), &Request::Disarm);
    let answered = ask(&mut board, header(Kind::Control, 1), &Request::Disarm);
    board.reply(answered, answer(&Request::Disarm));
    let immediate = ask(&mut board, header(Kind::Immediate, 0), &Request::Stop { kind: StopKind::TorqueOff });
    board.reply(immediate, answer(&Request::Disarm));
    board.send(Report::MoveState { id: MoveId(1), phase: MovePhase::Running });
    board.telemetry(pose(1));
    let new = SessionId(2);
    let opened = deliver(&mut board, &host_frame(header(Kind::Immediate, 0), &hello(new)));
    assert_eq!(opened, [BoardEvent::Opened { session: new }]);
    board.reply(late, answer(&Request::Disarm));
    assert_eq!(sent(&mut board), [hello_report(new, 1)]);
    assert_eq!(deliver(&mut board, &host_frame(header(Kind::Immediate, 0), &hello(new))), []);
    assert_eq!(sent(&mut board), [hello_report(new, 1)], "the same hello only answers again");
    ask(&mut board, header(Kind::Control, 0), &Request::Disarm);
    board.reply(late, answer(&Request::Disarm));
    assert_eq!(sent(&mut board), [(Kind::AckOnly, None)], "the old answer is none to the new request");
}

#[test]
fn management_requests_are_numbered_and_wait_for_the_line() {
    let mut host = HostSession::new(SESSION);
    for seq in 0..4 {
        assert_eq!(host.manage(Management::Identify), Ok(seq));
    }
    assert_eq!(host.manage(Management::Identify), Err(SubmitError::QueueFull));
    assert_eq!(host.next_wake(), Some(Microseconds(0)));
    host.send_now(Request::Stop { kind: StopKind::Decelerate }).unwrap();
    let (mut receiver, mut buffer, mut kinds) = (Receiver::new(), [0; MAX_FRAME], Vec::new());
    while let Some(length) = host.transmit(Microseconds(0), &mut buffer) {
        let frames = buffer[..length].iter().filter_map(|&byte| receiver.push(byte).map(|frame| frame.header));
        kinds.extend(frames.map(|header| (header.kind, header.seq)));
    }
    assert_eq!(kinds[0].0, Kind::Immediate, "a stop overtakes");
    assert_eq!(kinds[1..], [0, 1, 2, 3].map(|seq| (Kind::Firmware, seq)));
    assert_eq!(host.next_wake(), None);
}

#[test]
fn a_gap_is_reported_and_nothing_is_delivered_out_of_order() {
    let mut board = open_board();
    ask(&mut board, header(Kind::Control, 0), &Request::Disarm);
    for seq in [2, 3] {
        assert_eq!(deliver(&mut board, &host_frame(header(Kind::Control, seq), &move_to(1))), []);
    }
    assert_eq!(sent(&mut board), [(Kind::Nak, None)]);
    ask(&mut board, header(Kind::Control, 1), &move_to(1));
    ask(&mut board, header(Kind::Control, 2), &move_to(1));
    assert_eq!(sent(&mut board), [(Kind::AckOnly, None)]);
    assert_eq!(board.statistics().gaps, 2);
}

#[test]
fn an_unreadable_request_is_refused_and_not_asked_for_again() {
    let mut board = open_board();
    let mut buffer = [0; MAX_FRAME];
    let length = encode(header(Kind::Control, 0), &(200_u8, 1_u8), &mut buffer).unwrap();
    assert_eq!(deliver(&mut board, &buffer[..length]), []);
    assert_eq!(sent(&mut board), [refused(0, Refusal::Invalid)]);
    assert_eq!(board.statistics().link.body, 1);
    ask(&mut board, header(Kind::Control, 1), &Request::Disarm);
}

#[test]
fn answers_go_before_events_and_events_before_the_latest_pose() {
    let mut board = open_board();
    let fault =
        FaultRecord { code: FaultCode::HardLimit, seq: 1, at: Microseconds(3), axis: Some(1), detail: 0, later: 0 };
    for seq in 0..5 {
        board.telemetry(pose(seq));
    }
    board.send(Report::Fault(fault));
    let control = ask(&mut board, header(Kind::Control, 0), &Request::Disarm);
    let immediate = ask(&mut board, header(Kind::Immediate, 6), &Request::GetInfo);
    board.reply(control, answer(&Request::Disarm));
    board.reply(immediate, answer(&Request::GetInfo));
    let expected = [
        (Kind::Immediate, Some(Report::Info { to: 6, info: board_info() })),
        (Kind::Control, Some(Report::Ack { to: 0, status: Status::Accepted })),
        (Kind::Control, Some(Report::Fault(fault))),
        (Kind::Telemetry, Some(Report::Pose(pose(4)))),
    ];
    assert_eq!(sent(&mut board), expected);
    assert_eq!(board.statistics().poses_replaced, 4);
}

#[test]
fn too_many_events_push_out_the_oldest() {
    let mut board = open_board();
    let state = |id| Report::MoveState { id: MoveId(id), phase: MovePhase::Running };
    (0..20).for_each(|id| board.send(state(id)));
    let kept: Vec<_> = (12..20).map(|id| (Kind::Control, Some(state(id)))).collect();
    assert_eq!(sent(&mut board), kept);
    assert_eq!(board.statistics().events_dropped, 12);
}

#[test]
fn without_a_session_the_board_sends_nothing() {
    let mut board = BoardSession::new(1);
    board.telemetry(pose(1));
    board.send(Report::MoveState { id: MoveId(1), phase: MovePhase::Running });
    assert_eq!(sent(&mut board), []);
    let nobody = host_frame(header(Kind::Immediate, 0), &hello(SessionId(0)));
    assert_eq!(deliver(&mut board, &nobody), [], "zero is no session");
    assert_eq!(sent(&mut board), []);
}

#[test]
fn a_delimiter_goes_before_the_first_frame_and_after_silence() {
    let mut host = HostSession::new(SESSION);
    let mut buffer = [0xFF; MAX_FRAME];
    let mut first = |host: &mut HostSession, now| {
        host.send_now(Request::Stop { kind: StopKind::Decelerate }).unwrap();
        host.transmit(Microseconds(now), &mut buffer).unwrap();
        buffer[0]
    };
    assert_eq!(first(&mut host, 0), 0);
    assert_ne!(first(&mut host, 1_000), 0);
    assert_ne!(first(&mut host, 2_000), 0);
    assert_eq!(first(&mut host, 100_000), 0);
}

#[test]
fn motion_requests_cannot_bypass_the_window() {
    let mut board = open_board();
    assert_eq!(deliver(&mut board, &host_frame(header(Kind::Immediate, 0), &move_to(1))), []);
    assert_eq!(board.statistics().link.body, 1);
}

/// The log bytes of all frames that the board sends now, after the kinds of what goes before.
fn sent_log(board: &mut BoardSession) -> (Vec<Kind>, Vec<u8>) {
    let (mut receiver, mut buffer) = (Receiver::new(), [0; MAX_FRAME]);
    let (mut kinds, mut log) = (Vec::new(), Vec::new());
    while let Some(length) = board.transmit(Microseconds(2000), &mut buffer) {
        assert!(length < 64, "an answer waits no longer than for a short frame");
        for &byte in &buffer[..length] {
            let Some(frame) = receiver.push(byte) else { continue };
            match frame.header.kind {
                Kind::Log => log.extend(frame.body::<heapless::Vec<u8, LOG_CHUNK>>().unwrap()),
                kind => kinds.push(kind),
            }
            assert!(log.is_empty() || frame.header.kind == Kind::Log, "the log goes last");
        }
    }
    (kinds, log)
}

#[test]
fn the_log_goes_last_and_waits_for_a_session() {
    let mut board = BoardSession::new(1);
    let entry: Vec<u8> = (0..100).collect();
    board.log(&entry);
    assert_eq!(sent_log(&mut board), (vec![], vec![]));
    deliver(&mut board, &host_frame(header(Kind::Immediate, 0), &hello(SESSION)));
    board.telemetry(pose(1));
    let control = ask(&mut board, header(Kind::Control, 0), &Request::Disarm);
    board.reply(control, answer(&Request::Disarm));
    assert_eq!(sent_log(&mut board), (vec![Kind::Immediate, Kind::Control, Kind::Telemetry], entry));
}

#[test]
fn a_log_entry_that_does_not_fit_is_dropped_whole_and_counted() {
    let mut board = open_board();
    board.log(&[1; 500]);
    board.log(&[2; 13]);
    board.log(&[3; 12]);
    board.log(&[4; 1]);
    let (_, log) = sent_log(&mut board);
    assert_eq!(log, [vec![1; 500], vec![3; 12]].concat());
    assert_eq!(board.statistics().logs_dropped, 2);
    board.log(&[5; 512]);
    assert_eq!(sent_log(&mut board).1, [5; 512]);
}

#[test]
fn a_host_receives_the_log_of_its_session() {
    let mut host = HostSession::new(SESSION);
    let mut board = open_board();
    board.log(b"hello");
    let mut buffer = [0; MAX_FRAME];
    let length = board.transmit(Microseconds(2000), &mut buffer).unwrap();
    let mut received = Vec::new();
    host.receive(Microseconds(1), &buffer[..length], |event| received.push(event));
    assert_eq!(received, [], "no session yet");
    host.hello();
    let report = Report::Hello { protocol: PROTOCOL, schema: schema_hash(), session: SESSION, boot: 9 };
    let mut opening = [0; MAX_FRAME];
    let opened = encode(header(Kind::Immediate, 0), &report, &mut opening).unwrap();
    host.receive(Microseconds(2), &opening[..opened], |_| {});
    host.receive(Microseconds(3), &buffer[..length], |event| received.push(event));
    assert_eq!(received, [HostEvent::Log(heapless::Vec::from_slice(b"hello").unwrap())]);
    assert_eq!(host.last_received_at(), Some(Microseconds(3)));
}
