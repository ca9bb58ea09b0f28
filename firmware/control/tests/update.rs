//! Firmware updates over the link: a native board, a host and a line that loses what it likes.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panic")]

mod update_bench;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_control::{Flash, PAGE};
use vergence_plant::{Cut, NATIVE_HARDWARE};
use vergence_protocol::management::{
    BootState, CHUNK, Identity, ImageHeader, Management, ManagementReport, Outcome, RebootTo, Signature,
};
use vergence_protocol::update::{Upload, UploadState};
use vergence_protocol::{ControllerState, HostSession, PROTOCOL, Refusal, Request, SessionId, Status};

use update_bench::{Bench, SEED, image, sign};

#[test]
fn a_host_of_another_major_can_ask_who_it_is_and_update_it() {
    let (bytes, header, signature) = image(10_000, 30);
    let mut bench = Bench::new(0.05, 30);
    bench.foreign = Some(PROTOCOL.major + 3);
    let mut upload = Upload::new(&bytes, header, signature).unwrap();
    assert_eq!(bench.run(&mut upload, 60_000_000), UploadState::Done);
    assert_eq!(bench.manage(Management::Reboot(RebootTo::Application)).1, Outcome::Done);
    bench.restart();
    assert_eq!(bench.manage(Management::Confirm).1, Outcome::Done);
    bench.loss = 0.0;
    bench.host.manage(Management::Identify).unwrap();
    bench.wait(10_000);
    let identity = Identity {
        hardware: NATIVE_HARDWARE,
        version: header.version,
        oldest: [0, 0, 0],
        build: 30,
        boot: BootState::Confirmed,
        capacity: 92 * PAGE as u32,
    };
    assert_eq!(bench.answers, [ManagementReport::Identity(identity)]);
}

#[test]
fn an_update_needs_no_session_and_starts_on_trial() {
    let (bytes, header, signature) = image(20_001, 1);
    let mut bench = Bench::new(0.0, 1);
    let mut upload = Upload::new(&bytes, header, signature).unwrap();
    assert_eq!(bench.run(&mut upload, 60_000_000), UploadState::Done);
    assert!(bench.holds(&bytes));
    assert_eq!(upload.progress(), (20_001, 20_001));
    assert_eq!(bench.manage(Management::Reboot(RebootTo::Application)).1, Outcome::Done);
    assert_eq!(bench.board.take_reboot(), Some(RebootTo::Application));
    assert_eq!(bench.board.take_reboot(), None, "once");

    bench.restart();
    let services = bench.board.services_mut();
    assert_eq!((services.boot_state, services.running.version), (BootState::Trial, header.version));
    assert_eq!(bench.board.state(), ControllerState::Trial);
    assert_eq!(bench.manage(Management::Begin(header)).1, Outcome::Busy, "not while one is on trial");
    assert_eq!(bench.manage(Management::Confirm).1, Outcome::Done);
    assert_eq!(bench.board.state(), ControllerState::Idle);
    bench.restart();
    assert_eq!(bench.board.services_mut().boot_state, BootState::Confirmed);
}

#[test]
fn an_image_that_nobody_confirms_goes_back_and_so_does_one_on_request() {
    let (bytes, header, signature) = image(3_000, 2);
    let mut bench = Bench::new(0.0, 2);
    assert_eq!(bench.manage(Management::Rollback).1, Outcome::NothingToRollBack);
    assert_eq!(bench.run(&mut Upload::new(&bytes, header, signature).unwrap(), 60_000_000), UploadState::Done);
    bench.restart();
    bench.restart();
    assert_eq!(bench.board.services_mut().boot_state, BootState::Reverted);
    assert_eq!(bench.board.state(), ControllerState::Idle);

    assert_eq!(bench.run(&mut Upload::new(&bytes, header, signature).unwrap(), 60_000_000), UploadState::Done);
    bench.restart();
    assert_eq!(bench.manage(Management::Confirm).1, Outcome::Done);
    assert_eq!(bench.manage(Management::Rollback).1, Outcome::Done);
    bench.restart();
    let services = bench.board.services_mut();
    assert_eq!((services.boot_state, services.running.build), (BootState::Reverted, 0));
}

