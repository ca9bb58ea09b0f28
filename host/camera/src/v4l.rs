//! Cameras of the Linux kernel (Video4Linux2; linux/videodev2.h).

use std::io;
use std::mem::ManuallyDrop;
use std::path::{Path, PathBuf};
use std::time::Duration;

use moq_v4l::buffer::{Flags, Type};
use moq_v4l::control::{Control, Value};
use moq_v4l::io::mmap::Stream;
use moq_v4l::io::traits::CaptureStream;
use moq_v4l::video::Capture;
use moq_v4l::{Device, Format, FourCC};
use rustix::time::{ClockId, clock_gettime};
use vergence_rig::{ExposureTiming, HostInstant, MiddleOfExposure, SequenceWatch, StampedAt};
use vergence_vision::ImageSize;

use crate::pixel_format::PixelFormat;
use crate::{Camera, CameraError, CameraImage};

/// Time without an image after which a camera has vanished.
const SILENCE: Duration = Duration::from_secs(2);
/// Number of damaged images in a row after which the camera is reported as faulty.
const MOST_DAMAGED: u32 = 30;
/// Time from one image to the next of a camera that does not report it.
const USUAL_PERIOD: Duration = Duration::from_micros(33_333);

// linux/v4l2-controls.h
const CID_EXPOSURE_AUTO: u32 = 0x009a_0901;
const CID_EXPOSURE_ABSOLUTE: u32 = 0x009a_0902;
const CID_GAIN: u32 = 0x0098_0913;
const EXPOSURE_MANUAL: i64 = 1;
/// Unit of V4L2_CID_EXPOSURE_ABSOLUTE, in microseconds.
const EXPOSURE_UNIT_US: u64 = 100;

/// Tells the time on the host's clock, as time since the clock started.
pub type HostTime = Box<dyn Fn() -> Duration + Send>;

/// Settings of a camera; those that are absent stay as they are.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct V4lSettings {
    /// Image size.
    pub size: Option<ImageSize>,
    /// Exposure time; switches the automatic exposure off.
    pub exposure: Option<Duration>,
    /// Gain in the camera's own unit.
    pub gain: Option<i64>,
    /// Time from the start of the first row's exposure to the start of the last row's; zero for a global shutter.
    pub rolling: Duration,
    /// Longest time to read out and send an image; absent: the time from one image to the next.
    pub readout: Option<Duration>,
}

/// An attached camera.
pub struct V4lCamera {
    path: PathBuf,
    /// Stopped in our own `drop`, because the stream's panics where the device is gone. The mapping ends with the process.
    stream: ManuallyDrop<Stream<'static>>,
    device: Device,
    pixels: PixelFormat,
    format: Format,
    timing: ExposureTiming,
    watch: SequenceWatch,
    now: HostTime,
}

impl V4lCamera {
    /// Opens the camera at `path`, such as `/dev/video0`; `now` tells the time for the stamps of its images.
    ///
    /// # Errors
    /// [`CameraError::Unavailable`] or [`CameraError::NoFormat`].
    pub fn open(path: &Path, settings: &V4lSettings, now: HostTime) -> Result<Self, CameraError> {
        let fail = |error: io::Error| unavailable(path, &error);
        let device = Device::with_path(path).map_err(fail)?;
        let (pixels, format) = choose_format(&device, path, settings)?;
        if let Some(exposure) = settings.exposure {
            let units = i64::try_from(exposure.as_micros() / u128::from(EXPOSURE_UNIT_US)).unwrap_or(i64::MAX);
            set(&device, CID_EXPOSURE_AUTO, EXPOSURE_MANUAL).map_err(fail)?;
            set(&device, CID_EXPOSURE_ABSOLUTE, units).map_err(fail)?;
        }
        if let Some(gain) = settings.gain {
            set(&device, CID_GAIN, gain).map_err(fail)?;
        }
        let period = image_period(&device);
        let timing = ExposureTiming {
            period,
            exposure: read_exposure(&device),
            rolling: settings.rolling,
            readout: settings.readout.unwrap_or(period),
        };
        let mut stream = Stream::with_buffers(&device, Type::VideoCapture, 4).map_err(fail)?;
        stream.set_timeout(SILENCE);
        let watch = SequenceWatch::default();
        let path = path.to_owned();
        let stream = ManuallyDrop::new(stream);
        Ok(Self { path, stream, device, pixels, format, timing, watch, now })
    }

    /// Model name that the camera reports.
    #[must_use]
    pub fn card(&self) -> String {
        self.device.query_caps().map(|caps| caps.card).unwrap_or_default()
    }

