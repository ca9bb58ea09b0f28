//! How attached cameras are set up on the command line.

use std::time::Duration;

use vergence_vision::ImageSize;

use crate::camera::{Camera, V4lCamera, V4lSettings};
use crate::failure::Failure;
use crate::link::HostClock;

/// What is asked of attached cameras; what is not said stays as it is.
#[derive(Clone, Copy, Debug, clap::Args)]
pub struct CameraOptions {
    /// Image size of the cameras.
    #[arg(long, value_parser = parse_pixels, value_name = "WxH")]
    size: Option<(u32, u32)>,
    /// Exposure, such as 5ms.
    #[arg(long, value_parser = humantime::parse_duration)]
    exposure: Option<Duration>,
    /// Gain, in the camera's own unit.
    #[arg(long)]
    gain: Option<i64>,
    /// How long reading out and sending a frame takes at most, such as 12ms; without it a frame period. The shorter it is
    /// known to be, the better known is when a frame was exposed.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    readout: Option<Duration>,
}

impl CameraOptions {
    /// Opens the camera at `device`, such as /dev/video0.
    ///
    /// # Errors
    /// No such camera, or one that offers no format that is understood.
    pub fn open(&self, device: &str, clock: HostClock) -> Result<Box<dyn Camera>, Failure> {
        self.open_rolling(device, clock, Duration::ZERO)
    }

    /// The same, for images of `size` where no other is asked for.
    #[must_use]
    pub fn for_size(self, size: ImageSize) -> Self {
        Self { size: self.size.or(Some((size.width, size.height))), ..self }
    }

    /// As [`Self::open`] for a camera that exposes its rows one after the other, the last so long after the first.
    ///
    /// # Errors
    /// As of [`Self::open`].
    pub fn open_rolling(&self, device: &str, clock: HostClock, rolling: Duration) -> Result<Box<dyn Camera>, Failure> {
        let CameraOptions { size, exposure, gain, readout } = *self;
        let settings = V4lSettings { size, exposure, gain, rolling, readout };
        Ok(Box::new(V4lCamera::open(device.as_ref(), &settings, clock)?))
    }
}

fn parse_pixels(text: &str) -> Result<(u32, u32), String> {
    super::calibrate::parse_size(text).map(|size| (size.width, size.height))
}