#[test]
fn through_losses_of_a_third_the_image_arrives_whole() {
    let (bytes, header, signature) = image(20_480, 3);
    for (seed, loss) in [(1, 0.02), (2, 0.1), (3, 0.33)] {
        let mut bench = Bench::new(loss, seed);
        let mut upload = Upload::new(&bytes, header, signature).unwrap();
        assert_eq!(bench.run(&mut upload, 600_000_000), UploadState::Done, "loss {loss}: {:?}", upload.progress());
        assert!(bench.holds(&bytes));
    }
}

#[test]
fn on_a_clean_line_every_byte_goes_once() {
    let (bytes, header, signature) = image(40_000, 4);
    let mut bench = Bench::new(0.0, 4);
    // The flash holds an old image and is erased page by page.
    bench.board.services_mut().image.overwrite(0, &[0x55; 41_000]);
    bench.run(&mut Upload::new(&bytes, header, signature).unwrap(), 60_000_000);
    let chunks = bytes.len().div_ceil(CHUNK) as u32;
    assert_eq!(bench.host.statistics().sent, chunks + 2, "begin, chunks, commit");
}

#[test]
fn an_update_cut_anywhere_goes_on_at_the_first_page_that_differs() {
    let (bytes, header, signature) = image(5 * PAGE + 300, 5);
    let whole = {
        let mut bench = Bench::new(0.0, 5);
        assert_eq!(bench.run(&mut Upload::new(&bytes, header, signature).unwrap(), 60_000_000), UploadState::Done);
        bench.written()
    };
    for how in [Cut::Clean, Cut::Torn] {
        for cut in (1..whole).step_by(37) {
            let mut bench = Bench::new(0.0, 5);
            bench.board.services_mut().image.cut_after(cut, how, cut as u64);
            let mut upload = Upload::new(&bytes, header, signature).unwrap();
            assert_eq!(bench.run(&mut upload, 60_000_000), UploadState::Failed(Outcome::FlashFailed));
            bench.board.services_mut().image.power_on();
            bench.restart();
            assert_eq!(bench.board.services_mut().boot_state, BootState::Confirmed, "the old image runs");
            let before = bench.written();
            let mut again = Upload::new(&bytes, header, signature).unwrap();
            assert_eq!(bench.run(&mut again, 60_000_000), UploadState::Done, "{how:?} at {cut}");
            assert!(bench.holds(&bytes));
            let (left, page) = (whole - cut, PAGE / 8 + 1);
            let rewritten = bench.written() - before;
            assert!(rewritten <= left + 2 * page, "{how:?} at {cut}: {rewritten} operations for {left}");
        }
    }
}

#[test]
fn a_host_that_comes_back_goes_on_where_the_board_is() {
    let (bytes, header, signature) = image(40_000, 6);
    let mut bench = Bench::new(0.0, 6);
    // An old image: no page is taken for erased that is not.
    bench.board.services_mut().image.overwrite(0, &[0x55; 41_000]);
    let mut upload = Upload::new(&bytes, header, signature).unwrap();
    bench.run(&mut upload, 10_000);
    let (stored, _) = upload.progress();
    assert!(stored > 5_000 && stored < 40_000, "{stored}");
    bench.wait(3_000_000);
    bench.host = HostSession::new(SessionId(9));
    upload.resume();
    assert_eq!(bench.run(&mut upload, 60_000_000), UploadState::Done);
    let chunks = (40_000 - stored).div_ceil(CHUNK as u32);
    let sent = bench.host.statistics().sent;
    assert!(sent <= chunks + 2 + 4, "{sent} for {chunks}: no more than what was under way is sent again");
}

#[test]
fn a_board_that_restarts_in_mid_update_is_asked_again() {
    let (bytes, header, signature) = image(30_000, 7);
    let mut bench = Bench::new(0.0, 7);
    let mut upload = Upload::new(&bytes, header, signature).unwrap();
    bench.run(&mut upload, 5_000);
    assert_eq!(upload.state(), UploadState::Sending);
    bench.restart();
    assert_eq!(bench.run(&mut upload, 60_000_000), UploadState::Done);
    assert!(bench.holds(&bytes));
}

