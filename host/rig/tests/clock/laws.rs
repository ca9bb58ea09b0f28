//! Laws of the clock map, and exact cases.

use proptest::prelude::*;
use vergence_protocol::Microseconds;
use vergence_rig::{BoardInstant, ClockMap, Exchange};

fn exchange(t0: u64, t1: u64, t2: u64, t3: u64) -> Exchange {
    let [t0, t1, t2, t3] = [t0, t1, t2, t3].map(Microseconds);
    Exchange { t0, t1, t2, t3 }
}

fn board_at(map: &ClockMap, host: u64) -> BoardInstant {
    map.board_at(Microseconds(host)).expect("there were exchanges")
}

/// Exchanges each second with these delays down and up.
fn observed(map: &mut ClockMap, board: impl Fn(u64) -> f64, delays: &[(u64, u64)]) {
    for (t0, (down, up)) in (0..).step_by(1_000_000).zip(delays) {
        let arrived = board(t0 + down) as u64;
        map.observe(exchange(t0, arrived, arrived, t0 + down + up));
    }
}

proptest! {
    /// With any start, a drift up to 150 ppm and any delays of the link, the error never exceeds the stated bound.
    #[test]
    fn the_clock_map_keeps_its_bound(
        offset in 0u64..10_000_000_000,
        drift in -150e-6..150e-6f64,
        delays in prop::collection::vec((1u64..20_000, 1u64..20_000), 1..50),
        ask in 0u64..60_000_000,
    ) {
        let board = |host: u64| offset as f64 + host as f64 * (1.0 + drift);
        let mut map = ClockMap::default();
        observed(&mut map, board, &delays);
        let got = board_at(&map, ask);
        prop_assert!((got.us - board(ask)).abs() <= got.error_us, "{:?} {}", got, board(ask));
        let back = map.host_at(Microseconds(board(ask) as u64)).expect("there were exchanges");
        prop_assert!((back.us - ask as f64).abs() <= back.error_us + 1.0, "{:?} {}", back, ask);
        let stated = map.drift().expect("there were exchanges");
        prop_assert!((stated.ppm - 1e6 * drift).abs() <= stated.error_ppm, "{:?} {}", stated, drift);
    }

    /// The converted clock never stands still or runs backwards, and converting there and back returns the start.
    #[test]
    fn the_conversion_is_monotone_and_has_an_inverse(
        delays in prop::collection::vec((1u64..20_000, 1u64..20_000), 1..20),
        hosts in prop::collection::btree_set(0u64..100_000_000, 2..40),
    ) {
        let mut map = ClockMap::default();
        observed(&mut map, |host| 5e9 + host as f64 * (1.0 + 80e-6), &delays);
        let stated: Vec<f64> = hosts.iter().map(|&host| board_at(&map, host).us).collect();
        prop_assert!(stated.is_sorted_by(|a, b| a < b));
        for (&host, us) in hosts.iter().zip(stated) {
            let back = map.host_at(Microseconds(us.round() as u64)).expect("there were exchanges");
            prop_assert!((back.us - host as f64).abs() < 0.51, "{:?} {}", back, host);
        }
    }

    /// One message that is late by 16 ms or more moves the estimate by no more than the bound before, and hardly
    /// changes the bound.
    #[test]
    fn one_late_message_does_not_move_the_estimate(
        delays in prop::collection::vec((1u64..100, 1u64..100), 2..50),
        late in 16_000u64..900_000,
        down in any::<bool>(),
    ) {
        let board = |host: u64| 3e6 + host as f64 * (1.0 - 80e-6);
        let mut map = ClockMap::default();
        observed(&mut map, board, &delays);
        let t0 = 1_000_000 * delays.len() as u64;
        let t3 = t0 + 50 + late;
        let arrived = board(if down { t3 - 25 } else { t0 + 25 }) as u64;
        let before = board_at(&map, t3);
        map.observe(exchange(t0, arrived, arrived, t3));
        let after = board_at(&map, t3);
        prop_assert!((after.us - before.us).abs() <= before.error_us, "{:?} {:?}", before, after);
        prop_assert!((after.us - board(t3)).abs() <= after.error_us, "{:?} {}", after, board(t3));
        prop_assert!(after.error_us <= 1.5 * before.error_us + 2.0, "{:?} {:?}", before, after);
    }

    /// Any timestamps give finite results.
    #[test]
    fn any_timestamps_give_finite_results(
        stamps in prop::collection::vec(any::<[u64; 4]>(), 0..20),
        baud in any::<u32>(),
        ask in any::<u64>(),
    ) {
        let mut map = ClockMap::at_baud(baud);
        for [t0, t1, t2, t3] in stamps {
            map.observe(exchange(t0, t1, t2, t3));
            map.observe(exchange(t0.min(t3), t1.min(t2), t1.max(t2), t0.max(t3)));
        }
        let board = map.board_at(Microseconds(ask));
        let host = map.host_at(Microseconds(ask));
        prop_assert!(board.is_none_or(|stated| stated.us.is_finite() && stated.error_us >= 0.0));
        prop_assert!(host.is_none_or(|stated| stated.us.is_finite() && stated.error_us >= 0.0));
        prop_assert!(map.drift().is_none_or(|stated| stated.ppm.abs() <= 200.0 + 1e-9));
    }
}

