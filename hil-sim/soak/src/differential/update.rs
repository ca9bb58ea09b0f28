//! Updates of both boards: the same image, with a header for the hardware of each.

use vergence_image::layout::HARDWARE;
use vergence_image::sha256;
use vergence_plant::NATIVE_HARDWARE;
use vergence_protocol::frame::Kind;
use vergence_protocol::management::{CHUNK, ImageHeader, Management, RebootTo, Signature};
use vergence_protocol::{Request, SessionId};

use super::difference::Difference;
use super::driver::{Driver, framed};
use super::session::Fate;
use super::side::Stream;

/// Ticks for a management request that is not waited for: a page is erased, or a signature checked.
const UPDATE_TICKS: u64 = 60;
/// Longest wait in ticks for the answers of both boards: the digest and the signature of a whole image are checked.
const ANSWER_TICKS: u64 = 2_000;
/// Telemetry after a restart, in microseconds.
const PERIOD_US: u32 = 5_000;

impl Driver<'_> {
    /// Sends an image whose signature is not good, asks for this and that, and lets the boards restart.
    pub(super) fn refused_update(&mut self, image: &[u8]) -> Result<(), Difference> {
        let length = u32::try_from(image.len()).unwrap_or(u32::MAX);
        let header = ImageHeader { version: [9, 0, 0], length, sha256: sha256(image), ..ImageHeader::default() };
        let begin = [NATIVE_HARDWARE, HARDWARE].map(|hardware| Management::Begin(ImageHeader { hardware, ..header }));
        let mut requests = vec![both(Management::Identify), both(Management::Begin(header)), begin];
        requests.extend(chunks(image).map(both));
        requests.push(both(Management::Commit(Signature { r: [1; 32], s: [2; 32] })));
        requests.push(both(Management::Rollback));
        for request in &requests {
            self.manage(request);
            self.wait(UPDATE_TICKS)?;
        }
        self.reboot()
    }

    /// Sends the next image, which both boards accept and start on trial; then `fate`.
    pub(super) fn install(&mut self, fate: Fate) -> Result<(), Difference> {
        let next = self.next;
        self.managed(&both(Management::Identify))?;
        self.managed(&next.seals.map(|seal| Management::Begin(seal.header)))?;
        for chunk in chunks(&next.bytes) {
            self.managed(&both(chunk))?;
        }
        self.managed(&next.seals.map(|seal| Management::Commit(seal.signature)))?;
        self.reboot()?;
        self.look_around()?;
        if fate != Fate::Reverted {
            self.managed(&both(Management::Confirm))?;
            self.look_around()?;
        }
        if fate == Fate::RolledBack {
            self.managed(&both(Management::Rollback))?;
        }
        if fate != Fate::Kept {
            self.reboot()?;
            self.look_around()?;
        }
        Ok(())
    }

    /// Opens a session, asks which program runs, and whether it may move.
    fn look_around(&mut self) -> Result<(), Difference> {
        self.connect(PERIOD_US)?;
        self.managed(&both(Management::Identify))?;
        self.ask(&Request::Arm { session: SessionId(0) });
        self.wait(UPDATE_TICKS)
    }

    /// Lets both boards restart by themselves; they do not where the drivers are on.
    fn reboot(&mut self) -> Result<(), Difference> {
        let resets = self.pair.resets();
        self.manage(&both(Management::Reboot(RebootTo::Application)));
        for _ in 0..UPDATE_TICKS {
            self.wait(1)?;
            if self.pair.resets() != resets {
                (self.open, self.boots) = (false, self.boots + 1);
                self.waiting.clear();
                return self.started(|pair, boot| pair.follow_reboot(boot));
            }
        }
        Ok(())
    }

    fn manage(&mut self, requests: &[Management; 2]) {
        let seq = self.management;
        self.management = self.management.wrapping_add(1);
        self.waiting.push_back([0, 1].map(|side| framed(Kind::Firmware, seq, &requests[side])));
    }

    /// Makes a request and waits for both answers.
    fn managed(&mut self, requests: &[Management; 2]) -> Result<(), Difference> {
        let answers = |driver: &Self| [0, 1].map(|side: usize| driver.pair.sides[side].count(Stream::Management));
        let before = answers(self);
        self.manage(requests);
        for _ in 0..ANSWER_TICKS {
            self.wait(1)?;
            if answers(self).iter().zip(before).all(|(now, before)| *now > before) {
                return Ok(());
            }
        }
        Err(Difference::new(format!("an answer to {:?}", requests[0]), answers(self)[0], answers(self)[1]))
    }
}

fn both(request: Management) -> [Management; 2] {
    [request.clone(), request]
}

/// The bytes of an image as they are sent, filled up to whole units of the flash.
fn chunks(image: &[u8]) -> impl Iterator<Item = Management> {
    image.chunks(CHUNK).enumerate().map(|(index, bytes)| {
        let mut data: heapless::Vec<u8, CHUNK> = bytes.iter().copied().collect();
        let _ = data.resize(bytes.len().next_multiple_of(8), 0xFF);
        Management::Chunk { offset: (index * CHUNK) as u32, data }
    })
}
