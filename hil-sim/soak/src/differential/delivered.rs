//! What both boards are delivered with, and the image that an update brings to both.

use vergence_control::SettingsError;
use vergence_image::layout::HARDWARE;
use vergence_image::notes::{build_of, oldest_of, version_of};
use vergence_image::{DEVELOPMENT_KEY, Seal, is_signed_by, sha256};
use vergence_mcu::Firmware;
use vergence_plant::{AxisMechanics, NATIVE_HARDWARE, NativeBoard, Plant, Stage};
use vergence_protocol::ResetCause;
use vergence_protocol::management::ImageHeader;

use crate::chip_board::{ChipBoard, ChipFlash};
use crate::power_cuts::SignedImage;

/// An image that both boards accept.
#[derive(Clone, Debug)]
pub struct NextImage {
    /// The bytes for flash.
    pub(super) bytes: Vec<u8>,
    /// The seals for the hardware of the native board and of the chip.
    pub(super) seals: [Seal; 2],
}

/// The programs of both boards. The native board has its own program, under the build and the oldest version of that on the chip.
#[derive(Clone, Debug)]
pub struct Delivered {
    flash: ChipFlash,
    build: u64,
    oldest: [u8; 3],
    next: NextImage,
}

impl Delivered {
    /// Boards with this boot loader and this application, sealed by `seal` with the development key; an update leads to the
    /// application's [`twin`](crate::power_cuts::twin). `None` where they do not fit into flash.
    #[must_use]
    pub fn new(boot_loader: &Firmware, application: &Firmware, seal: impl Fn(ImageHeader) -> Seal) -> Option<Self> {
        let [image, SignedImage { bytes, .. }] = SignedImage::before_and_after(application, &seal);
        let length = u32::try_from(bytes.len()).ok()?;
        let (version, build) = (version_of(&bytes)?, build_of(&bytes)?);
        let header = |hardware| ImageHeader { hardware, version, length, build, sha256: sha256(&bytes) };
        let seals = [NATIVE_HARDWARE, HARDWARE].map(|hardware| seal(header(hardware)));
        let flash = ChipFlash::new(boot_loader, &image)?;
        let (build, oldest) = (image.seal.header.build, oldest_of(&image.bytes)?);
        Some(Self { flash, build, oldest, next: NextImage { bytes, seals } })
    }

    /// The image of an update.
    #[must_use]
    pub fn next(&self) -> &NextImage {
        &self.next
    }

    /// A native board that has just got power, with these stages; `boot` names the start.
    ///
    /// # Errors
    /// [`SettingsError`] where the stages cannot be controlled.
    pub fn native(&self, stages: &[Stage; 2], places: &[f64; 2], boot: u32) -> Result<NativeBoard, SettingsError> {
        let (settings, mechanics) = (stages.map(|stage| stage.settings), stages.map(|stage| stage.mechanics));
        let mut native = NativeBoard::standing_at(&settings, &mechanics, places, boot)?;
        let services = native.services_mut();
        services.running.build = self.build;
        services.oldest = self.oldest;
        services.key = DEVELOPMENT_KEY;
        services.verifier = |key, signed, signature| is_signed_by(key, signed, signature);
        native.restart(ResetCause::PowerOn, boot)?;
        Ok(native)
    }

    /// A board with the chip that has just got power, before these mechanics.
    #[must_use]
    pub fn chip(&self, mechanics: &[AxisMechanics; 2], places: &[f64; 2]) -> ChipBoard {
        self.flash.board_before(Plant::new(mechanics, places))
    }
}
