//! What a frame costs beside plain postcard: `cargo bench -p vergence-protocol --bench codec`.
#![allow(missing_docs, reason = "criterion's macros write functions without")]
#![allow(clippy::unwrap_used, reason = "a bench fails by panic")]

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use serde::Serialize;
use serde::de::DeserializeOwned;
use vergence_protocol::frame::{Header, Kind, encode};
use vergence_protocol::management::{CHUNK, Management};
use vergence_protocol::{
    AxisMask, ControllerState, Counts, FaultCode, FaultRecord, MAX_FRAME, Micro, Microseconds, Mode, Move, MoveId,
    MovePhase, PROTOCOL, Permille, PoseReport, Receiver, Report, Request, SessionId,
};

const HEADER: Header = Header { major: PROTOCOL.major, kind: Kind::Control, seq: 7, ack: 9 };

fn pose(fault: Option<FaultRecord>) -> Report {
    Report::Pose(PoseReport {
        at: Microseconds(1_234_567_890),
        seq: 4_321,
        counts: [Counts(123_456), Counts(-54_321)].into_iter().collect(),
        referenced: AxisMask::first(2),
        state: ControllerState::Ready,
        mode: Mode(2),
        move_id: MoveId(300),
        phase: MovePhase::Settled,
        fault,
    })
}

/// One message four ways: with and without frame, out and in.
fn message<M: Serialize + DeserializeOwned>(criterion: &mut Criterion, name: &str, message: &M) {
    let mut buffer = [0; MAX_FRAME];
    let length = encode(HEADER, message, &mut buffer).unwrap();
    let frame = buffer[..length].to_vec();
    let plain = postcard::to_slice(message, &mut buffer).unwrap().to_vec();
    let mut group = criterion.benchmark_group(format!("{name} ({length} bytes, postcard {})", plain.len()));
    group.bench_function("encode", |bencher| bencher.iter(|| encode(HEADER, black_box(message), &mut buffer)));
    group.bench_function("encode, postcard alone", |bencher| {
        bencher.iter(|| postcard::to_slice(black_box(message), &mut buffer).map(|bytes| bytes.len()));
    });
    let mut receiver = Receiver::new();
    group.bench_function("decode", |bencher| {
        bencher.iter(|| {
            let mut received = None;
            for &byte in black_box(&frame) {
                if let Some(frame) = receiver.push(byte) {
                    received = frame.body::<M>().ok();
                }
            }
            received
        });
    });
    group.bench_function("decode, postcard alone", |bencher| {
        bencher.iter(|| postcard::from_bytes::<M>(black_box(&plain)));
    });
    group.finish();
}

fn codec(criterion: &mut Criterion) {
    message(criterion, "Heartbeat", &Request::Heartbeat { session: SessionId(0x1234_5678), lease_ms: 100 });
    let targets = [Micro(145_000), Micro(2_094_395)].into_iter().collect();
    let order = Move { id: MoveId(300), mode: Mode(2), targets, speed: Permille::FULL };
    message(criterion, "MoveTo", &Request::MoveTo(order));
    message(criterion, "Pose", &pose(None));
    let fault = FaultRecord {
        code: FaultCode::FollowingError,
        seq: 3,
        at: Microseconds(1_234_000_000),
        axis: Some(1),
        detail: -1_005,
        later: 2,
    };
    message(criterion, "Pose with fault", &pose(Some(fault)));
    let data = (0..CHUNK).map(|byte| byte as u8).collect();
    message(criterion, "Chunk", &Management::Chunk { offset: 65_536, data });
}

criterion_group!(benches, codec);
criterion_main!(benches);
