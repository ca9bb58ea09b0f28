//! Updates of the board's own firmware: boot loader and application on the simulated chip, and what 'vergence flash
//! --serial' does, over a pipe in virtual time. Bad applications are the real one with a few instructions replaced.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

#[path = "elf_rig/build.rs"]
mod build;
mod common;
#[path = "elf_rig/variants.rs"]
mod variants;

use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};

use common::images::Workshop;
use tokio::io::{AsyncReadExt, AsyncWriteExt, DuplexStream};
use vergence::sim::{SimulatedChip, simulated_chip};
use vergence_board::{FirmwareImage, ManagementLink, OpenWire, Shared, UpdateError, Updated, spawn_in_process, update};
use vergence_image::layout::ACTIVE;
use vergence_mcu::ResetCause;
use vergence_protocol::management::{BootState, Identity, Management, Outcome, RebootTo};
use vergence_rig::{BENCH_TOML, Rig};

use variants::Variant;

/// A board, its host, and a folder for images.
struct Story {
    workshop: Workshop,
    board: Shared<SimulatedChip>,
    link: ManagementLink,
}

impl Story {
    /// The boot loader and version 1.0.0 of a variant.
    async fn of(installed: Variant) -> Self {
        let workshop = Workshop::new();
        let image = sign(&workshop, installed, [1, 0, 0]);
        Self::with(workshop, &image).await
    }

    async fn with(workshop: Workshop, installed: &str) -> Self {
        let rig = Rig::from_toml(BENCH_TOML).expect("the bench is a rig");
        static BOOT_LOADER: OnceLock<PathBuf> = OnceLock::new();
        let boot_loader = BOOT_LOADER.get_or_init(|| build::build("vergence-bootloader")).clone();
        let board = Shared::new(simulated_chip(&[boot_loader, installed.into()], &rig, 1).expect("a board"));
        let wire = board.clone();
        let link = ManagementLink::in_process(move || OpenWire::in_process(spawn_in_process(wire.clone()))).await;
        Self { workshop, board, link: link.expect("a link") }
    }

    async fn flash(&mut self, variant: Variant, version: [u8; 3]) -> Result<Updated, UpdateError> {
        let image = sign(&self.workshop, variant, version);
        self.flash_file(&image).await
    }

    async fn flash_file(&mut self, image: &str) -> Result<Updated, UpdateError> {
        let image = FirmwareImage::read(image.as_ref()).expect("an image");
        update(&image, true, &mut self.link, |_| {}).await
    }

    async fn runs(&mut self) -> ([u8; 3], BootState) {
        let Identity { version, boot, .. } = self.link.identify().await.expect("somebody answers");
        (version, boot)
    }

    /// Waits until the boot loader has given up and waits for an image.
    async fn reach_recovery(&mut self) {
        let patience = std::time::Duration::from_secs(20);
        let identity = self.link.identify_within(patience).await.expect("the recovery answers");
        assert_eq!(identity.boot, BootState::Recovery);
    }

    /// Whatever the board is in, a good image gets it out.
    async fn is_saved(&mut self) {
        self.flash(Variant::Good, [3, 0, 0]).await.expect("a board can always be flashed");
        assert_eq!(self.runs().await, ([3, 0, 0], BootState::Confirmed));
    }
}

fn sign(workshop: &Workshop, variant: Variant, version: [u8; 3]) -> String {
    let text = version.map(|part| part.to_string()).join(".");
    let name = format!("{variant:?}-{text}.vimg");
    workshop.sign(&variants::image(variant, version), "development", "nucleo-g474", &text, &name).0
}

#[tokio::test(start_paused = true)]
async fn from_old_to_new_and_back() {
    let mut story = Story::of(Variant::Good).await;
    let there = story.flash(Variant::Good, [1, 2, 0]).await.expect("an update");
    assert_eq!((there.before.version, there.after.version), ([1, 0, 0], [1, 2, 0]));
    assert_eq!((there.after.boot, there.sent_from), (BootState::Confirmed, 0));
    let back = story.flash(Variant::Good, [1, 1, 0]).await.expect("an older one is not too old");
    assert_eq!((back.before.version, back.after.version), ([1, 2, 0], [1, 1, 0]));
    // One reset for each swap.
    assert_eq!(story.board.lock().machine().resets(), 2);
}

#[tokio::test(start_paused = true)]
async fn what_must_not_run_is_refused_by_the_board_itself() {
    let mut story = Story::of(Variant::Good).await;
    let [stranger, _] = story.workshop.key("stranger.key");
    let good = variants::image(Variant::Good, [1, 1, 0]);
    let (unknown, _) = story.workshop.sign(&good, &stranger, "nucleo-g474", "1.1.0", "unknown.vimg");
    let refused = story.flash_file(&unknown).await.expect_err("a stranger signed it").to_string();
    assert!(refused.contains("not signed with a key the board trusts"), "{refused}");

    let header = *FirmwareImage::read(unknown.as_ref()).expect("an image").header();
    for (header, outcome) in [
        (vergence_protocol::management::ImageHeader { hardware: 7, ..header }, Outcome::WrongHardware),
        (vergence_protocol::management::ImageHeader { version: [0, 0, 9], ..header }, Outcome::TooOld),
    ] {
        assert_eq!(story.link.ask(&Management::Begin(header)).await.expect("an answer"), outcome);
    }
    let old = story.flash(Variant::Good, [0, 0, 9]).await.expect_err("too old").to_string();
    assert!(old.contains("accepts 0.1.0 and newer"), "{old}");
    let (other, _) = story.workshop.sign(&[1; 64], "development", "native-sim", "1.1.0", "other.vimg");
    let other = story.flash_file(&other).await.expect_err("other hardware").to_string();
    assert!(other.contains("for native-sim, the board is nucleo-g474"), "{other}");
    assert_eq!(story.runs().await, ([1, 0, 0], BootState::Confirmed));
    assert_eq!(story.board.lock().machine().resets(), 0);
}

