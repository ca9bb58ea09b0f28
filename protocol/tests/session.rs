//! Stories of the session: both ends over a line that loses, damages and duplicates.

#![allow(clippy::unwrap_used, clippy::panic, reason = "a test ends by panicking")]

mod common;

use std::collections::HashMap;

use vergence_protocol::{
    BoardSession, HostEvent, HostSession, Microseconds, Report, Request, SessionId, Status, StopKind, SubmitError,
    WINDOW,
};

use common::rig::{Noise, Rig};
use common::{SESSION, answer, hello, move_to, without_to};

/// Submits `count` requests as fast as the window takes them: each must be executed once, in order, and answered.
fn converse(rig: &mut Rig, count: u16, limit: u64, name: &str) {
    let requests: Vec<Request> = (0..count)
        .map(|id| if id % 5 == 4 { Request::GetAxis { axis: id.to_le_bytes()[0] } } else { move_to(id) })
        .collect();
    let end = rig.now + limit;
    let mut tickets = HashMap::new();
    for request in &requests {
        let ticket = loop {
            match rig.submit(request.clone()) {
                Ok(ticket) => break ticket,
                Err(SubmitError::WindowFull) => {
                    let events = rig.events.len();
                    assert!(rig.run(end - rig.now, |rig| rig.events.len() > events), "{name}: stuck");
                }
                Err(error) => panic!("{name}: {error}"),
            }
        };
        assert!(tickets.insert(ticket, answer(request)).is_none(), "{name}: a ticket came twice");
    }
    assert!(rig.run(end - rig.now, |rig| rig.host.unanswered() == 0), "{name}: not finished in time");
    assert_eq!(rig.executed, requests, "{name}");
    for event in rig.events.drain(..) {
        match event {
            HostEvent::Reply { ticket, report } => {
                assert_eq!(tickets.remove(&ticket), Some(without_to(report)), "{name}: {ticket:?}");
            }
            HostEvent::Report(Report::Pose(_)) => {}
            other => panic!("{name}: {other:?}"),
        }
    }
    assert!(tickets.is_empty(), "{name}: without an answer: {tickets:?}");
}

#[test]
fn on_a_clean_line_nothing_is_sent_twice() {
    let mut rig = Rig::opened(Noise::default(), 1);
    converse(&mut rig, 600, 3_000_000, "clean");
    let statistics = rig.host.statistics();
    // One Hello and 600 requests: the sequence number went round twice.
    assert_eq!((statistics.sent, statistics.retransmitted, statistics.link.dropped()), (601, 0, 0));
    assert!(statistics.timeout >= Microseconds(5_000) && statistics.timeout <= Microseconds(20_000));
    assert!(statistics.round_trip.is_some_and(|time| time > Microseconds(500) && time < Microseconds(5_000)));
    // The board sends only the latest; the last that replaced one may still be under way.
    let replaced = rig.board.statistics().poses_replaced;
    assert!(replaced - statistics.poses_lost <= 1, "{replaced} {statistics:?}");
}

#[test]
fn through_loss_damage_and_duplication_every_request_is_executed_once_and_answered() {
    let mut gaps = 0;
    for seed in 0..150 {
        let lose = 0.1 * (seed % 11) as f64 / 10.0;
        let noise = Noise { lose, damage: 0.02, duplicate: 0.02 };
        let mut rig = Rig::opened(noise, seed);
        // Sometimes slower than the first time-out.
        rig.think = [0, 300, 3_000, 30_000][seed as usize % 4];
        let limit = 2_000_000 + 80 * rig.think;
        converse(&mut rig, 300, limit, &format!("seed {seed}"));
        let (host, board) = (rig.host.statistics(), rig.board.statistics());
        assert_eq!(rig.opened, 1, "seed {seed}");
        assert!(host.retransmitted > 0 && board.duplicates > 0, "seed {seed}: {host:?} {board:?}");
        gaps += board.gaps;
        assert!(host.poses > 0 && host.poses_lost > 0, "seed {seed}: {host:?}");
    }
    assert!(gaps > 1_000, "{gaps}");
}

#[test]
fn a_lost_request_is_asked_for_and_not_waited_for() {
    let mut rig = Rig::opened(Noise::default(), 3);
    converse(&mut rig, 50, 1_000_000, "warm-up");
    rig.executed.clear();
    let before = rig.host.statistics();
    rig.down.noise.lose = 1.0;
    rig.submit(move_to(1)).unwrap();
    rig.step();
    rig.down.noise.lose = 0.0;
    rig.submit(move_to(2)).unwrap();
    let start = rig.now;
    assert!(rig.run(1_000_000, |rig| rig.host.unanswered() == 0));
    assert_eq!(rig.executed, [move_to(1), move_to(2)]);
    assert!(rig.now - start < before.timeout.0, "took {} us, time-out {:?}", rig.now - start, before.timeout);
    assert_eq!(rig.host.statistics().retransmitted, before.retransmitted + 2);
}

