//! Boards and hosts of other versions: what each still understands.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test ends by panicking")]

mod common;

use common::board::{ask, deliver, header, hello_report, host_frame, refused, sent};
use common::{SESSION, answer, board_info, move_to, pose};
use vergence_protocol::frame::{Header, Kind, encode};
use vergence_protocol::management::{Management, ManagementReport, Outcome};
use vergence_protocol::{
    AxisMask, BoardEvent, BoardSession, Compatibility, HostEvent, HostSession, Jog, MAX_FRAME, Micro, Microseconds,
    MoveId, PROTOCOL, Permille, ProtocolVersion, Refusal, Report, Request, SettingItem, SettingKey, StopKind,
    SubmitError, Trigger, schema_hash,
};

const PROGRESS: ManagementReport = ManagementReport::Progress { to: 0, next: 0, outcome: Outcome::Done };
const KEY: SettingKey = SettingKey { item: SettingItem::Speed, axis: 0 };

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
fn a_host_of_another_major_learns_only_what_board_it_is() {
    let mut board = BoardSession::new(1);
    let foreign = |kind, seq| Header { major: PROTOCOL.major + 1, kind, seq, ack: 0 };
    let protocol = ProtocolVersion { major: PROTOCOL.major + 1, minor: 0 };
    let hello = Request::Hello { protocol, schema: schema_hash(), session: SESSION };
    assert_eq!(deliver(&mut board, &host_frame(foreign(Kind::Immediate, 0), &hello)), []);
    assert_eq!(sent(&mut board), [hello_report(SESSION, 1)]);
    assert_eq!(board.session(), None);
    let stop = Request::Stop { kind: StopKind::Decelerate };
    let heartbeat = Request::Heartbeat { session: SESSION, lease_ms: 100 };
    for request in [move_to(1), stop, heartbeat, Request::Disarm] {
        for kind in [Kind::Control, Kind::Immediate] {
            assert_eq!(deliver(&mut board, &host_frame(foreign(kind, 0), &request)), [], "{request:?}");
        }
    }
    assert_eq!(sent(&mut board), []);
    let reply_to = ask(&mut board, foreign(Kind::Immediate, 9), &Request::GetInfo);
    board.reply(reply_to, answer(&Request::GetInfo));
    assert_eq!(sent(&mut board), [(Kind::Immediate, Some(Report::Info { to: 9, info: board_info() }))]);
}

#[test]
fn management_works_with_every_major_and_without_a_session() {
    let mut board = BoardSession::new(1);
    let mut buffer = [0; MAX_FRAME];
    for (major, seq) in [(PROTOCOL.major, 3), (PROTOCOL.major + 1, 4), (0, 5), (255, 6)] {
        let header = Header { major, kind: Kind::Firmware, seq, ack: 0 };
        let length = encode(header, &Management::Confirm, &mut buffer).unwrap();
        let received = deliver(&mut board, &buffer[..length]);
        assert_eq!(received, [BoardEvent::Management { seq, request: Management::Confirm }]);
        board.reply_management(seq, PROGRESS);
    }
    assert_eq!(board.session(), None);
    let mut host = HostSession::new(SESSION);
    let mut received = Vec::new();
    while let Some(length) = board.transmit(Microseconds(0), &mut buffer) {
        host.receive(Microseconds(1), &buffer[..length], |event| received.push(event));
    }
    let expected = [3, 4, 5, 6].map(|to| ManagementReport::Progress { to, next: 0, outcome: Outcome::Done });
    assert_eq!(received, expected.map(HostEvent::Management));
    assert_eq!(deliver(&mut board, &host_frame(header(Kind::Firmware, 0), &move_to(1))), [], "motion is no management");
}

#[test]
fn a_host_of_another_schema_may_only_read() {
    let mut board = BoardSession::new(1);
    let hello = Request::Hello { protocol: PROTOCOL, schema: schema_hash() ^ 1, session: SESSION };
    deliver(&mut board, &host_frame(header(Kind::Immediate, 0), &hello));
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
        assert_eq!(deliver(&mut board, &host_frame(header(Kind::Control, seq), request)), []);
        assert_eq!(sent(&mut board), [refused(seq, Refusal::ReadOnly)]);
    }
    assert_eq!(deliver(&mut board, &host_frame(header(Kind::Control, 2), &motion[2])), []);
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
fn a_host_with_another_schema_knows_that_it_may_only_read() {
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
