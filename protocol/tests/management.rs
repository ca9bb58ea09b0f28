//! Management messages are frozen for ever: each byte for byte, and all by the hash of their shape.
//!
//! The frames were computed apart from this crate; `v` and `frame` are those of `golden.rs`:
//!
//! ```text
//! h = [1, 3, 7, 9]
//! image = v(0x34474756) + bytes([1, 2, 3]) + v(98304) + v(0x1122334455667788) + bytes(range(32))
//! identify = frame(h, v(0));    begin = frame(h, v(1) + image);    confirm = frame(h, v(4));    rollback = frame(h, v(5))
//! chunk = frame(h, v(2) + v(2048) + v(8) + bytes([1, 2, 3, 4, 5, 6, 7, 255]))
//! commit = frame(h, v(3) + bytes(range(100, 164)));    reboot = frame(h, v(6) + v(1))
//! identity = frame(h, v(0) + v(0x34474756) + bytes([1, 2, 3, 1, 0, 0]) + v(0x1122334455667788) + v(1) + v(98304))
//! progress = frame(h, v(1) + bytes([200]) + v(2048) + v(9))
//! ```

#![allow(clippy::unwrap_used, reason = "a test ends by panicking")]

use std::fmt::Debug;

use serde::Serialize;
use serde::de::DeserializeOwned;
use vergence_protocol::frame::{Header, Kind, encode};
use vergence_protocol::management::{
    BootState, Identity, ImageHeader, Management, ManagementReport, Outcome, RebootTo, Signature, schema_hash,
};
use vergence_protocol::{MAX_FRAME, Receiver};

const HEADER: ImageHeader = ImageHeader {
    hardware: 0x3447_4756,
    version: [1, 2, 3],
    length: 98_304,
    build: 0x1122_3344_5566_7788,
    sha256: counting(0),
};
const IDENTITY: Identity = Identity {
    hardware: 0x3447_4756,
    version: [1, 2, 3],
    oldest: [1, 0, 0],
    build: 0x1122_3344_5566_7788,
    boot: BootState::Trial,
    capacity: 98_304,
};

const fn counting(from: u8) -> [u8; 32] {
    let mut bytes = [0; 32];
    let mut at = 0;
    while at < bytes.len() {
        bytes[at] = from + at as u8;
        at += 1;
    }
    bytes
}

/// The message makes these bytes, and these bytes the message.
fn check<M: Serialize + DeserializeOwned + PartialEq + Debug>(message: &M, expected: &[u8]) {
    let mut buffer = [0; MAX_FRAME];
    let header = Header { major: 1, kind: Kind::Firmware, seq: 7, ack: 9 };
    let length = encode(header, message, &mut buffer).unwrap();
    assert_eq!(&buffer[..length], expected, "{message:?}");
    let mut receiver = Receiver::new();
    let received: Vec<M> =
        expected.iter().filter_map(|&byte| receiver.push(byte).map(|frame| frame.body().unwrap())).collect();
    assert_eq!(received.iter().collect::<Vec<_>>(), [message]);
}

#[test]
fn identify() {
    let expected = [0x05, 0x01, 0x03, 0x07, 0x09, 0x05, 0x06, 0xaf, 0x07, 0xe5, 0x00];
    check(&Management::Identify, &expected);
}

#[test]
fn begin() {
    let expected = [
        0x1a, 0x01, 0x03, 0x07, 0x09, 0x01, 0xd6, 0x8e, 0x9d, 0xa2, 0x03, 0x01, 0x02, 0x03, 0x80, 0x80, 0x06, 0x88,
        0xef, 0x99, 0xab, 0xc5, 0xe8, 0x8c, 0x91, 0x11, 0x24, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0x08, 0x09,
        0x0a, 0x0b, 0x0c, 0x0d, 0x0e, 0x0f, 0x10, 0x11, 0x12, 0x13, 0x14, 0x15, 0x16, 0x17, 0x18, 0x19, 0x1a, 0x1b,
        0x1c, 0x1d, 0x1e, 0x1f, 0x62, 0x92, 0xc1, 0xa7, 0x00,
    ];
    check(&Management::Begin(HEADER), &expected);
}

