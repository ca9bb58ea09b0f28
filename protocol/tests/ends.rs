//! Each end alone, frame by frame: versions, order, priorities.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test ends by panicking")]

mod common;

use vergence_protocol::frame::{Header, Kind, encode};
use vergence_protocol::management::{Management, ManagementReport, Outcome};
use vergence_protocol::{
    AxisMask, BoardEvent, BoardSession, Compatibility, FaultCode, FaultRecord, HostEvent, HostSession, Jog, LOG_CHUNK,
    MAX_FRAME, Micro, Microseconds, MoveId, MovePhase, PROTOCOL, Permille, ProtocolVersion, Receiver, Refusal, ReplyTo,
    Report, Request, SessionId, SettingItem, SettingKey, Status, StopKind, SubmitError, Trigger, schema_hash,
};

use common::{SESSION, answer, board_info, hello, move_to, pose};

const PROGRESS: ManagementReport = ManagementReport::Progress { to: 0, next: 0, outcome: Outcome::Done };
const KEY: SettingKey = SettingKey { item: SettingItem::Speed, axis: 0 };

fn host_frame(header: Header, request: &Request) -> Vec<u8> {
    let mut buffer = [0; MAX_FRAME];
    let length = encode(header, request, &mut buffer).unwrap();
    buffer[..length].to_vec()
}

fn header(kind: Kind, seq: u8) -> Header {
    Header { major: PROTOCOL.major, kind, seq, ack: 0 }
}

/// Gives `bytes` to the board and collects what it hears.
fn tell(board: &mut BoardSession, bytes: &[u8]) -> Vec<BoardEvent> {
    bytes.iter().filter_map(|&byte| board.receive(Microseconds(1000), byte)).collect()
}

/// Gives `request` to the board and returns where to reply.
fn ask(board: &mut BoardSession, header: Header, request: &Request) -> ReplyTo {
    match tell(board, &host_frame(header, request)).as_slice() {
        [BoardEvent::Request { reply_to, request: heard, received_at: Microseconds(1000) }] if heard == request => {
            *reply_to
        }
        other => panic!("{request:?} gave {other:?}"),
    }
}

/// All that the board sends now, with kinds; `None` for frames without a body.
fn sent(board: &mut BoardSession) -> Vec<(Kind, Option<Report>)> {
    let mut receiver = Receiver::new();
    let mut buffer = [0; MAX_FRAME];
    let mut frames = Vec::new();
    while let Some(length) = board.transmit(Microseconds(2000), &mut buffer) {
        for &byte in &buffer[..length] {
            frames.extend(receiver.push(byte).map(|frame| (frame.header.kind, frame.body().ok())));
        }
    }
    assert_eq!(receiver.counters().dropped(), 0);
    frames
}

fn hello_report(session: SessionId, boot: u32) -> (Kind, Option<Report>) {
    (Kind::Immediate, Some(Report::Hello { protocol: PROTOCOL, schema: schema_hash(), session, boot }))
}

fn refused(to: u8, refusal: Refusal) -> (Kind, Option<Report>) {
    (Kind::Control, Some(Report::Ack { to, status: Status::Refused(refusal) }))
}

fn open_board() -> BoardSession {
    let mut board = BoardSession::new(1);
    let heard = tell(&mut board, &host_frame(header(Kind::Immediate, 0), &hello(SESSION)));
    assert_eq!(heard, [BoardEvent::Opened { session: SESSION }]);
    assert_eq!(sent(&mut board), [hello_report(SESSION, 1)]);
    board
}

#[test]
fn a_new_hello_drops_what_was_queued_and_what_is_answered_too_late() {
    let mut board = open_board();
    let late = ask(&mut board, header(Kind::Control, 0), &Request::Disarm);
    let answered = ask(&mut board, header(Kind::Control, 1), &Request::Disarm);
    board.reply(answered, answer(&Request::Disarm));
    let immediate = ask(&mut board, header(Kind::Immediate, 0), &Request::Stop { kind: StopKind::TorqueOff });
    board.reply(immediate, answer(&Request::Disarm));
    board.send(Report::MoveState { id: MoveId(1), phase: MovePhase::Running });
    board.telemetry(pose(1));
    let new = SessionId(2);
    let opened = tell(&mut board, &host_frame(header(Kind::Immediate, 0), &hello(new)));
    assert_eq!(opened, [BoardEvent::Opened { session: new }]);
    board.reply(late, answer(&Request::Disarm));
    assert_eq!(sent(&mut board), [hello_report(new, 1)]);
    assert_eq!(tell(&mut board, &host_frame(header(Kind::Immediate, 0), &hello(new))), []);
    assert_eq!(sent(&mut board), [hello_report(new, 1)], "the same hello only answers again");
    ask(&mut board, header(Kind::Control, 0), &Request::Disarm);
    board.reply(late, answer(&Request::Disarm));
    assert_eq!(sent(&mut board), [(Kind::AckOnly, None)], "the old answer is none to the new request");
}