    /// Converts an instant on the kernel's monotonic clock to the host's clock.
    fn host_instant(&self, middle: MiddleOfExposure) -> HostInstant {
        let now = clock_gettime(ClockId::Monotonic);
        let now_us = now.tv_sec as f64 * 1e6 + now.tv_nsec as f64 * 1e-3;
        let age_us = now_us - middle.at.as_secs_f64() * 1e6;
        HostInstant { us: (self.now)().as_micros() as f64 - age_us, error_us: middle.error.as_secs_f64() * 1e6 }
    }
}

impl Camera for V4lCamera {
    fn grab(&mut self) -> Result<Option<CameraImage>, CameraError> {
        for _ in 0..MOST_DAMAGED {
            if let Some(image) = self.grab_one()? {
                return Ok(Some(image));
            }
        }
        Err(CameraError::Damaged(self.path.clone()))
    }

    fn timing(&self) -> Option<ExposureTiming> {
        Some(self.timing)
    }

    fn missed(&self) -> u64 {
        self.watch.missed()
    }
}

impl V4lCamera {
    /// Takes the next image; `None` where it arrived damaged.
    fn grab_one(&mut self) -> Result<Option<CameraImage>, CameraError> {
        let size = (self.format.width, self.format.height);
        let taken = self.stream.next().map(|(bytes, meta)| {
            let used = bytes.get(..meta.bytesused as usize).unwrap_or(bytes);
            (self.pixels.decode(used, size, self.format.stride), *meta)
        });
        let (image, meta) =
            taken.map_err(|error| CameraError::Vanished { device: self.path.clone(), why: error.to_string() })?;
        self.watch.note(meta.sequence);
        let marks = if meta.flags.contains(Flags::TSTAMP_SRC_SOE) { StampedAt::Start } else { StampedAt::End };
        let whole = image.filter(|_| !meta.flags.contains(Flags::ERROR));
        Ok(whole.map(|image| CameraImage {
            image,
            name: format!("image{:06}", meta.sequence),
            seq: Some(meta.sequence),
            bytes: Some(meta.bytesused),
            exposed_at: Some(self.host_instant(self.timing.middle(meta.timestamp.into(), marks))),
        }))
    }
}

impl Drop for V4lCamera {
    fn drop(&mut self) {
        use moq_v4l::io::traits::Stream as _;
        // There is nobody left to report a failure to; a vanished device has stopped anyway.
        let _ = self.stream.stop();
    }
}

fn unavailable(path: &Path, error: &io::Error) -> CameraError {
    CameraError::Unavailable { device: path.into(), why: error.to_string() }
}

fn choose_format(device: &Device, path: &Path, settings: &V4lSettings) -> Result<(PixelFormat, Format), CameraError> {
    let fail = |error: io::Error| unavailable(path, &error);
    let present = device.format().map_err(fail)?;
    let present = ImageSize { width: present.width, height: present.height };
    let ImageSize { width, height } = settings.size.unwrap_or(present);
    for pixels in PixelFormat::ALL {
        let fourcc = FourCC::new(&pixels.fourcc());
        let got = device.set_format(&Format::new(width, height, fourcc)).map_err(fail)?;
        if got.fourcc == fourcc && (got.width, got.height) == (width, height) {
            return Ok((pixels, got));
        }
    }
    Err(CameraError::NoFormat { device: path.into(), width, height })
}

fn set(device: &Device, id: u32, value: i64) -> io::Result<()> {
    device.set_control(Control { id, value: Value::Integer(value) })
}

/// Exposure time that is set; `None` where the camera does not report it or chooses it automatically.
fn read_exposure(device: &Device) -> Option<Duration> {
    let number = |id| match device.control(id) {
        Ok(Control { value: Value::Integer(value), .. }) => Some(value),
        _ => None,
    };
    let manual = number(CID_EXPOSURE_AUTO).is_none_or(|mode| mode == EXPOSURE_MANUAL);
    let units = number(CID_EXPOSURE_ABSOLUTE).filter(|&units| manual && units > 0)?;
    Some(Duration::from_micros(u64::try_from(units).ok()? * EXPOSURE_UNIT_US))
}

fn image_period(device: &Device) -> Duration {
    let interval = device.params().map(|params| params.interval);
    match interval {
        Ok(interval) if interval.denominator > 0 && interval.numerator > 0 => {
            Duration::from_secs(1) * interval.numerator / interval.denominator
        }
        _ => USUAL_PERIOD,
    }
}