/// Carries so many bytes of the host, then ends.
async fn carry(mut host: DuplexStream, mut board: DuplexStream, mut bytes: usize) {
    let (mut up, mut down) = ([0; 256], [0; 256]);
    while bytes > 0 {
        tokio::select! {
            read = host.read(&mut up) => {
                let length = read.unwrap_or(0).min(bytes);
                bytes -= length;
                if length == 0 || board.write_all(&up[..length]).await.is_err() {
                    return;
                }
            }
            read = board.read(&mut down) => {
                let length = read.unwrap_or(0);
                if length == 0 || host.write_all(&down[..length]).await.is_err() {
                    return;
                }
            }
        }
    }
}

#[tokio::test(start_paused = true)]
async fn an_update_goes_on_after_the_link_was_cut() {
    let mut story = Story::of(Variant::Good).await;
    let (board, opened) = (story.board.clone(), Arc::new(AtomicUsize::new(0)));
    let count = opened.clone();
    story.link = ManagementLink::in_process(move || {
        let bytes = [30_000, 40_000].get(count.fetch_add(1, Ordering::Relaxed)).copied().unwrap_or(usize::MAX);
        let (host, ours) = tokio::io::duplex(1 << 16);
        tokio::spawn(carry(ours, spawn_in_process(board.clone()), bytes));
        OpenWire::in_process(host)
    })
    .await
    .expect("a link");
    let said = story.flash(Variant::Good, [1, 1, 0]).await.expect("an update");
    assert_eq!((said.link_losses, said.after.version), (2, [1, 1, 0]));
    assert_eq!(opened.load(Ordering::Relaxed), 3);
}

#[tokio::test(start_paused = true)]
async fn an_image_that_hangs_or_panics_on_trial_goes_back() {
    for (variant, cause) in [
        (Variant::HangsAtStart, ResetCause::Watchdog),
        (Variant::HangsWhenItRuns, ResetCause::Watchdog),
        (Variant::PanicsAtStart, ResetCause::Software),
        (Variant::StackTooSmall, ResetCause::Watchdog),
    ] {
        let mut story = Story::of(Variant::Good).await;
        let failed = story.flash(variant, [2, 0, 0]).await.expect_err("it must not stay").to_string();
        println!("{variant:?}: {failed}");
        assert_eq!(story.runs().await, ([1, 0, 0], BootState::Reverted), "{variant:?}");
        assert_eq!(story.board.lock().machine().last_reset(), cause, "{variant:?}");
        story.is_saved().await;
    }
}

#[tokio::test(start_paused = true)]
async fn an_image_that_hangs_or_panics_at_every_start_ends_in_recovery() {
    for variant in [Variant::HangsAtStart, Variant::PanicsAtStart, Variant::BadVectors] {
        let mut story = Story::of(variant).await;
        story.reach_recovery().await;
        println!("{variant:?}: recovery after {} resets", story.board.lock().machine().resets());
        story.is_saved().await;
    }
}

/// Offset in flash up to which the half-written image reaches.
const HALF: u32 = 0x1_8000;

#[tokio::test(start_paused = true)]
async fn a_half_written_image_is_not_started() {
    let workshop = Workshop::new();
    let image = sign(&workshop, Variant::Good, [1, 0, 0]);
    let mut story = Story::with(workshop, &image).await;
    {
        // As an interrupted debug probe leaves it.
        let mut board = story.board.lock();
        let rest = vec![0xFF; (ACTIVE.end() - HALF) as usize];
        assert!(board.machine().chip_mut().load_flash(HALF as usize, &rest));
        board.machine().power_on();
    }
    story.reach_recovery().await;
    assert_eq!(story.link.ask(&Management::Rollback).await.expect("an answer"), Outcome::NothingToRollBack);
    story.is_saved().await;
}

#[tokio::test(start_paused = true)]
async fn recovery_is_left_and_entered_as_the_host_asks() {
    let mut story = Story::of(Variant::Good).await;
    assert_eq!(story.runs().await, ([1, 0, 0], BootState::Confirmed));
    for (to, boot) in [(RebootTo::Recovery, BootState::Recovery), (RebootTo::Application, BootState::Confirmed)] {
        assert_eq!(story.link.ask_once(&Management::Reboot(to)).await.expect("a link"), Some(Outcome::Done));
        tokio::time::sleep(std::time::Duration::from_secs(1)).await;
        assert_eq!(story.runs().await.1, boot);
    }
}
