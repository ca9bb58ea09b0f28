//! Laws of the frame: what goes in comes out, and nothing else ever does.

#![allow(clippy::unwrap_used, reason = "a test ends by panicking")]

mod messages;

use std::fmt::Debug;

use messages::{header, pose, report, request};
use proptest::collection::vec;
use proptest::prelude::*;
use proptest::strategy::ValueTree;
use proptest::test_runner::TestRunner;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use serde::de::DeserializeOwned;
use vergence_protocol::frame::{FrameError, Header, Kind, MAX_BODY, encode};
use vergence_protocol::{
    BoardSession, HostEvent, HostSession, MAX_FRAME, Microseconds, PROTOCOL, Receiver, Report, Request, SessionId,
    schema_hash,
};

const HEADER: Header = Header { major: PROTOCOL.major, kind: Kind::Control, seq: 7, ack: 9 };

fn framed<B: Serialize>(header: Header, body: &B) -> Vec<u8> {
    let mut buffer = [0; MAX_FRAME];
    let length = encode(header, body, &mut buffer).unwrap();
    buffer[..length].to_vec()
}

/// Everything a receiver makes of `bytes`.
fn received<B: DeserializeOwned>(receiver: &mut Receiver, bytes: &[u8]) -> Vec<(Header, Result<B, FrameError>)> {
    bytes.iter().filter_map(|&byte| receiver.push(byte).map(|frame| (frame.header, frame.body()))).collect()
}

fn bytes(bytes: Vec<u8>) -> heapless::Vec<u8, MAX_BODY> {
    bytes.into_iter().collect()
}

fn round_trip<B: Serialize + DeserializeOwned + PartialEq + Debug>(header: Header, message: B) {
    let bytes = framed(header, &message);
    assert_eq!(bytes.iter().position(|&byte| byte == 0), Some(bytes.len() - 1), "only the end is 0x00");
    assert_eq!(received(&mut Receiver::new(), &bytes), [(header, Ok(message))]);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_request_round_trips(header in header(), request in request()) {
        round_trip(header, request);
    }

    #[test]
    fn every_report_round_trips(header in header(), report in report()) {
        round_trip(header, report);
    }

    #[test]
    fn every_body_that_fits_round_trips(
        header in header(),
        body in vec(prop_oneof![Just(0), any::<u8>()], 0..MAX_BODY - 1),
    ) {
        round_trip(header, bytes(body));
    }

    #[test]
    fn a_message_with_bytes_left_over_is_refused(request in request(), extra in any::<u8>()) {
        let bytes = framed(HEADER, &(request, extra));
        prop_assert_eq!(received::<Request>(&mut Receiver::new(), &bytes), [(HEADER, Err(FrameError::Body))]);
    }

    #[test]
    fn how_the_stream_is_cut_does_not_matter(
        poses in vec(pose(), 1..10),
        cuts in vec(any::<prop::sample::Index>(), 0..20),
    ) {
        let mut host = opened_host();
        let header = Header { kind: Kind::Telemetry, ..HEADER };
        let stream: Vec<u8> = poses.iter().flat_map(|pose| framed(header, &Report::Pose(pose.clone()))).collect();
        let mut cuts: Vec<usize> = cuts.iter().map(|cut| cut.index(stream.len())).collect();
        cuts.extend([0, stream.len()]);
        cuts.sort_unstable();
        let mut received = Vec::new();
        for cut in cuts.windows(2) {
            host.receive(Microseconds(2), &stream[cut[0]..cut[1]], |event| received.push(event));
        }
        let sent: Vec<_> = poses.into_iter().map(|pose| HostEvent::Report(Report::Pose(pose))).collect();
        prop_assert_eq!(received, sent);
    }

    #[test]
    fn a_frame_is_found_after_any_bytes(noise in vec(any::<u8>(), 0..600), request in request()) {
        let mut receiver = Receiver::new();
        let _ = received::<Request>(&mut receiver, &noise);
        let _ = received::<Request>(&mut receiver, &[0]);
        prop_assert_eq!(received(&mut receiver, &framed(HEADER, &request)), [(HEADER, Ok(request))]);
    }
}

fn opened_host() -> HostSession {
    let session = SessionId(5);
    let mut host = HostSession::new(session);
    host.hello();
    let hello = Report::Hello { protocol: PROTOCOL, schema: schema_hash(), session, boot: 1 };
    host.receive(Microseconds(1), &framed(Header { kind: Kind::Immediate, ..HEADER }, &hello), |_| {});
    assert!(host.is_open());
    host
}

#[test]
fn a_body_too_long_is_refused_and_the_longest_fits_with_a_delimiter_before_it() {
    let mut buffer = [0; MAX_FRAME];
    // A list carries its length in two bytes here.
    assert_eq!(encode(HEADER, &bytes(vec![1; MAX_BODY - 2]), &mut buffer), Ok(MAX_FRAME - 1));
    assert_eq!(encode(HEADER, &bytes(vec![1; MAX_BODY - 1]), &mut buffer), Err(FrameError::TooLong));
}

