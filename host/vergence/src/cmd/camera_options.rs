//! Options for attached cameras.

use std::time::Duration;

use vergence_board::HostClock;
use vergence_camera::{Camera, CameraError, V4lCamera, V4lSettings};
use vergence_live::sized;
use vergence_rig::Rig;
use vergence_vision::ImageSize;

use crate::failure::Failure;

/// Settings of attached cameras; those that are not given stay as they are.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct CameraOptions {
    /// Image size of the cameras. With simulated ones of `vergence run` it scales the lenses of the rig file.
    #[arg(long, value_name = "WxH")]
    size: Option<ImageSize>,
    /// Exposure time, such as 5ms.
    #[arg(long, value_parser = humantime::parse_duration)]
    exposure: Option<Duration>,
    /// Gain, in the camera's own unit.
    #[arg(long)]
    gain: Option<i64>,
    /// Longest time to read out and send an image, such as 12ms; without it, the time from one image to the next. The
    /// shorter it is, the more exactly the time of an exposure is known.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    readout: Option<Duration>,
}

impl CameraOptions {
    /// The rig whose simulated cameras take images of the size that was asked for: the same lenses before sensors of the same millimetres.
    ///
    /// # Errors
    /// Names an option that would do nothing, a size of another shape than the rig file's, and masks, which are of the file's pixels.
    pub fn simulated(&self, rig: Rig) -> Result<Rig, Failure> {
        Self { size: None, ..*self }.none_for_simulated()?;
        match self.size {
            Some(size) => Ok(sized(rig, size)?),
            None => Ok(rig),
        }
    }

    /// Refuses settings beside simulated cameras, which take the images of the rig file's cameras.
    ///
    /// # Errors
    /// Names the option that would do nothing.
    pub fn none_for_simulated(&self) -> Result<(), Failure> {
        let Self { size, exposure, gain, readout } = *self;
        let given = [
            ("--size", size.is_some()),
            ("--exposure", exposure.is_some()),
            ("--gain", gain.is_some()),
            ("--readout", readout.is_some()),
        ];
        match given.iter().find(|(_, is_given)| *is_given) {
            None => Ok(()),
            Some((name, _)) => Err(Failure::usage(format!(
                "{name} is for attached cameras: simulated ones take images of the size in the rig file (--rig), and files are as they are"
            ))),
        }
    }

    /// The same options, with images of `size` unless a size was given.
    #[must_use]
    pub fn for_size(self, size: ImageSize) -> Self {
        Self { size: self.size.or(Some(size)), ..self }
    }

    /// Opens the camera at `device`, such as /dev/video0; `rolling` is the time from the exposure of its first row to that of the last.
    ///
    /// # Errors
    /// No such camera, or none of its pixel formats is understood.
    pub fn open(&self, device: &str, clock: HostClock, rolling: Duration) -> Result<Box<dyn Camera>, CameraError> {
        let CameraOptions { size, exposure, gain, readout } = *self;
        let settings = V4lSettings { size, exposure, gain, rolling, readout };
        let now = Box::new(move || Duration::from_micros(clock.now().0));
        Ok(Box::new(V4lCamera::open(device.as_ref(), &settings, now)?))
    }
}

/// Parses a rate of the camera trigger, in pulses per second.
///
/// # Errors
/// A sentence that says what is expected.
pub fn parse_rate(text: &str) -> Result<f64, String> {
    let rate = text.parse().ok().filter(|rate| (0.1..=500.0).contains(rate));
    rate.ok_or_else(|| format!("'{text}' is no rate: choose 0.1 to 500 pulses each second"))
}
