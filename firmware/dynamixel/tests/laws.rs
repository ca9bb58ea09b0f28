//! Laws: what is sent is understood, whatever it holds, however it is cut, and whatever noise surrounds it.

#![allow(clippy::unwrap_used, reason = "a test ends by panicking")]

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use vergence_dynamixel::answer::{self, FastPart};
use vergence_dynamixel::units::{Baud, BusWatchdog, Position, Velocity};
use vergence_dynamixel::{
    BulkItem, FastBlocks, Id, Instruction, MAX_PACKET, Malformed, Receiver, Status, encode, table,
};

/// Bytes that often look like headers and stuffing.
fn nasty(longest: usize) -> impl Strategy<Value = Vec<u8>> {
    let byte = prop_oneof![4 => Just(0xFF_u8), 4 => Just(0xFD), 2 => Just(0x00), 1 => Just(0x55), 2 => any::<u8>()];
    prop::collection::vec(byte, 0..longest)
}

fn servo() -> impl Strategy<Value = Id> {
    (0..=Id::MAX).prop_map(|number| Id::servo(number).unwrap())
}

/// Everything that `receiver` finds in `bytes`, cut at `cuts`.
fn heard(receiver: &mut Receiver, bytes: &[u8], cuts: &[usize]) -> Vec<(Id, u8, Vec<u8>)> {
    let mut found = Vec::new();
    let mut rest = bytes;
    let mut cuts = cuts.iter().copied().chain(std::iter::repeat(MAX_PACKET));
    while !rest.is_empty() {
        let (mut chunk, later) = rest.split_at(cuts.next().unwrap().clamp(1, rest.len()));
        rest = later;
        while !chunk.is_empty() {
            chunk = receiver.hear(chunk);
            while let Some(packet) = receiver.next_packet() {
                found.push((packet.id, packet.instruction, packet.parameters.to_vec()));
            }
        }
    }
    found
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 512, rng_seed: RngSeed::Fixed(0x5eed), failure_persistence: None, ..ProptestConfig::default()
    })]

    #[test]
    fn any_parameters_survive(id in servo(), instruction in any::<u8>(), parameters in nasty(120)) {
        prop_assume!(instruction != 0xFF);
        let made = encode::raw(id, instruction, &parameters).unwrap();
        let inside = &made[4..];
        prop_assert!(!inside.windows(4).any(|bytes| bytes == [0xFF, 0xFF, 0xFD, 0x00]) || made.len() < 12
            || made[made.len() - 5..].windows(4).any(|bytes| bytes == [0xFF, 0xFF, 0xFD, 0x00]),
            "no header inside, but for one that the CRC completes");
        let found = heard(&mut Receiver::default(), &made, &[]);
        prop_assert_eq!(found, vec![(id, instruction, parameters)]);
    }

    #[test]
    fn packets_are_found_however_they_are_cut(
        packets in prop::collection::vec((servo(), nasty(60)), 1..6),
        cuts in prop::collection::vec(1..40_usize, 0..40),
    ) {
        let mut wire = Vec::new();
        for (id, data) in &packets {
            wire.extend_from_slice(&answer::status(*id, 0, data).unwrap());
        }
        let mut receiver = Receiver::default();
        let found = heard(&mut receiver, &wire, &cuts);
        let expected: Vec<_> =
            packets.into_iter().map(|(id, data)| (id, 0x55, [&[0][..], &data].concat())).collect();
        prop_assert_eq!(found, expected);
        prop_assert_eq!(receiver.counters(), Default::default());
    }

    #[test]
    fn packets_are_found_behind_garbage(
        garbage in nasty(80),
        between in nasty(80),
        first in nasty(40),
        second in nasty(40),
        cuts in prop::collection::vec(1..40_usize, 0..40),
    ) {
        let id = Id::servo(5).unwrap();
        let [first, second] = [first, second].map(|data| answer::status(id, 0, &data).unwrap());
        let wire = [&garbage, &first[..], &between, &second[..]].concat();
        let mut receiver = Receiver::default();
        let mut found = heard(&mut receiver, &wire, &cuts);
        // Garbage may claim bytes that never come.
        receiver.line_is_quiet();
        while let Some(packet) = receiver.next_packet() {
            found.push((packet.id, packet.instruction, packet.parameters.to_vec()));
            receiver.line_is_quiet();
        }
        let statuses = found.iter().filter(|(found, instruction, _)| *found == id && *instruction == 0x55).count();
        prop_assert!(statuses >= 2, "{found:?}");
    }

    #[test]
    fn a_flipped_bit_is_noticed(data in nasty(40), place in any::<prop::sample::Index>(), bit in 0..8_u32) {
        let mut made = answer::status(Id::servo(5).unwrap(), 0, &data).unwrap();
        let place = place.index(made.len());
        made[place] ^= 1 << bit;
        let mut receiver = Receiver::default();
        receiver.hear(&made);
        let mut packets = usize::from(receiver.next_packet().is_some());
        receiver.line_is_quiet();
        packets += usize::from(receiver.next_packet().is_some());
        prop_assert_eq!(packets, 0);
        let counters = receiver.counters();
        prop_assert!(counters.strays > 0);
    }

    #[test]
    fn noise_never_panics(noise in prop::collection::vec(any::<u8>(), 0..600), cuts in prop::collection::vec(1..300_usize, 0..9)) {
        for (id, instruction, parameters) in heard(&mut Receiver::default(), &noise, &cuts) {
            let packet = vergence_dynamixel::Packet { id, instruction, parameters: &parameters };
            let _ = (Instruction::of(&packet), Status::of(&packet), FastBlocks::of(&packet, &[(id, 4)]).map(Iterator::count));
        }
    }

    #[test]
    fn any_parameters_are_an_instruction_or_refused(instruction in any::<u8>(), parameters in nasty(60)) {
        let packet = vergence_dynamixel::Packet { id: Id::BROADCAST, instruction, parameters: &parameters };
        if let Ok(read) = Instruction::of(&packet) {
            let sync: usize = read.sync_items().map(|item| item.data.len() + 1).sum();
            let writes: usize = read.bulk_writes().map(|item| item.data.len() + 5).sum();
            let reads = 5 * read.bulk_reads().count();
            let expected = match instruction { 0x83 => parameters.len() - 4, 0x92 | 0x93 | 0x9A => parameters.len(), _ => 0 };
            prop_assert_eq!(sync + writes + reads, expected);
        } else {
            prop_assert!(!matches!(Instruction::of(&packet), Err(Malformed::IsStatus)) || instruction == 0x55);
        }
    }

    #[test]
    fn combined_answers_of_any_data_are_taken_apart(blocks in prop::collection::vec((servo(), nasty(20)), 1..6)) {
        let lengths: Vec<u16> = blocks.iter().map(|(_, data)| u16::try_from(data.len()).unwrap()).collect();
        let mut wire = Vec::new();
        for (place, (id, data)) in blocks.iter().enumerate() {
            let part = FastPart { lengths: &lengths, place, before: &wire.clone(), id: *id, error: 0x80, data };
            wire.extend_from_slice(&part.encode().unwrap());
        }
        let expected: Vec<_> = blocks.iter().zip(&lengths).map(|((id, _), length)| (*id, *length)).collect();
        let mut receiver = Receiver::default();
        receiver.hear(&wire);
        let packet = receiver.next_packet().unwrap();
        for (block, (id, data)) in FastBlocks::of(&packet, &expected).unwrap().zip(&blocks) {
            let block = block.unwrap();
            prop_assert_eq!((block.id, block.data, block.alert), (*id, &data[..], true));
        }
    }

    #[test]
    fn positions_come_back_from_microradians(counts in -1_048_575..1_048_575_i32) {
        prop_assert_eq!(Position::of_microradians(Position(counts).microradians()), Some(Position(counts)));
    }
}