#[test]
fn a_board_of_another_major_is_incompatible() {
    let mut host = HostSession::new(SESSION);
    host.hello();
    let mut buffer = [0; MAX_FRAME];
    assert!(host.transmit(Microseconds(0), &mut buffer).is_some());
    let foreign = ProtocolVersion { major: PROTOCOL.major + 1, minor: 3 };
    let mut events = Vec::new();
    let mut hear = |host: &mut HostSession, kind, report: &Report| {
        let header = Header { major: foreign.major, kind, seq: 0, ack: 0 };
        let length = encode(header, report, &mut buffer).unwrap();
        host.receive(Microseconds(5), &buffer[..length], |event| events.push(event));
        std::mem::take(&mut events)
    };
    let hello = Report::Hello { protocol: foreign, schema: 1, session: SESSION, boot: 9 };
    let compatibility = Compatibility::Incompatible { board: foreign };
    assert_eq!(hear(&mut host, Kind::Immediate, &hello), [HostEvent::Opened { compatibility, boot: 9 }]);
    assert_eq!(host.submit(Microseconds(6), Request::Disarm), Err(SubmitError::NotOpen));
    assert_eq!(hear(&mut host, Kind::Telemetry, &Report::Pose(pose(1))), []);
    let ticket = host.send_now(Request::GetInfo).unwrap();
    let report = Report::Info { to: 0, info: board_info() };
    let reply = HostEvent::Reply { ticket, report: report.clone() };
    assert_eq!(hear(&mut host, Kind::Immediate, &report), [reply]);
}

#[test]
fn to_a_host_of_another_major_the_board_tells_only_who_it_is() {
    let mut board = BoardSession::new(1);
    let foreign = |kind, seq| Header { major: PROTOCOL.major + 1, kind, seq, ack: 0 };
    let protocol = ProtocolVersion { major: PROTOCOL.major + 1, minor: 0 };
    let hello = Request::Hello { protocol, schema: schema_hash(), session: SESSION };
    assert_eq!(tell(&mut board, &host_frame(foreign(Kind::Immediate, 0), &hello)), []);
    assert_eq!(sent(&mut board), [hello_report(SESSION, 1)]);
    assert_eq!(board.session(), None);
    let stop = Request::Stop { kind: StopKind::Decelerate };
    let heartbeat = Request::Heartbeat { session: SESSION, lease_ms: 100 };
    for request in [move_to(1), stop, heartbeat, Request::Disarm] {
        for kind in [Kind::Control, Kind::Immediate] {
            assert_eq!(tell(&mut board, &host_frame(foreign(kind, 0), &request)), [], "{request:?}");
        }
    }
    assert_eq!(sent(&mut board), []);
    let reply_to = ask(&mut board, foreign(Kind::Immediate, 9), &Request::GetInfo);
    board.reply(reply_to, answer(&Request::GetInfo));
    assert_eq!(sent(&mut board), [(Kind::Immediate, Some(Report::Info { to: 9, info: board_info() }))]);
}

