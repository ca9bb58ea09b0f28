//! What is left out of the images of both cameras.

use clap::builder::{PathBufValueParser, TypedValueParser};
use vergence_calibration_input::PairMasks;
use vergence_camera::{camera_mask, with_whole_name};
use vergence_rig::{CameraMask, Rig};
use vergence_vision::{BodyMask, ImageSize, Side};

use crate::failure::Failure;

/// What is left out of the images: the robot's own body, a hood, the mount, all outside the image circle.
#[derive(Clone, Debug, Default, clap::Args)]
pub struct MaskOptions {
    /// What is left out of the left images, as the robot's body, a hood, or all outside the image circle: a PNG image of the camera's
    /// size, black there, or a TOML file of polygons and circles. Nothing is taken there. Unless given, the mask in the rig file.
    #[arg(long, value_name = "FILE", value_parser = PathBufValueParser::new().map(CameraMask::File))]
    left_mask: Option<CameraMask>,
    /// The same of the right images.
    #[arg(long, value_name = "FILE", value_parser = PathBufValueParser::new().map(CameraMask::File))]
    right_mask: Option<CameraMask>,
}

impl MaskOptions {
    /// Whether a mask is given.
    pub const fn is_given(&self) -> bool {
        self.left_mask.is_some() || self.right_mask.is_some()
    }

    /// The masks given here, and nothing else.
    pub const fn given(&self) -> PairMasks<'_> {
        [self.left_mask.as_ref(), self.right_mask.as_ref()]
    }

    /// The masks given here, otherwise those of the rig file.
    pub fn of<'a>(&'a self, rig: &'a Rig) -> PairMasks<'a> {
        let [left, right] = self.given();
        [left.or(rig.masks[0].as_ref()), right.or(rig.masks[1].as_ref())]
    }

    /// The same as a calibration of `rig` writes them: with whole names.
    pub fn kept(&self, rig: &Rig) -> [Option<CameraMask>; 2] {
        self.of(rig).map(|mask| mask.map(with_whole_name))
    }

    /// Both masks, for the cameras of `rig`.
    ///
    /// # Errors
    /// As [`Self::read_for`].
    pub fn read(&self, rig: &Rig) -> Result<[Option<BodyMask>; 2], Failure> {
        self.read_for(rig, [rig.left_camera.size(), rig.right_camera.size()])
    }

    /// Both masks, for images of these sizes.
    ///
    /// # Errors
    /// Files that are no masks of such images; shapes of the rig file, which are drawn for images of another size.
    pub fn read_for(&self, rig: &Rig, sizes: [ImageSize; 2]) -> Result<[Option<BodyMask>; 2], Failure> {
        let [left, right] = self.of(rig);
        let read = |side: Side, mask: Option<&CameraMask>, size: ImageSize| match mask {
            Some(CameraMask::Shapes(_)) if rig.camera(side).size() != size => {
                let drawn = rig.camera(side).size();
                Err(Failure::usage(format!(
                    "the rig file's mask of the {side} camera is drawn for images of {} x {}, not of {} x {}: name the rig file of these \
                     cameras with --rig, or a mask with --{side}-mask",
                    drawn.width, drawn.height, size.width, size.height
                )))
            }
            mask => Ok(mask.map(|mask| camera_mask(mask, size)).transpose()?),
        };
        Ok([read(Side::Left, left, sizes[0])?, read(Side::Right, right, sizes[1])?])
    }
}