#[test]
fn no_clock_before_the_first_exchange() {
    let map = ClockMap::default();
    assert_eq!((map.board_at(Microseconds(5)), map.host_at(Microseconds(5)), map.drift()), (None, None, None));
    assert!(!map.is_lost());
}

/// 7 000 000 + h · 1.000 08 is whole at every full second, and the exchanges take no time.
#[test]
fn offset_and_drift_of_exact_exchanges_are_exact() {
    let mut map = ClockMap::default();
    for second in 0..30 {
        let (host, board) = (second * 1_000_000, 7_000_000 + second * 1_000_080);
        map.observe(exchange(host, board, board, host));
    }
    let got = board_at(&map, 40_000_000);
    assert!((got.us - 47_003_200.0).abs() < 1e-6, "{got:?}");
    let drift = map.drift().expect("known");
    assert!((drift.ppm - 80.0).abs() < 1e-9 && drift.error_ppm < 2.0, "{drift:?}");
    let back = map.host_at(Microseconds(47_003_200)).expect("known");
    assert!((back.us - 40_000_000.0).abs() < 1e-6, "{back:?}");
}

/// At 1 000 000 baud a byte takes 10 us. The probe has 10 bytes around the postcard body of 1 + 4, the reply around
/// 1 + 4 + 4 + 4: 150 us down, 230 us up.
#[test]
fn a_longer_reply_is_no_error_at_a_known_baud_rate() {
    let clock_of = |mut map: ClockMap| {
        for second in 3..20 {
            let (t0, arrived) = (second * 1_000_000, second * 1_000_000 + 5_000_000 + 150);
            map.observe(exchange(t0, arrived, arrived, t0 + 150 + 230));
        }
        board_at(&map, 20_000_000)
    };
    let known = clock_of(ClockMap::at_baud(1_000_000));
    assert!((known.us - 25_000_000.0).abs() < 0.01, "{known:?}");
    let unknown = clock_of(ClockMap::default());
    assert!((unknown.us - (25_000_000.0 - 40.0)).abs() < 0.01, "{unknown:?}");
    assert!(known.error_us < 60.0 && unknown.error_us > 190.0, "{known:?} {unknown:?}");
}

#[test]
fn four_probes_without_answer_lose_the_clock_and_one_answer_finds_it() {
    let mut map = ClockMap::default();
    map.observe(exchange(0, 500, 500, 100));
    for _ in 0..4 {
        map.probe_sent();
        assert!(!map.is_lost());
    }
    map.probe_sent();
    assert!(map.is_lost());
    let clock_of = |map: &ClockMap| board_at(map, 6_000_000);
    let lost = clock_of(&map);
    map.observe(exchange(5_999_900, 6_000_400, 6_000_400, 6_000_000));
    assert!(!map.is_lost());
    assert!(clock_of(&map).error_us < 100.0 && lost.error_us > 1_000.0, "{lost:?}");
}

#[test]
fn a_board_that_begins_anew_begins_a_new_clock() {
    let mut map = ClockMap::default();
    observed(&mut map, |host| 9e9 + host as f64, &[(50, 50); 60]);
    map.observe(exchange(60_000_000, 1_000, 1_000, 60_000_100));
    let got = board_at(&map, 60_000_050);
    assert!((got.us - 1_000.0).abs() < 1e-6 && got.error_us < 60.0, "{got:?}");
    assert!(map.drift().expect("known").error_ppm > 199.0);
}

/// As when another board answers, that has run for longer.
#[test]
fn a_clock_that_jumps_forward_is_believed() {
    let mut map = ClockMap::default();
    observed(&mut map, |host| host as f64, &[(50, 50); 60]);
    map.observe(exchange(60_000_000, 70_000_050, 70_000_050, 60_000_100));
    let got = board_at(&map, 60_000_050);
    assert!((got.us - 70_000_050.0).abs() < 1e-6 && got.error_us < 60.0, "{got:?}");
}

#[test]
fn an_exchange_that_cannot_have_happened_is_not_taken() {
    let mut map = ClockMap::default();
    for [t0, t1, t2, t3] in [[100, 5, 5, 90], [100, 6, 5, 200], [100, 0, 500, 200]] {
        map.observe(exchange(t0, t1, t2, t3));
        assert_eq!(map.board_at(Microseconds(150)), None);
    }
}
