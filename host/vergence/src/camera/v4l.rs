//! Cameras of the Linux kernel (Video4Linux2).

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
use vergence_rig::HostInstant;

use super::exposure::{FrameTiming, MiddleOfExposure, SequenceWatch, StampedAt};
use super::pixel_format::PixelFormat;
use super::{Camera, Frame};
use crate::failure::Failure;
use crate::link::HostClock;

/// A camera that sends nothing for this long has vanished.
const SILENCE: Duration = Duration::from_secs(2);
/// So many damaged frames in a row are no accident.
const MOST_DAMAGED: u32 = 30;
/// Without a word of the camera a frame takes a thirtieth of a second.
const USUAL_PERIOD: Duration = Duration::from_micros(33_333);

// linux/v4l2-controls.h
const CID_EXPOSURE_AUTO: u32 = 0x009a_0901;
const CID_EXPOSURE_ABSOLUTE: u32 = 0x009a_0902;
const CID_GAIN: u32 = 0x0098_0913;
const EXPOSURE_MANUAL: i64 = 1;
/// V4L2 counts exposure in units of 100 us.
const EXPOSURE_UNIT_US: u64 = 100;

/// What is asked of a camera; what is not said stays as it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// Width and height.
    pub size: Option<(u32, u32)>,
    /// Exposure; the automatic is switched off.
    pub exposure: Option<Duration>,
    /// Gain in the camera's own unit.
    pub gain: Option<i64>,
    /// From the exposure of the first row to that of the last; zero for a global shutter.
    pub rolling: Duration,
    /// Reading out and sending a frame takes so long at most; absent: a frame period.
    pub readout: Option<Duration>,
}

/// One camera.
pub struct V4lCamera {
    path: PathBuf,
    /// Stopped by hand: the crate's own destructor panics where the device is gone. The mapping goes with the process.
    stream: ManuallyDrop<Stream<'static>>,
    device: Device,
    pixels: PixelFormat,
    format: Format,
    timing: FrameTiming,
    watch: SequenceWatch,
    clock: HostClock,
}

impl V4lCamera {
    /// Opens the camera at `path`, such as `/dev/video0`.
    ///
    /// # Errors
    /// No such camera, or one that offers no format that is understood.
    pub fn open(path: &Path, settings: &Settings, clock: HostClock) -> Result<Self, Failure> {
        let fail = |error: io::Error| {
            Failure::device(format!("camera {}: {error}; is it attached, and free of other programs?", path.display()))
        };
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
        let period = frame_period(&device);
        let timing = FrameTiming {
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
        Ok(Self { path, stream, device, pixels, format, timing, watch, clock })
    }

    /// The camera's own name.
    #[must_use]
    pub fn card(&self) -> String {
        self.device.query_caps().map(|caps| caps.card).unwrap_or_default()
    }

    /// The host clock's instant of one on the kernel's monotonic clock.
    fn host_instant(&self, middle: MiddleOfExposure) -> HostInstant {
        let now = clock_gettime(ClockId::Monotonic);
        let now_us = now.tv_sec as f64 * 1e6 + now.tv_nsec as f64 * 1e-3;
        let age_us = now_us - middle.at.as_secs_f64() * 1e6;
        HostInstant { us: self.clock.now().0 as f64 - age_us, error_us: middle.error.as_secs_f64() * 1e6 }
    }
}

impl Camera for V4lCamera {
    fn grab(&mut self) -> Result<Option<Frame>, Failure> {
        for _ in 0..MOST_DAMAGED {
            if let Some(frame) = self.grab_one()? {
                return Ok(Some(frame));
            }
        }
        Err(Failure::device(format!("camera {} sends only damaged frames: check its cable", self.path.display())))
    }

    fn timing(&self) -> Option<FrameTiming> {
        Some(self.timing)
    }

    fn missed(&self) -> u64 {
        self.watch.missed()
    }
}

impl V4lCamera {
    /// The next frame; `None` where it is damaged, which a cable can do.
    fn grab_one(&mut self) -> Result<Option<Frame>, Failure> {
        let size = (self.format.width, self.format.height);
        let taken = self.stream.next().map(|(bytes, meta)| {
            let used = bytes.get(..meta.bytesused as usize).unwrap_or(bytes);
            (self.pixels.decode(used, size, self.format.stride), *meta)
        });
        let (image, meta) = taken.map_err(|error| {
            Failure::device(format!("camera {} vanished: {error}; what was taken before is kept", self.path.display()))
        })?;
        self.watch.note(meta.sequence);
        let marks = if meta.flags.contains(Flags::TSTAMP_SRC_SOE) { StampedAt::Start } else { StampedAt::End };
        let whole = image.filter(|_| !meta.flags.contains(Flags::ERROR));
        Ok(whole.map(|image| Frame {
            image,
            name: format!("frame{:06}", meta.sequence),
            seq: Some(meta.sequence),
            exposed_at: Some(self.host_instant(self.timing.middle(meta.timestamp.into(), marks))),
        }))
    }
}

impl Drop for V4lCamera {
    fn drop(&mut self) {
        use moq_v4l::io::traits::Stream as _;
        // Nobody is left to hear of a failure; a vanished device has stopped anyway.
        let _ = self.stream.stop();
    }
}

fn choose_format(device: &Device, path: &Path, settings: &Settings) -> Result<(PixelFormat, Format), Failure> {
    let fail = |error: io::Error| Failure::device(format!("camera {}: {error}", path.display()));
    let present = device.format().map_err(fail)?;
    let (width, height) = settings.size.unwrap_or((present.width, present.height));
    for pixels in PixelFormat::ALL {
        let fourcc = FourCC::new(&pixels.fourcc());
        let got = device.set_format(&Format::new(width, height, fourcc)).map_err(fail)?;
        if got.fourcc == fourcc && (got.width, got.height) == (width, height) {
            return Ok((pixels, got));
        }
    }
    Err(Failure::device(format!(
        "camera {} offers none of GREY, YUYV, MJPG at {width} x {height}: choose another --size",
        path.display()
    )))
}

fn set(device: &Device, id: u32, value: i64) -> io::Result<()> {
    device.set_control(Control { id, value: Value::Integer(value) })
}

/// `None` where the camera does not say, or chooses it by itself.
fn read_exposure(device: &Device) -> Option<Duration> {
    let number = |id| match device.control(id) {
        Ok(Control { value: Value::Integer(value), .. }) => Some(value),
        _ => None,
    };
    let manual = number(CID_EXPOSURE_AUTO).is_none_or(|mode| mode == EXPOSURE_MANUAL);
    let units = number(CID_EXPOSURE_ABSOLUTE).filter(|&units| manual && units > 0)?;
    Some(Duration::from_micros(u64::try_from(units).ok()? * EXPOSURE_UNIT_US))
}

fn frame_period(device: &Device) -> Duration {
    let interval = device.params().map(|params| params.interval);
    match interval {
        Ok(interval) if interval.denominator > 0 && interval.numerator > 0 => {
            Duration::from_secs(1) * interval.numerator / interval.denominator
        }
        _ => USUAL_PERIOD,
    }
}