#[test]
fn what_is_no_frame_is_counted_by_its_reason() {
    let mut receiver = Receiver::new();
    let mut damaged = framed(HEADER, &Request::Disarm);
    damaged[3] ^= 0x40; // its number
    let unknown_kind = {
        let mut packet = vec![PROTOCOL.major, 0x55, 1, 2, 3];
        let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI).checksum(&packet);
        packet.extend(crc.to_le_bytes());
        let mut stuffed = vec![0; 16];
        let length = cobs::encode(&packet, &mut stuffed);
        stuffed[..=length].to_vec()
    };
    for bytes in [&[1; 1000][..], &[0], &damaged, &[5, 1, 2, 3, 4, 0], &[5, 1, 2, 0], &unknown_kind] {
        assert_eq!(received::<Request>(&mut receiver, bytes), []);
    }
    let counters = receiver.counters();
    assert_eq!((counters.too_long, counters.checksum, counters.too_short), (1, 1, 1));
    assert_eq!((counters.stuffing, counters.kind, counters.frames), (1, 1, 0));
    assert_eq!(counters.dropped(), 5);
}

/// One to four changed bytes, an insertion, a deletion, a truncation or two of these.
fn corrupt(rng: &mut Pcg64Mcg, bytes: &mut Vec<u8>) {
    for _ in 0..rng.random_range(1..=2) {
        let at = rng.random_range(0..bytes.len());
        match rng.random_range(0..6) {
            0 => bytes.insert(at, rng.random()),
            1 if bytes.len() > 1 => {
                bytes.remove(at);
            }
            2 => bytes.truncate(at.max(1)),
            _ => {
                for _ in 0..rng.random_range(1..=4) {
                    let at = rng.random_range(0..bytes.len());
                    bytes[at] = if rng.random_bool(0.2) { 0 } else { rng.random() };
                }
            }
        }
    }
}

/// Corrupts `rounds` frames of `messages`; how many came through all the same, each equal to what was sent.
fn survivors<B>(messages: &[B], rounds: usize, rng: &mut Pcg64Mcg) -> usize
where
    B: Serialize + DeserializeOwned + PartialEq + Debug,
{
    let frames: Vec<Vec<u8>> = messages.iter().map(|message| framed(HEADER, message)).collect();
    let mut receiver = Receiver::new();
    let mut survivors = 0;
    for round in 0..rounds {
        let index = round % messages.len();
        let mut bytes = frames[index].clone();
        corrupt(rng, &mut bytes);
        bytes.push(0);
        for &byte in &bytes {
            if let Some(frame) = receiver.push(byte) {
                assert_eq!(frame.header, HEADER, "round {round}: {bytes:02x?}");
                assert_eq!(frame.body().as_ref(), Ok(&messages[index]), "round {round}: {bytes:02x?}");
                survivors += 1;
            }
        }
    }
    survivors
}

#[test]
fn a_million_corruptions_yield_no_wrong_message() {
    const ROUNDS: usize = 600_000;
    let mut runner = TestRunner::deterministic();
    let requests: Vec<Request> = (0..200).map(|_| request().new_tree(&mut runner).unwrap().current()).collect();
    let reports: Vec<Report> = (0..200).map(|_| report().new_tree(&mut runner).unwrap().current()).collect();
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let survived = survivors(&requests, ROUNDS, &mut rng) + survivors(&reports, ROUNDS, &mut rng);
    // Some changes change nothing (the same byte again, a second 0x00 at the end); most must.
    assert!(survived > 0 && survived < ROUNDS / 5, "{survived} of {} came through", 2 * ROUNDS);
}

#[test]
fn random_bytes_yield_nothing() {
    let mut rng = Pcg64Mcg::seed_from_u64(2);
    let mut receiver = Receiver::new();
    let mut board = BoardSession::new(1);
    let mut host = opened_host();
    for time in 0..2_000_000 {
        // More 0x00 than chance gives, so that most runs are short enough to be frames.
        let byte = if rng.random_bool(0.03) { 0 } else { rng.random() };
        assert_eq!(receiver.push(byte), None);
        assert_eq!(board.receive(Microseconds(time), byte), None);
        host.receive(Microseconds(time), &[byte], |event| panic!("received {event:?}"));
    }
    // Few random runs are well stuffed; these all are, so that only the CRC stands between them and a message.
    let mut stuffed = [0; 64];
    for _ in 0..500_000 {
        let packet: Vec<u8> = (0..rng.random_range(8..60)).map(|_| rng.random()).collect();
        let length = cobs::encode(&packet, &mut stuffed);
        for &byte in stuffed[..length].iter().chain(&[0]) {
            assert_eq!(receiver.push(byte), None);
        }
    }
    let counters = receiver.counters();
    assert!(counters.stuffing > 10_000 && counters.checksum > 500_000, "{counters:?}");
    let mut buffer = [0; MAX_FRAME];
    assert_eq!(board.transmit(Microseconds(0), &mut buffer), None);
    assert_eq!(host.transmit(Microseconds(3_000_000), &mut buffer), None);
}