#[test]
fn nothing_moves_and_no_setting_changes_while_an_image_is_taken() {
    let (_, header, _) = image(30_000, 8);
    let mut bench = Bench::new(0.0, 8);
    bench.open(5);
    assert_eq!(bench.manage(Management::Begin(header)), (0, Outcome::Done));
    assert_eq!(bench.board.state(), ControllerState::Updating);
    bench.host.send_now(Request::Heartbeat { session: SessionId(5), lease_ms: 1000 }).unwrap();
    let arm = Request::Arm { session: SessionId(5) };
    assert_eq!(bench.ask(arm.clone()), Status::Refused(Refusal::Updating));
    assert_eq!(bench.ask(Request::SaveSettings), Status::Refused(Refusal::Updating));
    bench.wait(11_000_000);
    assert_eq!(bench.board.state(), ControllerState::Idle, "the host has gone");
    bench.host.send_now(Request::Heartbeat { session: SessionId(5), lease_ms: 1000 }).unwrap();
    assert_eq!(bench.ask(arm), Status::Accepted);
    for request in [Management::Begin(header), Management::Rollback, Management::Reboot(RebootTo::Recovery)] {
        assert_eq!(bench.manage(request).1, Outcome::Busy, "not while armed");
    }
    assert_eq!(bench.board.take_reboot(), None);
}

#[test]
fn an_image_that_is_not_for_this_board_is_refused_before_anything_is_written() {
    let (_, good, _) = image(3_000, 9);
    let mut bench = Bench::new(0.0, 9);
    let capacity = bench.board.services_mut().image.pages() * PAGE;
    let refused = [
        (ImageHeader { hardware: good.hardware + 1, ..good }, Outcome::WrongHardware),
        (ImageHeader { length: capacity as u32 + 1, ..good }, Outcome::WrongLength),
        (ImageHeader { length: u32::MAX, ..good }, Outcome::WrongLength),
        (ImageHeader { length: 0, ..good }, Outcome::WrongLength),
    ];
    for (header, outcome) in refused {
        assert_eq!(bench.manage(Management::Begin(header)), (0, outcome));
        assert_eq!(bench.board.state(), ControllerState::Idle);
        let chunk = Management::Chunk { offset: 0, data: heapless::Vec::from_slice(&[1; 8]).unwrap() };
        assert_eq!(bench.manage(chunk), (0, Outcome::NotBegun));
    }
    assert_eq!(bench.written(), 0);
}

#[test]
fn an_image_older_than_the_oldest_is_refused() {
    let (_, header, _) = image(3_000, 10);
    let mut bench = Bench::new(0.0, 10);
    bench.board.services_mut().oldest = [1, 2, 4];
    bench.restart();
    assert_eq!(bench.manage(Management::Begin(header)).1, Outcome::TooOld);
    let newer = ImageHeader { version: [1, 2, 4], ..header };
    assert_eq!(bench.manage(Management::Begin(newer)).1, Outcome::Done);
}

#[test]
fn a_signature_of_another_key_or_another_header_is_refused() {
    let (bytes, header, signature) = image(3_000, 11);
    let wrong = [
        sign(&header, &[8; 32]),
        sign(&ImageHeader { build: 99, ..header }, &SEED),
        sign(&ImageHeader { version: [9, 9, 9], ..header }, &SEED),
        Signature { s: [0; 32], ..signature },
    ];
    for wrong in wrong {
        let mut bench = Bench::new(0.0, 11);
        let mut upload = Upload::new(&bytes, header, wrong).unwrap();
        assert_eq!(bench.run(&mut upload, 60_000_000), UploadState::Failed(Outcome::WrongSignature));
        bench.restart();
        assert_eq!(bench.board.services_mut().boot_state, BootState::Confirmed);
        // The bytes are good: with the right signature they are taken at once.
        let mut right = Upload::new(&bytes, header, signature).unwrap();
        assert_eq!(bench.run(&mut right, 60_000_000), UploadState::Done);
    }
}

#[test]
fn bytes_that_are_not_those_of_the_digest_are_refused() {
    let (mut bytes, header, signature) = image(3_000, 12);
    bytes[1_234] ^= 1;
    let mut bench = Bench::new(0.0, 12);
    let mut upload = Upload::new(&bytes, header, signature).unwrap();
    assert_eq!(bench.run(&mut upload, 60_000_000), UploadState::Failed(Outcome::WrongDigest));
    bytes[1_234] ^= 1;
    let before = bench.written();
    let mut right = Upload::new(&bytes, header, signature).unwrap();
    assert_eq!(bench.run(&mut right, 60_000_000), UploadState::Done);
    assert!(bench.written() - before <= PAGE / 8 + 1, "only the page that differed");
}

