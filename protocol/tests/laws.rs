//! Laws of the frame: what goes in comes out, and nothing else ever does.

#![allow(clippy::unwrap_used, reason = "a test ends by panicking")]

use std::fmt::Debug;

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
    AxisInfo, AxisKind, AxisMask, BoardInfo, BoardSession, BoardStatistics, ControllerState, Counts, EVENTS_PER_ANSWER,
    FaultCode, FaultRecord, FrameMark, Happening, HostEvent, HostSession, Jog, LinkCounters, MAX_AXES, MAX_FRAME,
    Micro, Microseconds, Mode, Move, MoveId, MovePhase, PROTOCOL, Permille, PoseReport, ProtocolVersion, Receiver,
    RecordedEvent, RecordedEvents, Refusal, Report, Request, ResetCause, SessionId, SettingItem, SettingKey, Status,
    StopKind, Trigger, schema_hash,
};

const HEADER: Header = Header { major: PROTOCOL.major, kind: Kind::Control, seq: 7, ack: 9 };

fn micros() -> impl Strategy<Value = Microseconds> {
    any::<u64>().prop_map(Microseconds)
}

fn protocol() -> impl Strategy<Value = ProtocolVersion> {
    (any::<u8>(), any::<u8>()).prop_map(|(major, minor)| ProtocolVersion { major, minor })
}

fn axes<T: Debug>(value: impl Strategy<Value = T>) -> impl Strategy<Value = heapless::Vec<T, MAX_AXES>> {
    vec(value, 0..=MAX_AXES).prop_map(|values| values.into_iter().collect())
}

fn request() -> impl Strategy<Value = Request> {
    let session = || any::<u32>().prop_map(SessionId);
    let stop = prop_oneof![Just(StopKind::Decelerate), Just(StopKind::TorqueOff)];
    let to = (any::<u16>(), any::<u8>(), axes(any::<i32>().prop_map(Micro)), any::<u16>()).prop_map(
        |(id, mode, targets, speed)| {
            Request::MoveTo(Move { id: MoveId(id), mode: Mode(mode), targets, speed: Permille(speed) })
        },
    );
    prop_oneof![
        (protocol(), any::<u64>(), session()).prop_map(|(protocol, schema, session)| Request::Hello {
            protocol,
            schema,
            session
        }),
        Just(Request::GetInfo),
        (session(), any::<u16>()).prop_map(|(session, lease_ms)| Request::Heartbeat { session, lease_ms }),
        micros().prop_map(|t0| Request::TimeProbe { t0 }),
        any::<u8>().prop_map(|axis| Request::GetAxis { axis }),
        session().prop_map(|session| Request::Arm { session }),
        Just(Request::Disarm),
        any::<u8>().prop_map(|mask| Request::Home { axes: AxisMask(mask) }),
        to,
        stop.prop_map(|kind| Request::Stop { kind }),
        any::<u16>().prop_map(|seen| Request::ClearFault { seen }),
        any::<u32>().prop_map(|period_us| Request::SetStream { period_us }),
        (any::<u16>(), axes(any::<i32>().prop_map(Micro)), any::<u16>())
            .prop_map(|(id, by, speed)| { Request::Jog(Jog { id: MoveId(id), by, speed: Permille(speed) }) }),
        key().prop_map(Request::GetSetting),
        (key(), any::<i64>()).prop_map(|(key, value)| Request::SetSetting { key, value }),
        Just(Request::SaveSettings),
        Just(Request::RestoreSettings),
        prop_oneof![
            Just(Trigger::Off),
            Just(Trigger::Once),
            any::<u32>().prop_map(|period_us| Trigger::Every { period_us })
        ]
        .prop_map(Request::SetTrigger),
        any::<u32>().prop_map(|first| Request::GetEvents { first }),
        Just(Request::GetStatistics),
    ]
}

fn key() -> impl Strategy<Value = SettingKey> {
    (prop::sample::select(SettingItem::ALL.to_vec()), any::<u8>()).prop_map(|(item, axis)| SettingKey { item, axis })
}

