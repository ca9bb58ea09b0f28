//! How attached cameras are set up on the command line.

use std::time::Duration;

use crate::camera::{Camera, V4lCamera, V4lSettings};
use crate::failure::Failure;
use crate::link::HostClock;

/// What is asked of attached cameras; what is not said stays as it is.
#[derive(Clone, Debug, clap::Args)]
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
}

impl CameraOptions {
    /// Opens the camera at `device`, such as /dev/video0.
    ///
    /// # Errors
    /// No such camera, or one that offers no format that is understood.
    pub fn open(&self, device: &str, clock: HostClock) -> Result<Box<dyn Camera>, Failure> {
        let settings = V4lSettings { size: self.size, exposure: self.exposure, gain: self.gain };
        Ok(Box::new(V4lCamera::open(device.as_ref(), &settings, clock)?))
    }
}

fn parse_pixels(text: &str) -> Result<(u32, u32), String> {
    super::calibrate::parse_size(text).map(|size| (size.width, size.height))
}
