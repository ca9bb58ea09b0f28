//! The exposures of a recording, one after the other.

use std::path::Path;

use image::RgbImage;
use vergence_camera::PendingImage;
use vergence_live::PosedExposure;
use vergence_pipeline::ExposedImage;
use vergence_recording::{Posing, Reader, stamp_ns};
use vergence_rig::{Provenance, Rig, RigPose};
use vergence_vision::{ImageSize, Side};

use crate::pinhole::PinholeBag;
use crate::sequence::Sequence;
use crate::{ExportError, ExportFormat, Exported, Options, Stop};

/// An image of a camera with the middle of its exposure in nanoseconds since 1970.
pub struct Stamped {
    pub ns: u64,
    pub image: RgbImage,
}

/// The images of an exposure: of both cameras, or of one where the other was dead.
pub struct Taken {
    pub images: [Option<Stamped>; 2],
    /// The pose of a pair; `None` where no encoder told an axis.
    pub pose: Option<RigPose>,
}

/// What takes the exposures of a recording.
pub trait Sink {
    fn take(&mut self, taken: &Taken) -> Result<(), ExportError>;

    /// Ends the files; returns sentences that people should know.
    fn finish(self: Box<Self>) -> Result<Vec<String>, ExportError>;
}

/// Exports a recording.
pub fn export(recording: &Path, rig: Option<Rig>, options: &Options, stop: &Stop) -> Result<Exported, ExportError> {
    let mut reader = Reader::open(recording)?;
    // The rig file precedes the first event.
    let mut next = reader.next_event()?;
    let (rig, text) = rig_of(&reader, rig)?;
    let mut sink: Box<dyn Sink> = match options.to {
        ExportFormat::Pinhole => Box::new(PinholeBag::create((&rig, &text), reader.simulated(), options)?),
        ExportFormat::TumVi | ExportFormat::Euroc => Box::new(Sequence::create(&rig, &text, options)?),
    };
    let mut posing = Posing::new(&rig, ());
    let mut exported = Exported::default();
    while let Some(heard) = next {
        stop.check(options)?;
        let epoch_us = heard.epoch_us;
        take_all(posing.take(heard), &rig, epoch_us, (&mut exported, sink.as_mut()))?;
        next = reader.next_event()?;
        if next.is_none() {
            take_all(posing.finish(), &rig, epoch_us, (&mut exported, sink.as_mut()))?;
        }
    }
    exported.skipped = posing.skipped().iter().map(|(reason, &count)| (reason.as_str().to_owned(), count)).collect();
    if exported.pairs + exported.alone[0] + exported.alone[1] == 0 {
        let skipped = exported.skipped_in_words();
        return Err(ExportError::Nothing { recording: recording.to_owned(), skipped });
    }
    exported.warnings = sink.finish()?;
    if !reader.is_finished() {
        let file = reader.file().display();
        exported.warnings.push(format!("{file} was not finished: what came after its last chunk is lost"));
    }
    Ok(exported)
}

/// The rig that is named or attached, and its file.
fn rig_of(reader: &Reader, named: Option<Rig>) -> Result<(Rig, String), ExportError> {
    let Some(rig) = named else {
        return Ok((reader.attached_rig()?, reader.rig().unwrap_or_default().to_owned()));
    };
    let program = concat!("vergence ", env!("CARGO_PKG_VERSION")).to_owned();
    let text = rig.to_toml(&Provenance { program, inputs_sha256: String::new(), date: None });
    Ok((rig, text.map_err(ExportError::Unwritable)?))
}

fn take_all(
    exposures: Vec<PosedExposure>,
    rig: &Rig,
    epoch_us: u64,
    (exported, sink): (&mut Exported, &mut dyn Sink),
) -> Result<(), ExportError> {
    for exposure in exposures {
        let taken = taken(exposure, rig, epoch_us)?;
        match &taken.images {
            [Some(_), Some(_)] => {
                exported.pairs += 1;
                exported.without_pose += u64::from(taken.pose.is_none());
            }
            [left, _] => exported.alone[usize::from(left.is_none())] += 1,
        }
        sink.take(&taken)?;
    }
    Ok(())
}

fn taken(exposure: PosedExposure, rig: &Rig, epoch_us: u64) -> Result<Taken, ExportError> {
    let stamped = |side, image| stamped(side, image, rig, epoch_us);
    let pair = |[left, right]: [ExposedImage<PendingImage>; 2]| {
        Ok::<_, ExportError>([Some(stamped(Side::Left, left)?), Some(stamped(Side::Right, right)?)])
    };
    Ok(match exposure {
        PosedExposure::Pair(images, pose) | PosedExposure::Unseen(images, pose, _) => {
            Taken { images: pair(*images)?, pose: Some(pose.at_middle().clone()) }
        }
        PosedExposure::Untold(images, ..) => Taken { images: pair(*images)?, pose: None },
        PosedExposure::One { side, image, .. } => {
            let mut images = [None, None];
            images[side.index()] = Some(stamped(side, *image)?);
            Taken { images, pose: None }
        }
    })
}

fn stamped(side: Side, exposed: ExposedImage<PendingImage>, rig: &Rig, epoch_us: u64) -> Result<Stamped, ExportError> {
    let ns = stamp_ns(epoch_us, exposed.image.middle);
    let image = (exposed.image.develop)()?;
    check_size(side, &image, rig)?;
    Ok(Stamped { ns, image })
}

/// Refuses an image of another size than its camera has.
pub fn check_size(side: Side, image: &RgbImage, rig: &Rig) -> Result<(), ExportError> {
    let camera = [rig.left_camera, rig.right_camera][side.index()].size();
    let image = ImageSize { width: image.width(), height: image.height() };
    if image == camera { Ok(()) } else { Err(ExportError::Size { side, image, camera }) }
}
