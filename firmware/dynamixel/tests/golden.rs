//! Exact bytes: the examples of the manual, and packets that the maker's own library makes.
//!
//! The manual is the ROBOTIS e-manual, *DYNAMIXEL Protocol 2.0*, "Instruction Details". The library is `dynamixel-sdk` 4.1.0
//! (`pip install dynamixel-sdk`), whose port was replaced by one that keeps what is written; `tests/servo_bus.rs` of the
//! workspace runs it. The library forgets its stuffing when it sends (`txPacket` drops the list that `addStuffing` makes), so
//! stuffed packets are checked by the manual's rule and by what the library makes of them when it receives.

#![allow(clippy::unwrap_used, reason = "a test ends by panicking")]

use vergence_dynamixel::answer::{self, FastPart};
use vergence_dynamixel::{
    BulkItem, Encoded, FastBlocks, FastError, Id, Instruction, Receiver, ResetScope, Status, StatusError, crc16, encode,
};

fn id(number: u8) -> Id {
    Id::servo(number).unwrap()
}

fn bytes(hex: &str) -> Vec<u8> {
    let digits: Vec<u8> = hex.bytes().filter(|byte| !byte.is_ascii_whitespace()).collect();
    digits.chunks(2).map(|pair| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap()).collect()
}

fn same(made: impl Into<Option<Encoded>>, hex: &str) {
    assert_eq!(made.into().unwrap().as_slice(), bytes(hex).as_slice(), "expected {hex}");
}

fn read_item(id: u8, address: u16, length: u16) -> BulkItem<'static> {
    BulkItem { id, address, length, data: &[] }
}

fn write_item(id: u8, address: u16, data: &[u8]) -> BulkItem<'_> {
    BulkItem { id, address, length: u16::try_from(data.len()).unwrap(), data }
}

#[test]
fn the_crc_is_that_of_the_catalogue() {
    // CRC-16/UMTS of "123456789", and the parts of a whole.
    assert_eq!(crc16(0, b"123456789"), 0xFEE8);
    assert_eq!(crc16(crc16(0, b"1234"), b"56789"), 0xFEE8);
}

#[test]
fn instructions_as_in_the_manual() {
    same(encode::ping(id(1)).ok(), "FFFFFD00 01 0300 01 194E");
    same(encode::ping(Id::BROADCAST).ok(), "FFFFFD00 FE 0300 01 3142");
    same(encode::read(id(1), 132, 4).ok(), "FFFFFD00 01 0700 02 84000400 1D15");
    same(encode::write(id(1), 116, &512_u32.to_le_bytes()).ok(), "FFFFFD00 01 0900 03 740000020000 CA89");
    same(encode::reg_write(id(1), 104, &200_u32.to_le_bytes()).ok(), "FFFFFD00 01 0900 04 6800C8000000 AE8E");
    same(encode::action(id(1)).ok(), "FFFFFD00 01 0300 05 02CE");
    same(encode::factory_reset(id(1), ResetScope::ExceptId).ok(), "FFFFFD00 01 0400 06 01 A1E6");
    same(encode::reboot(id(1)).ok(), "FFFFFD00 01 0300 08 2F4E");
    same(encode::clear_turns(id(1)).ok(), "FFFFFD00 01 0800 10 0144584C22 B1DC");
    same(encode::sync_read(132, 4, &[id(1), id(2)]).ok(), "FFFFFD00 FE 0900 82 84000400 0102 CEFA");
    same(
        encode::sync_write(116, &[(id(1), 150_u32.to_le_bytes()), (id(2), 170_u32.to_le_bytes())]).ok(),
        "FFFFFD00 FE 1100 83 74000400 0196000000 02AA000000 8287",
    );
    same(
        encode::bulk_read(&[read_item(1, 144, 2), read_item(2, 146, 1)]).ok(),
        "FFFFFD00 FE 0D00 92 0190000200 0292000100 1A05",
    );
    same(
        encode::bulk_write(&[write_item(1, 32, &[0xA0, 0]), write_item(2, 31, &[0x50])]).ok(),
        "FFFFFD00 FE 1000 93 0120000200A000 021F00010050 B768",
    );
    same(encode::fast_sync_read(132, 4, &[id(3), id(7), id(4)]).ok(), "FFFFFD00 FE 0A00 8A 84000400 030704 20F2");
    // The manual prints the CRC of the example above here, too; this one is computed by its own table.
    same(
        encode::fast_bulk_read(&[read_item(3, 132, 4), read_item(7, 124, 2), read_item(4, 146, 1)]).ok(),
        "FFFFFD00 FE 1200 9A 0384000400 077C000200 0492000100 DA2D",
    );
}

