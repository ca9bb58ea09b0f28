//! `docs/protocol.md` shows the bytes and figures that the crate really uses.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

use vergence_protocol::frame::{Header, Kind, encode};
use vergence_protocol::management::CHUNK;
use vergence_protocol::{
    AxisList, LOG_CHUNK, MAX_FRAME, Micro, Mode, Move, MoveId, PROTOCOL, Permille, Request, WINDOW,
};

const PAGE: &str = include_str!("../../docs/protocol.md");

/// The text from the heading `## title` to the next heading.
fn section(title: &str) -> &'static str {
    let (_, after) = PAGE.split_once(&format!("## {title}\n")).unwrap_or_else(|| panic!("no section '{title}'"));
    after.split("\n## ").next().unwrap()
}

/// The cells of each table row of `text` that begins with a code span.
fn rows(text: &str) -> impl Iterator<Item = Vec<&str>> {
    text.lines()
        .filter(|line| line.starts_with("| `"))
        .map(|line| line.trim_matches('|').split('|').map(str::trim).collect())
}

fn bytes(cell: &str) -> Vec<u8> {
    let digits = cell.trim_matches('`').split_whitespace();
    digits.map(|byte| u8::from_str_radix(byte, 16).expect("hexadecimal bytes")).collect()
}

#[test]
fn the_example_shows_the_bytes_of_a_move() {
    let targets = AxisList::from_iter([Micro(65_000), Micro(-1_200)]);
    let request = Request::MoveTo(Move { id: MoveId(300), mode: Mode(2), targets, speed: Permille::FULL });
    let header = Header { major: PROTOCOL.major, kind: Kind::Control, seq: 255, ack: 0 };
    let mut buffer = [0; MAX_FRAME];
    let length = encode(header, &request, &mut buffer).unwrap();
    let (wire, mut packet) = (buffer[..length].to_vec(), [0; MAX_FRAME]);
    let example: Vec<Vec<&str>> = rows(section("One MoveTo, byte by byte")).collect();
    let column = |index: usize| example.iter().flat_map(|cells| bytes(cells[index])).collect::<Vec<u8>>();
    assert_eq!(column(0), wire, "the first column is the frame: {wire:02x?}");
    let packet_length = cobs::decode(&wire[..length - 1], &mut packet).unwrap().frame_size();
    assert_eq!(column(1), packet[..packet_length], "the second column is the packet before COBS");
}

#[test]
fn the_figures_are_those_of_the_crate() {
    assert!(PAGE.contains(&format!("Protocol version: {}.{}.", PROTOCOL.major, PROTOCOL.minor)));
    assert!(section("Frame").contains(&format!("The longest frame takes {MAX_FRAME} bytes.")));
    assert!(section("Frame").contains(&format!("| Log | 2 | up to {LOG_CHUNK} bytes of the board's log |")));
    assert!(section("Session").contains(&format!("At most {WINDOW}\n   may be unanswered.")));
    let update = section("Firmware update");
    assert!(update.contains(&format!("`Chunk`s of up to {CHUNK} bytes follow, up to {WINDOW} ahead of the answers")));
}

#[test]
fn every_kind_of_frame_is_listed_with_its_number() {
    let kinds = [Kind::Control, Kind::Telemetry, Kind::Log, Kind::Firmware, Kind::Immediate, Kind::AckOnly, Kind::Nak];
    for kind in kinds {
        let number = kind as u8;
        let rows = [format!("| {kind:?} | {number} | "), format!("| {kind:?} | {number:#x} | ")];
        assert!(rows.iter().any(|row| section("Frame").contains(row)), "{rows:?}");
    }
}
