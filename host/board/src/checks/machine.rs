//! What can be known of this machine without asking the board.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::Path;

use rustix::fs::{Access, access};

use super::Finding;
use crate::link::Port;

/// Checks that the port exists and that this user may use it.
#[must_use]
pub fn check_port(port: &Port) -> Finding {
    match port {
        Port::Serial(path) if !path.exists() => Finding::fail(
            "port",
            format!("there is no {port}"),
            "connect and power the board, and see 'vergence devices' for the ports there are",
        ),
        Port::Serial(path) => match forbidden(path) {
            Some(remedy) => Finding::forbidden("port", format!("you may not read and write {port}"), remedy),
            None => Finding::pass("port", format!("{port} may be read and written")),
        },
        Port::Tcp(_) | Port::Simulated(_) => Finding::pass("port", port.to_string()),
    }
}

/// Remedy where this user may not read and write `device`; `None` where that is allowed.
#[must_use]
pub fn forbidden(device: &Path) -> Option<String> {
    access(device, Access::READ_OK | Access::WRITE_OK).err()?;
    let group = fs::metadata(device).ok().and_then(|metadata| group_name(metadata.gid()));
    Some(match group.as_deref() {
        Some("root") | None => "install the udev rule that 'vergence devices --rule' prints".to_owned(),
        Some(group) => format!("sudo usermod -aG {group} $USER, then log out and in again"),
    })
}

/// The name of a group: `dialout` owns serial ports on Debian, `uucp` on Arch.
fn group_name(id: u32) -> Option<String> {
    let groups = fs::read_to_string("/etc/group").ok()?;
    let mut fields = groups.lines().map(|line| line.split(':'));
    fields.find_map(|mut line| {
        let name = line.next()?;
        (line.nth(1)?.parse() == Ok(id)).then(|| name.to_owned())
    })
}
