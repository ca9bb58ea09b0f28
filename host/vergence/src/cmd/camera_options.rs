//! Options for attached cameras.

use std::time::Duration;

use vergence_board::HostClock;
use vergence_camera::{Camera, CameraError, V4lCamera, V4lSettings};
use vergence_vision::ImageSize;

use crate::failure::Failure;

/// Settings of attached cameras; those that are not given stay as they are.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct CameraOptions {
    /// Image size of the cameras.
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
    /// Opens the camera at `device`, such as /dev/video0.
    ///
    /// # Errors
    /// No such camera, or none of its pixel formats is understood.
    pub fn open(&self, device: &str, clock: HostClock) -> Result<Box<dyn Camera>, CameraError> {
        self.open_rolling(device, clock, Duration::ZERO)
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
                "{name} is for attached cameras: simulated ones take images of the size in the rig file (--rig)"
            ))),
        }
    }

    /// The same options, with images of `size` unless a size was given.
    #[must_use]
    pub fn for_size(self, size: ImageSize) -> Self {
        Self { size: self.size.or(Some(size)), ..self }
    }

    /// Opens a camera that exposes its rows one after the other; `rolling` is the time from the first row to the last.
    ///
    /// # Errors
    /// As of [`Self::open`].
    pub fn open_rolling(
        &self,
        device: &str,
        clock: HostClock,
        rolling: Duration,
    ) -> Result<Box<dyn Camera>, CameraError> {
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