fn happening() -> impl Strategy<Value = Happening> {
    let detail = (fault(), any::<i32>(), any::<u8>(), any::<bool>(), any::<bool>());
    detail.prop_flat_map(|(fault, number, axis, home, closed)| {
        prop::sample::select(vec![
            Happening::Started,
            Happening::Opened(SessionId(number.unsigned_abs())),
            Happening::State(ControllerState::Trial),
            Happening::Move(MoveId(number as u16)),
            Happening::Refused(Refusal::NotReferenced { axis }),
            Happening::Stop(StopKind::TorqueOff),
            Happening::Fault { code: fault.code, axis: fault.axis, detail: fault.detail },
            Happening::Switch { axis, home, closed },
            Happening::Encoder { axis, counts: Counts(number) },
            Happening::Settings,
        ])
    })
}

fn events() -> impl Strategy<Value = RecordedEvents> {
    let event = (micros(), happening()).prop_map(|(at, what)| RecordedEvent { at, what });
    (any::<u32>(), any::<u32>(), vec(event, 0..=EVENTS_PER_ANSWER)).prop_map(|(first, total, events)| RecordedEvents {
        first,
        total,
        events: events.into_iter().collect(),
    })
}

fn statistics() -> impl Strategy<Value = BoardStatistics> {
    any::<[u32; 15]>().prop_map(|[a, b, c, d, e, f, g, h, i, j, k, l, m, n, o]| BoardStatistics {
        sent: a,
        duplicates: b,
        gaps: c,
        without_session: d,
        replies_dropped: e,
        events_dropped: f,
        poses_replaced: g,
        logs_dropped: h,
        link: LinkCounters { frames: i, too_long: j, too_short: k, stuffing: l, checksum: m, kind: n, body: o },
    })
}

fn mark() -> impl Strategy<Value = FrameMark> {
    (any::<u32>(), micros(), axes(any::<i32>().prop_map(Counts))).prop_map(|(seq, at, counts)| FrameMark {
        seq,
        at,
        counts,
    })
}

fn fault() -> impl Strategy<Value = FaultRecord> {
    let code = prop::sample::select(vec![
        FaultCode::LeaseExpired,
        FaultCode::FollowingError,
        FaultCode::NotSettled,
        FaultCode::HomeSwitchNotFound,
        FaultCode::HomeSwitchStuck,
        FaultCode::HomeNotRepeatable,
        FaultCode::HardLimit,
        FaultCode::EmergencyStop,
        FaultCode::BadSettings,
    ]);
    (code, any::<u16>(), micros(), any::<Option<u8>>(), any::<i32>(), any::<u16>())
        .prop_map(|(code, seq, at, axis, detail, later)| FaultRecord { code, seq, at, axis, detail, later })
}

fn status() -> impl Strategy<Value = Status> {
    let refusal = prop_oneof![
        Just(Refusal::NotArmed),
        Just(Refusal::WrongSession),
        Just(Refusal::NoLease),
        any::<u8>().prop_map(|axis| Refusal::NotReferenced { axis }),
        any::<u8>().prop_map(|axis| Refusal::OutsideLimits { axis }),
        Just(Refusal::Busy),
        Just(Refusal::Latched),
        Just(Refusal::WrongFault),
        Just(Refusal::CausePersists),
        Just(Refusal::Invalid),
        Just(Refusal::ReadOnly),
    ];
    prop_oneof![Just(Status::Accepted), refusal.prop_map(Status::Refused)]
}

fn phase() -> impl Strategy<Value = MovePhase> {
    prop::sample::select(vec![
        MovePhase::None,
        MovePhase::Running,
        MovePhase::Settling,
        MovePhase::Settled,
        MovePhase::Stopped,
    ])
}

