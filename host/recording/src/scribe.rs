//! Turns what was noted into messages of the bag.

use std::io::{Seek, Write};

use image::RgbImage;
use vergence_protocol::Microseconds;
use vergence_rig::{Rig, StampedImage};

use crate::RecordingError;
use crate::bag::{self, Bag};
use crate::event::{Event, Eye, Stamp};
use crate::messages::{self, Grade, Health};
use crate::png::Png;
use crate::reader::stamp_ns;
use crate::recorder::{Entry, unwritten};

/// Turns entries into messages.
pub struct Scribe<W: Write + Seek> {
    bag: Bag<W>,
    rig: Rig,
    epoch_us: u64,
    images: u64,
}

impl<W: Write + Seek> Scribe<W> {
    /// Writes to `bag` what `rig` says; `epoch_us` is the time at which the host's clock started, in microseconds since 1970.
    pub const fn new(bag: Bag<W>, rig: Rig, epoch_us: u64) -> Self {
        Self { bag, rig, epoch_us, images: 0 }
    }

    /// Ends the bag; returns how many images are in it.
    ///
    /// # Errors
    /// As [`Bag::finish`].
    pub fn finish(self) -> Result<u64, RecordingError> {
        self.bag.finish()?;
        Ok(self.images)
    }

    fn ns(&self, at: Microseconds) -> u64 {
        (self.epoch_us + at.0) * 1000
    }

    /// Writes the messages of an entry.
    ///
    /// # Errors
    /// As [`Bag::write`].
    pub fn write(&mut self, entry: Entry) -> Result<(), RecordingError> {
        match entry {
            Entry::Event(now, event) => {
                if let Event::Pose(pose) = &event {
                    let at = self.ns(now);
                    self.bag.write(bag::JOINTS, at, &messages::joint_state(at, &self.rig.axes, pose))?;
                }
                self.event(now, &event)
            }
            Entry::Image(now, eye, stamp, developed) => match developed.get() {
                Ok(image) => self.image(now, eye, stamp, image),
                // The live loop names it too.
                Err(error) => self.warning(now, &error.to_string()),
            },
            Entry::Cloud(exposed, measured) => {
                let ((cloud, pose), at) = (*measured, self.ns(exposed));
                self.bag.write(bag::TRANSFORMS, at, &messages::transforms(at, &pose))?;
                self.bag.write(bag::POINTS, at, &messages::cloud(at, &cloud))
            }
            Entry::Warning(now, sentence) => self.warning(now, &sentence),
        }
    }

    fn warning(&mut self, now: Microseconds, sentence: &str) -> Result<(), RecordingError> {
        let at = self.ns(now);
        let warning =
            Health { grade: Grade::Warning, name: "vergence", message: sentence.to_owned(), values: Vec::new() };
        self.bag.write(bag::DIAGNOSTICS, at, &messages::diagnostics(at, &[warning]))
    }

    fn event(&mut self, now: Microseconds, event: &Event) -> Result<(), RecordingError> {
        // Memory is the only limit of an event's encoding.
        let postcard = postcard::to_allocvec(event).map_err(unwritten)?;
        self.bag.write(bag::EVENTS, self.ns(now), &messages::event(now.0, &postcard))
    }

    fn image(&mut self, now: Microseconds, eye: Eye, stamp: Stamp, image: &RgbImage) -> Result<(), RecordingError> {
        let (image_topic, info_topic, lens) = match eye {
            Eye::Left => (bag::LEFT_IMAGE, bag::LEFT_INFO, &self.rig.left_camera),
            Eye::Right => (bag::RIGHT_IMAGE, bag::RIGHT_INFO, &self.rig.right_camera),
        };
        let at = self.ns(now);
        let exposed = stamp_ns(self.epoch_us, StampedImage::from(stamp).middle);
        let info = messages::camera_info(exposed, eye, lens);
        self.bag.write(info_topic, at, &info)?;
        self.bag.write(image_topic, at, &messages::image(exposed, eye, &Png::of(image).map_err(unwritten)?))?;
        self.images += 1;
        self.event(now, &Event::Image(eye, stamp))
    }
}