#[test]
fn answers_as_in_the_manual() {
    same(answer::status(id(1), 0, &[0x06, 0x04, 0x26]).ok(), "FFFFFD00 01 0700 55 00 060426 655D");
    same(answer::status(id(2), 0, &[0x06, 0x04, 0x26]).ok(), "FFFFFD00 02 0700 55 00 060426 6F6D");
    same(answer::status(id(1), 0, &[0xA6, 0, 0, 0]).ok(), "FFFFFD00 01 0800 55 00 A6000000 8CC0");
    same(answer::status(id(2), 0, &2_079_u32.to_le_bytes()).ok(), "FFFFFD00 02 0800 55 00 1F080000 BABE");
    same(answer::status(id(1), 0, &[]).ok(), "FFFFFD00 01 0400 55 00 A10C");
    same(answer::status(id(1), 0, &[0x77, 0]).ok(), "FFFFFD00 01 0600 55 00 7700 C369");
    same(answer::status(id(2), 0, &[0x24]).ok(), "FFFFFD00 02 0500 55 00 24 8BA9");

    let mut receiver = Receiver::default();
    receiver.hear(&bytes("FFFFFD00 01 0700 55 00 060426 655D"));
    let packet = receiver.next_packet().unwrap();
    let status = Status::of(&packet).unwrap();
    let info = status.ping_info().unwrap();
    assert_eq!((info.model, info.firmware), (1030, 38));
}

#[test]
fn an_error_byte_has_an_alert_and_an_error() {
    let made = answer::status(id(9), 0x87, &[]).unwrap();
    let mut receiver = Receiver::default();
    receiver.hear(&made);
    let status = Status::of(&receiver.next_packet().unwrap()).unwrap();
    assert_eq!((status.alert, status.error), (true, Some(StatusError::Access)));
    for number in 1..=127 {
        assert_eq!(StatusError::of_byte(number).unwrap().number(), number);
    }
}

/// The manual's combined answer to a fast sync read of three servos.
const FAST_SYNC: &str = "FFFFFD00 FE 1900 55 0003A60000008408 00071F08000016CA 0004FF030000D19E";
/// The manual's combined answer to a fast bulk read of three servos.
const FAST_BULK: &str = "FFFFFD00 FE 1400 55 0003A600000067A4 0007A5012474 00041FD9C1";

#[test]
fn combined_answers_as_in_the_manual() {
    let sync: [(Id, u16, &[u8]); 3] =
        [(id(3), 4, &[0xA6, 0, 0, 0]), (id(7), 4, &[0x1F, 8, 0, 0]), (id(4), 4, &[0xFF, 3, 0, 0])];
    let bulk: [(Id, u16, &[u8]); 3] = [(id(3), 4, &[0xA6, 0, 0, 0]), (id(7), 2, &[0xA5, 1]), (id(4), 1, &[0x1F])];
    for (hex, blocks) in [(FAST_SYNC, sync), (FAST_BULK, bulk)] {
        let lengths = blocks.map(|(_, length, _)| length);
        let mut whole = Vec::new();
        for (place, (id, _, data)) in blocks.into_iter().enumerate() {
            let part = FastPart { lengths: &lengths, place, before: &whole.clone(), id, error: 0, data };
            whole.extend_from_slice(&part.encode().unwrap());
        }
        assert_eq!(whole, bytes(hex));
        let mut receiver = Receiver::default();
        receiver.hear(&whole);
        let expected = blocks.map(|(id, length, _)| (id, length));
        let packet = receiver.next_packet().unwrap();
        let read: Vec<_> = FastBlocks::of(&packet, &expected).unwrap().map(Result::unwrap).collect();
        assert_eq!(read.iter().map(|block| (block.id, block.data)).collect::<Vec<_>>(), blocks.map(|b| (b.0, b.2)));
        assert_eq!(Status::of(&packet).ok(), None, "no answer of one servo");
        assert_eq!(FastBlocks::of(&packet, &expected[1..]).unwrap_err(), FastError::Length);
    }
}