#[test]
fn to_management_majors_and_sessions_do_not_matter() {
    let mut board = BoardSession::new(1);
    let mut buffer = [0; MAX_FRAME];
    for (major, seq) in [(PROTOCOL.major, 3), (PROTOCOL.major + 1, 4), (0, 5), (255, 6)] {
        let header = Header { major, kind: Kind::Firmware, seq, ack: 0 };
        let length = encode(header, &Management::Confirm, &mut buffer).unwrap();
        let heard = tell(&mut board, &buffer[..length]);
        assert_eq!(heard, [BoardEvent::Management { seq, request: Management::Confirm }]);
        board.reply_management(seq, PROGRESS);
    }
    assert_eq!(board.session(), None);
    let mut host = HostSession::new(SESSION);
    let mut heard = Vec::new();
    while let Some(length) = board.transmit(Microseconds(0), &mut buffer) {
        host.receive(Microseconds(1), &buffer[..length], |event| heard.push(event));
    }
    let expected = [3, 4, 5, 6].map(|to| ManagementReport::Progress { to, next: 0, outcome: Outcome::Done });
    assert_eq!(heard, expected.map(HostEvent::Management));
    assert_eq!(tell(&mut board, &host_frame(header(Kind::Firmware, 0), &move_to(1))), [], "motion is no management");
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
fn a_host_of_another_schema_may_only_read() {
    let mut board = BoardSession::new(1);
    let hello = Request::Hello { protocol: PROTOCOL, schema: schema_hash() ^ 1, session: SESSION };
    tell(&mut board, &host_frame(header(Kind::Immediate, 0), &hello));
    assert_eq!(sent(&mut board), [hello_report(SESSION, 1)]);
    let motion = [
        Request::Arm { session: SESSION },
        Request::Home { axes: AxisMask::first(2) },
        move_to(1),
        Request::ClearFault { seen: 1 },
        Request::Jog(Jog { id: MoveId(1), by: [Micro(1)].into_iter().collect(), speed: Permille::FULL }),
        Request::SetSetting { key: KEY, value: 1 },
        Request::SaveSettings,
        Request::RestoreSettings,
        Request::SetTrigger(Trigger::Once),
    ];
    for (seq, request) in (0..).zip(&motion) {
        assert_eq!(tell(&mut board, &host_frame(header(Kind::Control, seq), request)), []);
        assert_eq!(sent(&mut board), [refused(seq, Refusal::ReadOnly)]);
    }
    assert_eq!(tell(&mut board, &host_frame(header(Kind::Control, 2), &motion[2])), []);
    assert_eq!(sent(&mut board), [refused(2, Refusal::ReadOnly)], "refused again when asked again");
    let reading = [
        Request::GetInfo,
        Request::Disarm,
        Request::SetStream { period_us: 1 },
        Request::GetSetting(KEY),
        Request::GetEvents { first: 0 },
        Request::GetStatistics,
    ];
    for (seq, request) in (motion.len() as u8..).zip(&reading) {
        ask(&mut board, header(Kind::Control, seq), request);
    }
    ask(&mut board, header(Kind::Immediate, 0), &Request::Stop { kind: StopKind::TorqueOff });
}

#[test]
fn a_host_sees_that_it_may_only_read() {
    let mut host = HostSession::new(SESSION);
    host.hello();
    let mut buffer = [0; MAX_FRAME];
    let report = Report::Hello { protocol: PROTOCOL, schema: schema_hash() ^ 1, session: SESSION, boot: 9 };
    let length = encode(header(Kind::Immediate, 0), &report, &mut buffer).unwrap();
    let mut events = Vec::new();
    host.receive(Microseconds(5), &buffer[..length], |event| events.push(event));
    assert_eq!(events, [HostEvent::Opened { compatibility: Compatibility::ReadOnly, boot: 9 }]);
    assert!(host.submit(Microseconds(6), Request::GetInfo).is_ok());
}

#[test]
fn a_gap_is_told_and_nothing_is_delivered_out_of_order() {
    let mut board = open_board();
    ask(&mut board, header(Kind::Control, 0), &Request::Disarm);
    for seq in [2, 3] {
        assert_eq!(tell(&mut board, &host_frame(header(Kind::Control, seq), &move_to(1))), []);
    }
    assert_eq!(sent(&mut board), [(Kind::Nak, None)]);
    ask(&mut board, header(Kind::Control, 1), &move_to(1));
    ask(&mut board, header(Kind::Control, 2), &move_to(1));
    assert_eq!(sent(&mut board), [(Kind::AckOnly, None)]);
    assert_eq!(board.statistics().gaps, 2);
}

#[test]
fn a_request_that_the_board_cannot_read_is_refused_once_and_for_all() {
    let mut board = open_board();
    let mut buffer = [0; MAX_FRAME];
    let length = encode(header(Kind::Control, 0), &(200_u8, 1_u8), &mut buffer).unwrap();
    assert_eq!(tell(&mut board, &buffer[..length]), []);
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
fn without_a_session_the_board_says_nothing() {
    let mut board = BoardSession::new(1);
    board.telemetry(pose(1));
    board.send(Report::MoveState { id: MoveId(1), phase: MovePhase::Running });
    assert_eq!(sent(&mut board), []);
    let nobody = host_frame(header(Kind::Immediate, 0), &hello(SessionId(0)));
    assert_eq!(tell(&mut board, &nobody), [], "zero is no session");
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
fn motion_does_not_pass_by_the_window() {
    let mut board = open_board();
    assert_eq!(tell(&mut board, &host_frame(header(Kind::Immediate, 0), &move_to(1))), []);
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
    tell(&mut board, &host_frame(header(Kind::Immediate, 0), &hello(SESSION)));
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
fn a_host_hears_the_log_of_its_session() {
    let mut host = HostSession::new(SESSION);
    let mut board = open_board();
    board.log(b"hello");
    let mut buffer = [0; MAX_FRAME];
    let length = board.transmit(Microseconds(2000), &mut buffer).unwrap();
    let mut heard = Vec::new();
    host.receive(Microseconds(1), &buffer[..length], |event| heard.push(event));
    assert_eq!(heard, [], "no session yet");
    host.hello();
    let report = Report::Hello { protocol: PROTOCOL, schema: schema_hash(), session: SESSION, boot: 9 };
    let mut opening = [0; MAX_FRAME];
    let opened = encode(header(Kind::Immediate, 0), &report, &mut opening).unwrap();
    host.receive(Microseconds(2), &opening[..opened], |_| {});
    host.receive(Microseconds(3), &buffer[..length], |event| heard.push(event));
    assert_eq!(heard, [HostEvent::Log(heapless::Vec::from_slice(b"hello").unwrap())]);
    assert_eq!(host.heard_at(), Some(Microseconds(3)));
}