fn pose() -> impl Strategy<Value = PoseReport> {
    let state = prop::sample::select(vec![
        ControllerState::Idle,
        ControllerState::Ready,
        ControllerState::Homing,
        ControllerState::Moving,
        ControllerState::Stopping,
        ControllerState::LinkLost,
        ControllerState::Fault,
    ]);
    let counts = axes(any::<i32>().prop_map(Counts));
    let place = (micros(), any::<u16>(), counts, any::<u8>().prop_map(AxisMask));
    let doing = (state, any::<u8>(), any::<u16>(), phase(), prop::option::of(fault()));
    (place, doing).prop_map(|((at, seq, counts, referenced), (state, mode, id, phase, fault))| PoseReport {
        at,
        seq,
        counts,
        referenced,
        state,
        mode: Mode(mode),
        move_id: MoveId(id),
        phase,
        fault,
    })
}

fn board_info() -> impl Strategy<Value = BoardInfo> {
    let reset =
        prop::sample::select(vec![ResetCause::PowerOn, ResetCause::Pin, ResetCause::Software, ResetCause::Watchdog]);
    ("[a-z0-9-]{0,16}", any::<[u8; 3]>(), any::<u64>(), any::<[u8; 12]>(), reset, any::<u8>()).prop_map(
        |(board, firmware, build, uid, reset, axes)| BoardInfo {
            board: board.as_str().try_into().unwrap(),
            firmware,
            build,
            uid,
            reset,
            axes,
        },
    )
}

fn axis_info() -> impl Strategy<Value = AxisInfo> {
    let kind = prop_oneof![Just(AxisKind::Linear), Just(AxisKind::Rotary)];
    (kind, any::<[i32; 2]>(), any::<[u32; 4]>()).prop_map(
        |(kind, [min, max], [speed, acceleration, jerk, counts_per_unit])| AxisInfo {
            kind,
            min: Micro(min),
            max: Micro(max),
            speed,
            acceleration,
            jerk,
            counts_per_unit,
        },
    )
}

fn report() -> impl Strategy<Value = Report> {
    prop_oneof![
        (protocol(), any::<u64>(), any::<u32>(), any::<u32>()).prop_map(|(protocol, schema, session, boot)| {
            Report::Hello { protocol, schema, session: SessionId(session), boot }
        }),
        (any::<u8>(), board_info()).prop_map(|(to, info)| Report::Info { to, info }),
        (any::<u8>(), status()).prop_map(|(to, status)| Report::Ack { to, status }),
        (micros(), micros(), micros()).prop_map(|(t0, t1, t2)| Report::TimeReply { t0, t1, t2 }),
        (any::<u8>(), any::<u8>(), axis_info()).prop_map(|(to, axis, info)| Report::Axis { to, axis, info }),
        pose().prop_map(Report::Pose),
        (any::<u16>(), phase()).prop_map(|(id, phase)| Report::MoveState { id: MoveId(id), phase }),
        fault().prop_map(Report::Fault),
        (any::<u8>(), key(), any::<i64>()).prop_map(|(to, key, value)| Report::Setting { to, key, value }),
        (any::<u8>(), events()).prop_map(|(to, events)| Report::Events { to, events }),
        (any::<u8>(), statistics()).prop_map(|(to, statistics)| Report::Statistics { to, statistics }),
        mark().prop_map(Report::FrameMark),
    ]
}

fn header() -> impl Strategy<Value = Header> {
    let kind = prop::sample::select(vec![
        Kind::Control,
        Kind::Telemetry,
        Kind::Log,
        Kind::Firmware,
        Kind::Immediate,
        Kind::AckOnly,
        Kind::Nak,
    ]);
    (any::<u8>(), kind, any::<u8>(), any::<u8>()).prop_map(|(major, kind, seq, ack)| Header { major, kind, seq, ack })
}

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
        let mut heard = Vec::new();
        for cut in cuts.windows(2) {
            host.receive(Microseconds(2), &stream[cut[0]..cut[1]], |event| heard.push(event));
        }
        let sent: Vec<_> = poses.into_iter().map(|pose| HostEvent::Report(Report::Pose(pose))).collect();
        prop_assert_eq!(heard, sent);
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
        host.receive(Microseconds(time), &[byte], |event| panic!("heard {event:?}"));
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
