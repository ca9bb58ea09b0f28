//! Laws of simulated servos: no input breaks them, and the same input gives the same bytes however time is cut.
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use vergence_dynamixel::units::Baud;
use vergence_dynamixel::{Id, encode, table};
use vergence_plant::servo::{Free, Master, Nanoseconds, Servo, ServoBus, ServoModel};

fn id(number: u8) -> Id {
    Id::servo(number).unwrap()
}

fn bus() -> ServoBus<Free> {
    let servo = |number| Servo::new(ServoModel::XM430_W350, id(number), Baud::M1, 3.0);
    ServoBus::new((13..16).map(servo).collect(), Free { loads: vec![0.5, -0.5] })
}

/// Any instruction to any servo, often one that exists.
fn packet() -> impl Strategy<Value = Vec<u8>> {
    let to = prop_oneof![4 => 13..16_u8, 1 => Just(254_u8), 1 => any::<u8>()];
    let code = prop::sample::select(vec![1, 2, 3, 4, 5, 6, 8, 16, 0x55, 0x82, 0x83, 0x8A, 0x92, 0x93, 0x9A, 0x20]);
    let address = prop_oneof![0..700_u16, prop::sample::select(vec![7_u16, 8, 11, 64, 98, 116, 126, 132, 224])];
    (to, code, address, prop::collection::vec(prop_oneof![any::<u8>(), 0..5_u8, 13..16_u8], 0..20)).prop_map(
        |(to, code, address, rest)| {
            let parameters = [&address.to_le_bytes()[..], &rest].concat();
            let parameters = if [1, 5, 8].contains(&code) { &[] } else { &parameters[..] };
            let to = Id::of_wire(to).unwrap_or(Id::BROADCAST);
            encode::raw(to, code, parameters).unwrap().to_vec()
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 128, rng_seed: RngSeed::Fixed(0x5eed), failure_persistence: None, ..ProptestConfig::default()
    })]

    #[test]
    fn nothing_that_is_sent_breaks_a_servo(packets in prop::collection::vec(packet(), 1..20), noise in prop::collection::vec(any::<u8>(), 0..40)) {
        let mut bus = bus();
        let mut master = Master::new(1_000_000);
        for packet in packets {
            master.ask(&mut bus, &packet, Nanoseconds::microseconds(2_000));
            master.ask(&mut bus, &noise, Nanoseconds::microseconds(300));
        }
        for servo in bus.servos() {
            prop_assert!(servo.motor().output().is_finite() && servo.motor().temperature().is_finite());
            prop_assert!(servo.id().is_some_and(|id| id != Id::BROADCAST));
        }
    }

    #[test]
    fn time_may_be_cut_anywhere(cuts in prop::collection::vec(1..400_000_u64, 0..200)) {
        let [mut whole, mut cut] = [bus(), bus()];
        let mut masters = [Master::new(1_000_000); 2];
        let goals = [13, 14, 15].map(|number| (id(number), 3_000_i32.to_le_bytes()));
        for (bus, master) in [&mut whole, &mut cut].into_iter().zip(&mut masters) {
            for number in 13..16 {
                let on = encode::write(id(number), table::TORQUE_ENABLE.address, &[1]).unwrap();
                master.ask(bus, &on, Nanoseconds::microseconds(1_000));
            }
            master.ask(bus, &encode::sync_write(table::GOAL_POSITION.address, &goals).unwrap(), Nanoseconds(0));
        }
        let mut now = masters[1].now;
        for step in cuts {
            now = now.plus(Nanoseconds(step));
            cut.advance(now);
        }
        whole.advance(now);
        let question = encode::fast_sync_read(126, 10, &[13, 14, 15].map(id)).unwrap();
        let answers = [&mut whole, &mut cut].map(|bus| {
            let mut master = Master { now, ..masters[0] };
            master.ask(bus, &question, Nanoseconds::microseconds(1_000))
        });
        prop_assert!(!answers[0].is_empty());
        prop_assert_eq!(&answers[0], &answers[1]);
    }
}
