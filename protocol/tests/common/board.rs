//! A board's end alone: frames go in by hand, frames come out decoded.
#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test ends by panicking")]

use vergence_protocol::frame::{Header, Kind, encode};
use vergence_protocol::{
    BoardEvent, BoardSession, MAX_FRAME, Microseconds, PROTOCOL, Receiver, Refusal, ReplyTo, Report, Request,
    SessionId, Status, schema_hash,
};

use super::{SESSION, hello};

pub fn host_frame(header: Header, request: &Request) -> Vec<u8> {
    let mut buffer = [0; MAX_FRAME];
    let length = encode(header, request, &mut buffer).unwrap();
    buffer[..length].to_vec()
}

pub fn header(kind: Kind, seq: u8) -> Header {
    Header { major: PROTOCOL.major, kind, seq, ack: 0 }
}

/// Gives `bytes` to the board and collects the events.
pub fn deliver(board: &mut BoardSession, bytes: &[u8]) -> Vec<BoardEvent> {
    bytes.iter().filter_map(|&byte| board.receive(Microseconds(1000), byte)).collect()
}

/// Gives `request` to the board and returns where to reply.
pub fn ask(board: &mut BoardSession, header: Header, request: &Request) -> ReplyTo {
    match deliver(board, &host_frame(header, request)).as_slice() {
        [BoardEvent::Request { reply_to, request: delivered, received_at: Microseconds(1000) }]
            if delivered == request =>
        {
            *reply_to
        }
        other => panic!("{request:?} gave {other:?}"),
    }
}

/// All frames that the board sends now: kind and report, `None` for a frame without a body.
pub fn sent(board: &mut BoardSession) -> Vec<(Kind, Option<Report>)> {
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

pub fn hello_report(session: SessionId, boot: u32) -> (Kind, Option<Report>) {
    (Kind::Immediate, Some(Report::Hello { protocol: PROTOCOL, schema: schema_hash(), session, boot }))
}

pub fn refused(to: u8, refusal: Refusal) -> (Kind, Option<Report>) {
    (Kind::Control, Some(Report::Ack { to, status: Status::Refused(refusal) }))
}

pub fn open_board() -> BoardSession {
    let mut board = BoardSession::new(1);
    let received = deliver(&mut board, &host_frame(header(Kind::Immediate, 0), &hello(SESSION)));
    assert_eq!(received, [BoardEvent::Opened { session: SESSION }]);
    assert_eq!(sent(&mut board), [hello_report(SESSION, 1)]);
    board
}
