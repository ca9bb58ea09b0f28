//! The cameras that the kernel offers, with what each can do.

use std::io;
use std::path::{Path, PathBuf};

use moq_v4l::capability::Flags;
use moq_v4l::control::Value;
use moq_v4l::frameinterval::FrameIntervalEnum;
use moq_v4l::framesize::FrameSizeEnum;
use moq_v4l::video::Capture;
use moq_v4l::{Device, FourCC};

use crate::pixel_format::PixelFormat;
use crate::usb::UsbLink;
use crate::v4l_controls;

/// A camera that can be opened.
#[derive(Clone, Debug, PartialEq)]
pub struct ListedCamera {
    /// Device file, such as `/dev/video0`.
    pub device: PathBuf,
    /// Model name that the driver reports.
    pub card: String,
    /// Name of the driver.
    pub driver: String,
    /// Place of the device, such as `usb-0000:00:14.0-3`.
    pub place: String,
    /// Its USB bus; `None` where it is on another bus.
    pub usb: Option<UsbLink>,
    /// Pixel formats, in the order of the driver.
    pub formats: Vec<ListedFormat>,
    /// Controls whose name speaks of a trigger, each with its value where it is a number. V4L2 has no standard control for it, so that a camera
    /// without one may still be triggered: by its wiring, a module parameter, or a tool of its maker.
    pub trigger: Vec<(String, Option<i64>)>,
}

/// A pixel format of a camera.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ListedFormat {
    /// The kernel's four-character code.
    pub code: String,
    /// Whether this program decodes it.
    pub is_understood: bool,
    /// Image sizes with their rates, such as `640x480 at 30, 15 Hz`.
    pub sizes: Vec<String>,
}

/// Device files of the kernel's video devices in `folder`, which is `/dev`, by number.
#[must_use]
pub fn video_devices(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = folder.read_dir() else { return Vec::new() };
    let number = |path: &Path| path.file_name()?.to_str()?.strip_prefix("video")?.parse::<u32>().ok();
    let mut found: Vec<_> =
        entries.flatten().filter_map(|entry| Some((number(&entry.path())?, entry.path()))).collect();
    found.sort();
    found.into_iter().map(|(_, path)| path).collect()
}

/// What the device at `device` can do; `None` where it takes no images, as the second device file of many cameras, which gives metadata.
///
/// # Errors
/// The operating system's.
pub fn describe_camera(device: &Path) -> io::Result<Option<ListedCamera>> {
    let opened = Device::with_path(device)?;
    let caps = opened.query_caps()?;
    if !caps.capabilities.contains(Flags::VIDEO_CAPTURE) {
        return Ok(None);
    }
    let format = |fourcc: FourCC| ListedFormat {
        code: String::from_utf8_lossy(&fourcc.repr).trim().to_owned(),
        is_understood: PixelFormat::ALL.iter().any(|known| known.fourcc() == fourcc.repr),
        sizes: sizes(&opened, fourcc),
    };
    let formats = opened.enum_formats()?.into_iter().map(|listed| format(listed.fourcc)).collect();
    let value = |id| match opened.control(id).ok()?.value {
        Value::Integer(value) => Some(value),
        Value::Boolean(value) => Some(i64::from(value)),
        _ => None,
    };
    let controls = v4l_controls::names(&opened).into_iter();
    let of_trigger = controls.filter(|(_, name)| name.to_lowercase().contains("trigger"));
    Ok(Some(ListedCamera {
        device: device.into(),
        card: caps.card,
        driver: caps.driver,
        place: caps.bus,
        usb: UsbLink::of(device),
        formats,
        trigger: of_trigger.map(|(id, name)| (name, value(id))).collect(),
    }))
}

/// The sizes of a format with their rates; those of a range by its ends.
fn sizes(device: &Device, fourcc: FourCC) -> Vec<String> {
    let sizes = device.enum_framesizes(fourcc).unwrap_or_default().into_iter();
    let listed = sizes.map(|size| match size.size {
        FrameSizeEnum::Discrete(size) => {
            format!("{}x{}{}", size.width, size.height, rates(device, fourcc, (size.width, size.height)))
        }
        FrameSizeEnum::Stepwise(range) => format!(
            "{}x{} to {}x{}{}",
            range.min_width,
            range.min_height,
            range.max_width,
            range.max_height,
            rates(device, fourcc, (range.max_width, range.max_height))
        ),
    });
    listed.collect()
}

/// The rates of a size, such as ` at 30, 15 Hz`; nothing where the driver tells none.
fn rates(device: &Device, fourcc: FourCC, (width, height): (u32, u32)) -> String {
    let hertz = |interval: &moq_v4l::fraction::Fraction| {
        let rate = f64::from(interval.denominator) / f64::from(interval.numerator.max(1));
        format!("{}", (rate * 100.0).round() / 100.0)
    };
    let intervals = device.enum_frameintervals(fourcc, width, height).unwrap_or_default();
    let rates = intervals.iter().map(|listed| match &listed.interval {
        FrameIntervalEnum::Discrete(interval) => hertz(interval),
        FrameIntervalEnum::Stepwise(range) => format!("{} to {}", hertz(&range.max), hertz(&range.min)),
    });
    let rates: Vec<_> = rates.collect();
    if rates.is_empty() { String::new() } else { format!(" at {} Hz", rates.join(", ")) }
}

impl ListedCamera {
    /// Whether it can be triggered, as far as it tells.
    #[must_use]
    pub fn trigger_in_words(&self) -> String {
        let control = |(name, value): &(String, Option<i64>)| match value {
            Some(value) => format!("'{name}' is {value}"),
            None => format!("'{name}'"),
        };
        match self.trigger.as_slice() {
            [] => "trigger: cannot be told, no control speaks of one; its maker's manual says it".into(),
            controls => format!("trigger: control {}", controls.iter().map(control).collect::<Vec<_>>().join(", ")),
        }
    }

    /// Lines for people: the camera, its formats, its trigger.
    #[must_use]
    pub fn in_words(&self) -> Vec<String> {
        let usb = self.usb.map(|usb| format!(", {usb}")).unwrap_or_default();
        let head = format!("{}  {} ({}, {}{usb})", self.device.display(), self.card, self.driver, self.place);
        let format = |format: &ListedFormat| {
            let note = if format.is_understood { "" } else { " (not understood by vergence)" };
            format!("    {}{note}: {}", format.code, format.sizes.join("; "))
        };
        let formats = self.formats.iter().map(format);
        [head].into_iter().chain(formats).chain([format!("    {}", self.trigger_in_words())]).collect()
    }
}