#[test]
fn a_block_of_another_servo_or_with_another_crc_is_told() {
    let asked = [(id(3), 4), (id(4), 4), (id(7), 4)];
    let mut receiver = Receiver::default();
    receiver.hear(&bytes(FAST_SYNC));
    let packet = receiver.next_packet().unwrap();
    let blocks: Vec<_> = FastBlocks::of(&packet, &asked).unwrap().collect();
    assert_eq!(blocks.len(), 2, "nothing is trusted behind the wrong one");
    assert_eq!(blocks[1], Err(FastError::Id { place: 1 }));

    // A wrong CRC inside, and one outside that makes up for it.
    let mut forged = bytes(FAST_SYNC);
    forged[14] ^= 1;
    let end = forged.len() - 2;
    let crc = crc16(0, &forged[..end]).to_le_bytes();
    forged[end..].copy_from_slice(&crc);
    receiver.hear(&forged);
    let packet = receiver.next_packet().unwrap();
    let asked = [(id(3), 4), (id(7), 4), (id(4), 4)];
    assert_eq!(FastBlocks::of(&packet, &asked).unwrap().next(), Some(Err(FastError::Crc { place: 0 })));
}

#[test]
fn packets_of_the_makers_library() {
    let trunk = [13, 14, 15, 16, 17].map(id);
    same(encode::ping(id(7)).ok(), "fffffd00070300011936");
    same(encode::read(id(200), 132, 4).ok(), "fffffd00c8070002840004008387");
    same(encode::reg_write(id(9), 102, &[0x12, 0x34]).ok(), "fffffd000907000466001234a8c8");
    same(encode::action(Id::BROADCAST).ok(), "fffffd00fe0300052ac2");
    same(encode::factory_reset(id(5), ResetScope::ExceptIdAndBaud).ok(), "fffffd0005040006024867");
    same(encode::reboot(id(252)).ok(), "fffffd00fc03000804ea");
    same(encode::clear_turns(id(1)).ok(), "fffffd00010800100144584c22b1dc");
    same(encode::sync_read(126, 10, &trunk).ok(), "fffffd00fe0c00827e000a000d0e0f10116248");
    same(encode::fast_sync_read(126, 10, &trunk).ok(), "fffffd00fe0c008a7e000a000d0e0f1011cbc8");
    let items = [read_item(13, 132, 4), read_item(14, 146, 1)];
    same(encode::bulk_read(&items).ok(), "fffffd00fe0d00920d840004000e92000100257e");
    same(encode::fast_bulk_read(&items).ok(), "fffffd00fe0d009a0d840004000e920001002654");
    same(
        encode::bulk_write(&[write_item(13, 116, &[1, 2, 3, 4]), write_item(14, 65, &[1])]).ok(),
        "fffffd00fe1200930d74000400010203040e4100010001d626",
    );
}

#[test]
fn what_the_library_sends_without_stuffing_is_understood() {
    let mut receiver = Receiver::default();
    receiver.hear(&bytes("fffffd00fe200083740004000d0dfffffd0e0efffffd0f0ffffffd1010fffffd1111fffffd9e31"));
    let packet = receiver.next_packet().unwrap();
    let instruction = Instruction::of(&packet).unwrap();
    let items: Vec<_> = instruction.sync_items().map(|item| (item.id, item.data.to_vec())).collect();
    assert_eq!(items, [13, 14, 15, 16, 17].map(|id| (id, vec![id, 0xFF, 0xFF, 0xFD])));
}

#[test]
fn a_fourth_byte_follows_each_header_inside() {
    // By hand from the manual's rule ("Packet Process"): length and CRC cover the stuffing.
    let made = encode::write(id(3), 116, &[0xFF, 0xFF, 0xFD, 0xFF, 0xFF, 0xFD]).unwrap();
    assert_eq!(made[5..18], bytes("0D00 03 7400 FFFFFDFD FFFFFDFD")[..]);
    assert_eq!(made[18..], crc16(0, &made[..18]).to_le_bytes());
    // FF FF FF FD and FF FF FD FD: the pattern is found behind a surplus FF, and data of FD stay.
    let data = [0xFF, 0xFF, 0xFF, 0xFD, 0xFD, 0xFF, 0xFF, 0xFD];
    let made = encode::write(id(3), 116, &data).unwrap();
    assert_eq!(made[8..20], bytes("7400 FFFFFFFDFD FD FFFFFDFD")[..]);
}