#[test]
fn chunk() {
    let expected = [
        0x15, 0x01, 0x03, 0x07, 0x09, 0x02, 0x80, 0x10, 0x08, 0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x07, 0xff, 0x5c,
        0xed, 0xc5, 0x5f, 0x00,
    ];
    check(
        &Management::Chunk { offset: 2048, data: heapless::Vec::from_slice(&[1, 2, 3, 4, 5, 6, 7, 0xFF]).unwrap() },
        &expected,
    );
}

#[test]
fn commit() {
    let expected = [
        0x4a, 0x01, 0x03, 0x07, 0x09, 0x03, 0x64, 0x65, 0x66, 0x67, 0x68, 0x69, 0x6a, 0x6b, 0x6c, 0x6d, 0x6e, 0x6f,
        0x70, 0x71, 0x72, 0x73, 0x74, 0x75, 0x76, 0x77, 0x78, 0x79, 0x7a, 0x7b, 0x7c, 0x7d, 0x7e, 0x7f, 0x80, 0x81,
        0x82, 0x83, 0x84, 0x85, 0x86, 0x87, 0x88, 0x89, 0x8a, 0x8b, 0x8c, 0x8d, 0x8e, 0x8f, 0x90, 0x91, 0x92, 0x93,
        0x94, 0x95, 0x96, 0x97, 0x98, 0x99, 0x9a, 0x9b, 0x9c, 0x9d, 0x9e, 0x9f, 0xa0, 0xa1, 0xa2, 0xa3, 0xeb, 0x96,
        0x65, 0xdb, 0x00,
    ];
    check(&Management::Commit(Signature { r: counting(100), s: counting(132) }), &expected);
}

#[test]
fn confirm() {
    let expected = [0x0a, 0x01, 0x03, 0x07, 0x09, 0x04, 0x19, 0x38, 0x9d, 0x22, 0x00];
    check(&Management::Confirm, &expected);
}

#[test]
fn rollback() {
    let expected = [0x0a, 0x01, 0x03, 0x07, 0x09, 0x05, 0x1a, 0xbb, 0xf6, 0xd0, 0x00];
    check(&Management::Rollback, &expected);
}

#[test]
fn reboot() {
    let expected = [0x0b, 0x01, 0x03, 0x07, 0x09, 0x06, 0x01, 0x27, 0x61, 0x9d, 0xef, 0x00];
    check(&Management::Reboot(RebootTo::Recovery), &expected);
}

#[test]
fn identity() {
    let expected = [
        0x05, 0x01, 0x03, 0x07, 0x09, 0x0a, 0xd6, 0x8e, 0x9d, 0xa2, 0x03, 0x01, 0x02, 0x03, 0x01, 0x01, 0x12, 0x88,
        0xef, 0x99, 0xab, 0xc5, 0xe8, 0x8c, 0x91, 0x11, 0x01, 0x80, 0x80, 0x06, 0x82, 0x09, 0x8d, 0x97, 0x00,
    ];
    check(&ManagementReport::Identity(IDENTITY), &expected);
}

#[test]
fn progress() {
    let expected = [0x0e, 0x01, 0x03, 0x07, 0x09, 0x01, 0xc8, 0x80, 0x10, 0x09, 0x91, 0x3d, 0x4f, 0xfd, 0x00];
    check(&ManagementReport::Progress { to: 200, next: 2048, outcome: Outcome::NothingToRollBack }, &expected);
}

#[test]
fn what_is_signed_is_the_header_byte_for_byte() {
    let signed = HEADER.signed_bytes();
    assert_eq!(signed[..19], *b"VGG4\x01\x02\x03\x00\x80\x01\x00\x88\x77\x66\x55\x44\x33\x22\x11");
    assert_eq!(signed[19..], counting(0));
}

/// There is no change that this test may be adapted to: boards in the field would be lost.
#[test]
fn the_shape_is_frozen() {
    assert_eq!(schema_hash(), 0x08d8_e82e_735a_0e39, "{:#x}", schema_hash());
}
