//! Messages of every kind with any contents.

use std::fmt::Debug;

use proptest::collection::vec;
use proptest::prelude::*;
use vergence_protocol::frame::{Header, Kind};
use vergence_protocol::{
    AxisInfo, AxisKind, AxisMask, BoardInfo, BoardStatistics, ControllerState, Counts, EVENTS_PER_ANSWER, FaultCode,
    FaultRecord, Happening, Jog, LinkCounters, MAX_AXES, Micro, Microseconds, Mode, Move, MoveId, MovePhase, Permille,
    PoseReport, ProtocolVersion, RecordedEvent, RecordedEvents, Refusal, Report, Request, ResetCause, SessionId,
    SettingItem, SettingKey, Status, StopKind, Trigger, TriggerMark,
};

fn micros() -> impl Strategy<Value = Microseconds> {
    any::<u64>().prop_map(Microseconds)
}

fn protocol() -> impl Strategy<Value = ProtocolVersion> {
    (any::<u8>(), any::<u8>()).prop_map(|(major, minor)| ProtocolVersion { major, minor })
}

fn axes<T: Debug>(value: impl Strategy<Value = T>) -> impl Strategy<Value = heapless::Vec<T, MAX_AXES>> {
    vec(value, 0..=MAX_AXES).prop_map(|values| values.into_iter().collect())
}

pub fn request() -> impl Strategy<Value = Request> {
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
        Just(Request::GetKey),
    ]
}

fn key() -> impl Strategy<Value = SettingKey> {
    (prop::sample::select(SettingItem::ALL.to_vec()), any::<u8>()).prop_map(|(item, axis)| SettingKey { item, axis })
}

fn happening() -> impl Strategy<Value = Happening> {
    let detail = (fault(), any::<i32>(), any::<u8>(), any::<bool>(), any::<bool>());
    detail.prop_flat_map(|(fault, number, axis, home, operated)| {
        prop::sample::select(vec![
            Happening::Started,
            Happening::Opened(SessionId(number.unsigned_abs())),
            Happening::State(ControllerState::Trial),
            Happening::Move(MoveId(number as u16)),
            Happening::Refused(Refusal::NotReferenced { axis }),
            Happening::Stop(StopKind::TorqueOff),
            Happening::Fault { code: fault.code, axis: fault.axis, detail: fault.detail },
            Happening::Switch { axis, home, operated },
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

fn mark() -> impl Strategy<Value = TriggerMark> {
    (any::<u32>(), micros(), axes(any::<i32>().prop_map(Counts))).prop_map(|(seq, at, counts)| TriggerMark {
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
        Just(Refusal::LineOnTrial),
        any::<u8>().prop_map(|axis| Refusal::AtHardLimit { axis }),
        any::<u8>().prop_map(|axis| Refusal::HomeSwitchAside { axis }),
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

pub fn pose() -> impl Strategy<Value = PoseReport> {
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

pub fn report() -> impl Strategy<Value = Report> {
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
        mark().prop_map(Report::TriggerMark),
    ]
}

pub fn header() -> impl Strategy<Value = Header> {
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