#[test]
fn items_come_back() {
    let item = |id, address, data| BulkItem { id, address, length: 2, data };
    let items = [item(1, 100, &[1, 2][..]), item(2, 102, &[3, 4])];
    let made = encode::bulk_write(&items).unwrap();
    let mut receiver = Receiver::default();
    receiver.hear(&made);
    let packet = receiver.next_packet().unwrap();
    assert_eq!(Instruction::of(&packet).unwrap().bulk_writes().collect::<Vec<_>>(), items);
    let made = encode::fast_bulk_read(&items).unwrap();
    receiver.hear(&made);
    let packet = receiver.next_packet().unwrap();
    let expected = items.map(|item| BulkItem { data: &[], ..item });
    assert_eq!(Instruction::of(&packet).unwrap().bulk_reads().collect::<Vec<_>>(), expected);
}

#[test]
fn what_does_not_fit_is_refused() {
    let id = Id::servo(1).unwrap();
    assert!(encode::write(id, 0, &[0; MAX_PACKET - 12]).is_ok());
    assert!(encode::write(id, 0, &[0; MAX_PACKET - 11]).is_err());
    assert!(Id::servo(253).is_err() && Id::of_wire(0xFF).is_none() && Id::of_wire(0xFE) == Some(Id::BROADCAST));
}

#[test]
fn registers_stand_in_order_and_do_not_overlap() {
    for pair in table::ALL.windows(2) {
        assert!(pair[0].end() <= pair[1].address, "{} and {}", pair[0].name, pair[1].name);
    }
    assert_eq!(table::ALL.last().unwrap().end(), 148);
    let addresses = [1, 28, 29, 56].map(|number| table::indirect_address(number).unwrap().address);
    let data = [1, 28, 29, 56].map(|number| table::indirect_data(number).unwrap().address);
    assert_eq!((addresses, data), ([168, 222, 578, 632], [224, 251, 634, 661]), "as the manual lists them");
    assert_eq!(table::indirect_data(57), None);
    assert_eq!(table::indirect_data(56).unwrap().end(), table::TABLE_BYTES);
}

#[test]
fn units_are_those_of_the_manual() {
    assert_eq!(Position(1024).microradians(), 1_570_796);
    assert_eq!(Position(-2048).microradians(), -3_141_593);
    // 0.229 rev/min are 0.0239808 rad/s.
    assert_eq!(Velocity(1_000).microradians_per_second(), 23_980_824);
    assert_eq!(Baud::of_register(3).unwrap().bits_per_second(), 1_000_000);
    assert!(Baud::of_register(8).is_err());
    assert_eq!((BusWatchdog(5).milliseconds(), BusWatchdog::BITTEN.milliseconds()), (Some(100), None));
    assert_eq!(vergence_dynamixel::units::Acceleration(1_000).microradians_per_second_squared(), 374_507_515);
}