#[test]
fn a_time_out_sends_all_again_that_the_board_may_miss() {
    let mut rig = Rig::opened(Noise::default(), 3);
    rig.down.noise.lose = 1.0;
    for id in 0..3 {
        rig.submit(move_to(id)).unwrap();
        rig.run(5_000, |_| false);
    }
    rig.down.noise.lose = 0.0;
    // The first waits 20 ms, of which 15 ms are over; the others do not wait for their own.
    assert!(rig.run(9_000, |rig| rig.executed.len() == 3), "{:?}", rig.executed);
    assert_eq!(rig.host.statistics().retransmitted, 3);
}

#[test]
fn a_lost_reply_is_given_again_and_the_request_not_done_again() {
    let mut rig = Rig::opened(Noise::default(), 4);
    rig.up.noise.lose = 1.0;
    let ticket = rig.submit(move_to(1)).unwrap();
    rig.run(15_000, |_| false);
    assert_eq!(rig.executed.len(), 1);
    rig.up.noise.lose = 0.0;
    assert!(rig.run(1_000_000, |rig| rig.host.unanswered() == 0));
    assert_eq!(rig.executed, [move_to(1)]);
    assert!(rig.events.iter().any(|event| matches!(event, HostEvent::Reply { ticket: to, .. } if *to == ticket)));
    assert_eq!(rig.board.statistics().duplicates, 1);
}

#[test]
fn against_a_dead_line_the_host_backs_off() {
    let mut rig = Rig::opened(Noise::default(), 5);
    rig.down.noise.lose = 1.0;
    rig.submit(move_to(1)).unwrap();
    rig.run(10_000_000, |_| false);
    let statistics = rig.host.statistics();
    assert_eq!(statistics.timeout, Microseconds(250_000));
    // 20 + 40 + 80 + 160 ms, then every 250 ms.
    assert!((40..=45).contains(&statistics.retransmitted), "{statistics:?}");
    rig.down.noise.lose = 0.0;
    assert!(rig.run(300_000, |rig| rig.host.unanswered() == 0), "it recovers within one time-out");
    // Nobody knows which of the many was answered (Karn's rule).
    let statistics = rig.host.statistics();
    assert_eq!((statistics.round_trip, statistics.timeout), (None, Microseconds(250_000)));
    rig.submit(move_to(2)).unwrap();
    assert!(rig.run(300_000, |rig| rig.host.unanswered() == 0));
    assert!(rig.host.statistics().timeout < Microseconds(20_000));
}

#[test]
fn hello_is_repeated_until_it_is_answered() {
    let mut rig = Rig::new(Noise { lose: 1.0, ..Noise::default() }, 6);
    assert_eq!(rig.submit(Request::Disarm), Err(SubmitError::NotOpen));
    rig.run(100_000, |_| false);
    assert_eq!(rig.host.statistics().sent, 0, "silent until hello");
    rig.host.hello();
    rig.run(1_000_000, |_| false);
    // At 0, 20, 60, 140, 300 ms, then every 250 ms.
    assert_eq!(rig.host.statistics().sent, 7);
    assert_eq!(rig.submit(Request::Disarm), Err(SubmitError::NotOpen));
    rig.down.noise.lose = 0.0;
    rig.run(600_000, |_| false);
    assert_eq!(rig.opened, 1, "the same hello opens once");
    rig.up.noise.lose = 0.0;
    assert!(rig.run(300_000, |rig| rig.host.is_open()));
    assert_eq!(rig.opened, 1);
}

#[test]
fn a_new_session_starts_from_nothing() {
    let mut rig = Rig::opened(Noise::default(), 7);
    converse(&mut rig, 10, 1_000_000, "first");
    rig.executed.clear();
    rig.host = HostSession::new(SessionId(2));
    rig.host.hello();
    assert!(rig.run(1_000_000, |rig| rig.host.is_open()));
    assert_eq!(rig.opened, 2);
    rig.events.clear();
    converse(&mut rig, 10, 1_000_000, "second");
}

