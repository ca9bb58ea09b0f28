//! Exact bytes: what is on the wire must not change unnoticed.
//!
//! The frames were computed apart from this crate, by (`pip install crcmod cobs`, Python 3.11):
//!
//! ```text
//! import crcmod.predefined, cobs.cobs
//! crc = crcmod.predefined.mkCrcFun('crc-32c')
//! def v(n): return bytes([n]) if n < 128 else bytes([n & 127 | 128]) + v(n >> 7)     # postcard varint
//! def z(n): return v(2 * n if n >= 0 else -2 * n - 1)                                 # signed: zigzag
//! def frame(header, body):
//!     packet = bytes(header) + body
//!     return cobs.cobs.encode(packet + crc(packet).to_bytes(4, 'little')) + b'\0'
//! heartbeat = frame([1, 4, 3, 9], v(2) + v(0x12345678) + v(100))
//! move_to = frame([1, 0, 255, 0], v(8) + v(300) + bytes([2]) + v(2) + z(65000) + z(-1200) + v(1000))
//! pose = frame([1, 1, 16, 255], v(5) + v(1234567890) + v(65535) + v(2) + z(0) + z(-2048) + bytes([3]) + v(1)
//!     + bytes([2]) + v(300) + v(3) + bytes([1]) + v(6) + v(2) + v(1234000000) + bytes([1, 0]) + z(-5) + v(1))
//! ```

#![allow(clippy::unwrap_used, reason = "a test ends by panicking")]

use serde::Serialize;
use vergence_protocol::frame::{Frame, FrameError, Header, Kind, encode};
use vergence_protocol::{
    AxisList, AxisMask, ControllerState, Counts, FaultCode, FaultRecord, MAX_FRAME, Micro, Microseconds, Mode, Move,
    MoveId, MovePhase, Permille, PoseReport, Report, Request, SessionId, schema_hash,
};

fn frame<B: Serialize>(kind: Kind, seq: u8, ack: u8, body: &B) -> Vec<u8> {
    let mut buffer = [0xAA; MAX_FRAME];
    let length = encode(Header { major: 1, kind, seq, ack }, body, &mut buffer).unwrap();
    buffer[..length].to_vec()
}

#[test]
fn heartbeat() {
    let request = Request::Heartbeat { session: SessionId(0x1234_5678), lease_ms: 100 };
    let expected =
        [0x10, 0x01, 0x04, 0x03, 0x09, 0x02, 0xf8, 0xac, 0xd1, 0x91, 0x01, 0x64, 0xa1, 0x96, 0xa4, 0x9d, 0x00];
    assert_eq!(frame(Kind::Immediate, 3, 9, &request), expected);
}

#[test]
fn move_to() {
    let request = Request::MoveTo(Move {
        id: MoveId(300),
        mode: Mode(2),
        targets: AxisList::from_iter([Micro(65_000), Micro(-1_200)]),
        speed: Permille::FULL,
    });
    let expected = [
        0x02, 0x01, 0x02, 0xff, 0x11, 0x08, 0xac, 0x02, 0x02, 0x02, 0xd0, 0xf7, 0x07, 0xdf, 0x12, 0xe8, 0x07, 0xef,
        0x8e, 0x7a, 0xcf, 0x00,
    ];
    assert_eq!(frame(Kind::Control, 255, 0, &request), expected);
}

#[test]
fn pose() {
    let fault = FaultRecord {
        code: FaultCode::HardLimit,
        seq: 2,
        at: Microseconds(1_234_000_000),
        axis: Some(0),
        detail: -5,
        later: 1,
    };
    let report = Report::Pose(PoseReport {
        at: Microseconds(1_234_567_890),
        seq: 65_535,
        counts: AxisList::from_iter([Counts(0), Counts(-2048)]),
        referenced: AxisMask::first(2),
        state: ControllerState::Ready,
        mode: Mode(2),
        move_id: MoveId(300),
        phase: MovePhase::Settled,
        fault: Some(fault),
    });
    let expected = [
        0x0f, 0x01, 0x01, 0x10, 0xff, 0x05, 0xd2, 0x85, 0xd8, 0xcc, 0x04, 0xff, 0xff, 0x03, 0x02, 0x12, 0xff, 0x1f,
        0x03, 0x01, 0x02, 0xac, 0x02, 0x03, 0x01, 0x06, 0x02, 0x80, 0xb1, 0xb5, 0xcc, 0x04, 0x01, 0x07, 0x09, 0x01,
        0x17, 0x87, 0x99, 0x07, 0x00,
    ];
    assert_eq!(frame(Kind::Telemetry, 16, 255, &report), expected);
}

/// The check value of CRC-32/ISCSI (Castagnoli) in Cook's catalogue of parametrised CRC algorithms. `Frame` checks the
/// CRC first, so the digits make a packet whose kind ('2') is wrong, and any other CRC makes a wrong checksum.
#[test]
fn the_checksum_is_castagnoli() {
    let mut packet = *b"123456789\0\0\0\0";
    packet[9..].copy_from_slice(&0xE306_9283_u32.to_le_bytes());
    assert_eq!(Frame::parse(&packet), Err(FrameError::Kind));
    packet[9] ^= 1;
    assert_eq!(Frame::parse(&packet), Err(FrameError::Checksum));
}

/// A change here is a change of the messages: raise `PROTOCOL` and check that the old enum variants kept their places.
#[test]
fn the_messages_are_those_of_protocol_1_7() {
    assert_eq!(schema_hash(), 0x0b09_acb5_5604_1e0f, "{:#x}", schema_hash());
}