#[test]
fn what_waits_for_the_reboot_is_not_overwritten() {
    let (bytes, header, signature) = image(3_000, 13);
    let (_, other, _) = image(4_000, 14);
    let mut bench = Bench::new(0.0, 13);
    bench.run(&mut Upload::new(&bytes, header, signature).unwrap(), 60_000_000);
    assert_eq!(bench.manage(Management::Begin(other)).1, Outcome::Busy);
    let chunk = Management::Chunk { offset: 0, data: heapless::Vec::from_slice(&[1; 8]).unwrap() };
    assert_eq!(bench.manage(chunk), (3_000, Outcome::Done), "a late duplicate does nothing");
    assert_eq!(bench.manage(Management::Commit(signature)).1, Outcome::Done, "asked twice, answered twice");
    assert!(bench.holds(&bytes));
}

#[test]
fn chunks_that_do_not_fit_are_refused_and_gaps_are_told() {
    let (_, header, signature) = image(3_004, 15);
    let mut bench = Bench::new(0.0, 15);
    let chunk = |offset, length| Management::Chunk { offset, data: (0..length).map(|_| 9).collect() };
    assert_eq!(bench.manage(chunk(0, 8)), (0, Outcome::NotBegun));
    bench.manage(Management::Begin(header));
    assert_eq!(bench.manage(Management::Commit(signature)), (0, Outcome::Missing));
    assert_eq!(bench.manage(chunk(8, 8)), (0, Outcome::Missing));
    for (offset, length) in [(4, 8), (0, 7), (3_008, 8), (3_000, 16), (u32::MAX - 7, 8), (u32::MAX, 224)] {
        assert_eq!(bench.manage(chunk(offset, length)), (0, Outcome::WrongLength), "{length} at {offset}");
    }
    assert_eq!(bench.manage(chunk(0, 16)), (16, Outcome::Done));
    assert_eq!(bench.manage(chunk(8, 16)), (24, Outcome::Done), "an overlap is taken from where it is new");
    assert_eq!(bench.manage(chunk(0, 8)), (24, Outcome::Done));
    assert_eq!(bench.manage(chunk(0, 0)), (24, Outcome::Done));
}

/// Any of the requests, of two images and with nonsense among them.
fn any_request(random: &mut Pcg64Mcg, images: &[(Vec<u8>, ImageHeader, Signature); 2], next: u32) -> Management {
    let (bytes, header, signature) = &images[usize::from(random.random_bool(0.05))];
    match random.random_range(0..40) {
        0 => Management::Begin(*header),
        1 => Management::Begin(ImageHeader { length: random.random(), ..*header }),
        2 | 3 => Management::Commit(*signature),
        4 => Management::Commit(Signature { r: random.random(), ..*signature }),
        5 => Management::Rollback,
        6 => Management::Confirm,
        7 => Management::Reboot(RebootTo::Application),
        8 => {
            let data = (0..random.random_range(0..CHUNK)).map(|_| random.random()).collect();
            Management::Chunk { offset: random.random_range(0..9_000), data }
        }
        9 => Management::Identify,
        _ => {
            let offset = next.saturating_add_signed(8 * random.random_range(-3..3));
            let rest = bytes.get(offset as usize..).unwrap_or_default();
            let data = rest.iter().take(8 * random.random_range(0..=CHUNK / 8)).copied();
            Management::Chunk { offset, data: data.collect() }
        }
    }
}

#[test]
fn no_order_of_requests_starts_an_image_that_is_not_whole_and_signed() {
    let images = [image(4_096, 20), image(2_048, 21)];
    let mut started = 0;
    for seed in 0..20 {
        let mut bench = Bench::new(0.0, seed);
        let mut random = Pcg64Mcg::seed_from_u64(seed);
        let mut next = 0;
        for _ in 0..1_500 {
            if random.random_bool(0.005) {
                bench.restart();
            }
            let running = bench.board.services_mut().running;
            bench.host.manage(any_request(&mut random, &images, next)).unwrap();
            bench.step();
            bench.step();
            if let Some(ManagementReport::Progress { next: wanted, .. }) = bench.answers.pop() {
                next = wanted;
            }
            let mut boot_loader = bench.board.services_mut().clone();
            boot_loader.boot();
            if boot_loader.boot_state == BootState::Trial && boot_loader.running != running {
                let (bytes, ..) =
                    images.iter().find(|(_, header, _)| header.build == boot_loader.running.build).unwrap();
                assert!(bench.holds(bytes), "seed {seed}");
                started += 1;
            }
        }
    }
    assert!(started > 100, "{started}: some got through");
}