#[test]
fn stop_needs_no_session_and_overtakes_everything() {
    let mut rig = Rig::new(Noise::default(), 8);
    let stop = Request::Stop { kind: StopKind::Decelerate };
    rig.host.send_now(stop.clone()).unwrap();
    assert!(rig.run(10_000, |rig| rig.executed == [Request::Stop { kind: StopKind::Decelerate }]));
    assert_eq!(rig.board.session(), None);

    let mut rig = Rig::opened(Noise::default(), 8);
    for id in 0..3 {
        rig.submit(move_to(id)).unwrap();
        rig.host.send_now(Request::Heartbeat { session: SESSION, lease_ms: 100 }).unwrap();
    }
    rig.host.send_now(Request::Heartbeat { session: SESSION, lease_ms: 100 }).unwrap();
    assert_eq!(
        rig.host.send_now(Request::TimeProbe { t0: Microseconds(0) }),
        Err(SubmitError::QueueFull),
        "nothing else waits for ever"
    );
    let ticket = rig.host.send_now(stop.clone()).unwrap();
    assert!(rig.run(100_000, |rig| rig.executed.len() == 7));
    assert_eq!(rig.executed[0], stop);
    rig.run(10_000, |_| false);
    let report = Report::Ack { to: 4, status: Status::Accepted };
    assert!(rig.events.contains(&HostEvent::Reply { ticket, report }));
}

#[test]
fn without_a_session_requests_are_dropped_and_the_host_learns_that_its_session_is_gone() {
    let mut rig = Rig::opened(Noise::default(), 9);
    rig.board = BoardSession::new(78);
    rig.submit(move_to(1)).unwrap();
    assert!(rig.run(100_000, |rig| !rig.host.is_open()));
    assert_eq!(rig.events.last(), Some(&HostEvent::Lost { boot: 78 }));
    assert_eq!(rig.executed, []);
    assert_eq!(rig.board.statistics().without_session, 1);
    assert_eq!(rig.host.unanswered(), 0);
    assert_eq!(rig.submit(move_to(2)), Err(SubmitError::NotOpen));
}

#[test]
fn immediate_requests_are_stamped_as_they_leave_and_never_repeated() {
    let mut rig = Rig::opened(Noise::default(), 10);
    let start = rig.now;
    rig.host.send_now(Request::TimeProbe { t0: Microseconds(1) }).unwrap();
    let reply = |event: &HostEvent| match event {
        HostEvent::Report(Report::TimeReply { t0, t2, .. }) => Some((t0.0, t2.0)),
        _ => None,
    };
    assert!(rig.run(100_000, |rig| rig.events.iter().any(|event| reply(event).is_some())));
    let (t0, t2) = rig.events.iter().find_map(reply).unwrap();
    assert!(t0 == start && t2 > t0 && t2 < rig.now, "{start} {t0} {t2} {}", rig.now);
    rig.down.noise.lose = 1.0;
    let sent = rig.host.statistics().sent;
    rig.host.send_now(Request::Heartbeat { session: SESSION, lease_ms: 100 }).unwrap();
    rig.run(1_000_000, |_| false);
    assert_eq!(rig.host.statistics().sent, sent + 1);
}

#[test]
fn each_request_goes_its_own_way() {
    let mut rig = Rig::opened(Noise::default(), 11);
    let immediate = [
        hello(SESSION),
        Request::Heartbeat { session: SESSION, lease_ms: 1 },
        Request::TimeProbe { t0: Microseconds(0) },
        Request::Stop { kind: StopKind::Decelerate },
    ];
    for request in immediate {
        assert_eq!(rig.submit(request), Err(SubmitError::WrongWay));
    }
    for request in [hello(SESSION), move_to(1), Request::Arm { session: SESSION }, Request::Disarm] {
        assert_eq!(rig.host.send_now(request), Err(SubmitError::WrongWay));
    }
}

#[test]
fn a_full_window_is_an_error() {
    let mut rig = Rig::opened(Noise::default(), 12);
    for id in 0..WINDOW {
        rig.submit(move_to(u16::try_from(id).unwrap())).unwrap();
    }
    assert_eq!(rig.submit(Request::Disarm), Err(SubmitError::WindowFull));
    assert!(rig.run(100_000, |rig| rig.host.unanswered() == 0));
    assert!(rig.submit(Request::Disarm).is_ok());
}

#[test]
fn the_window_does_not_slide_past_an_unanswered_request() {
    let mut rig = Rig::opened(Noise::default(), 13);
    rig.up.noise.lose = 1.0;
    rig.submit(move_to(0)).unwrap();
    rig.run(10_000, |_| false);
    rig.up.noise.lose = 0.0;
    for id in 1..4 {
        rig.submit(move_to(id)).unwrap();
    }
    assert!(rig.run(5_000, |rig| rig.host.unanswered() == 1), "only the first has no answer");
    assert_eq!(rig.submit(Request::Disarm), Err(SubmitError::WindowFull));
}
