//! Names of the controls of a V4L2 device.
//!
//! The crate's own list asks for compound controls too, and panics at kinds that are newer than it, such as the region of interest of
//! UVC cameras since Linux 6.16. Only simple controls are asked for here.

use std::ffi::CStr;

use moq_v4l::Device;
use moq_v4l::sys::{V4L2_CTRL_FLAG_DISABLED, V4L2_CTRL_FLAG_NEXT_CTRL, v4l2_query_ext_ctrl};
use moq_v4l::v4l2::{self, vidioc::VIDIOC_QUERY_EXT_CTRL};

/// More controls than any device has: a driver that repeats itself must not hang this program.
const MOST_CONTROLS: usize = 1_000;

/// The number and the name of each control that the device has.
pub fn names(device: &Device) -> Vec<(u32, String)> {
    let (mut found, mut id) = (Vec::new(), 0);
    while let Some(control) = after(device, id).filter(|next| next.id > id && found.len() < MOST_CONTROLS) {
        id = control.id;
        if control.flags & V4L2_CTRL_FLAG_DISABLED == 0 {
            let name: Vec<u8> = control.name.iter().map(|&byte| byte as u8).collect();
            let name = CStr::from_bytes_until_nul(&name).map(|name| name.to_string_lossy().into_owned());
            found.push((id, name.unwrap_or_default()));
        }
    }
    found
}

/// The first simple control with a number above `id`.
#[allow(unsafe_code, reason = "the kernel's interface is a C structure")]
fn after(device: &Device, id: u32) -> Option<v4l2_query_ext_ctrl> {
    // SAFETY: the structure holds numbers only, for which zero is a value.
    let mut control: v4l2_query_ext_ctrl = unsafe { std::mem::zeroed() };
    control.id = id | V4L2_CTRL_FLAG_NEXT_CTRL;
    // SAFETY: VIDIOC_QUERY_EXT_CTRL reads and writes one `v4l2_query_ext_ctrl` at the address, which lives until the call returns.
    let asked = unsafe { v4l2::ioctl(device.handle().fd(), VIDIOC_QUERY_EXT_CTRL, (&raw mut control).cast()) };
    asked.ok().map(|()| control)
}
