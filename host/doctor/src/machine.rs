//! What can be known of this machine: its udev rule, its disk, its clocks.

use std::fs::read_to_string;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::fs::statvfs;
use rustix::time::{ClockId, clock_gettime};
use vergence_board::Finding;

/// The udev rule that lets people use the rig's devices.
pub const UDEV_RULES: &str = include_str!("../../../docs/70-vergence.rules");
/// Its name in a folder of rules.
const RULE_FILE: &str = "70-vergence.rules";
/// What installs it.
const INSTALL: &str = "vergence devices --rule | sudo tee /etc/udev/rules.d/70-vergence.rules, then sudo udevadm control --reload && sudo udevadm trigger";

/// Free space below which nothing can be recorded, and below which a recording soon ends.
const LEAST_FREE: u64 = 1_000_000_000;
const LITTLE_FREE: Duration = Duration::from_secs(600);
/// Megabytes per second of a recording, where no camera says it: two cameras of 1280 x 1280 pixels at 10 Hz, as PNG of some 40 % of grey and colour.
const USUAL_MB_PER_S: f64 = 40.0;

/// The host's clock may be slewed by NTP, by at most so much (adjtimex(2)), and is not set while a rig runs.
const SLEWED_PPM: f64 = 500.0;
const SET_MS: f64 = 5.0;
/// Seconds since 1970 before which a clock was never set: the first of January 2024.
const NEVER_SET: f64 = 1_704_067_200.0;

/// Folders in which udev looks for rules, the most important first (udev(7)).
#[must_use]
pub fn rule_folders() -> [PathBuf; 4] {
    ["/etc/udev/rules.d", "/run/udev/rules.d", "/usr/local/lib/udev/rules.d", "/usr/lib/udev/rules.d"]
        .map(PathBuf::from)
}

/// The text of the rule in the first of `folders` that has it.
#[must_use]
pub fn installed_rule(folders: &[PathBuf]) -> Option<String> {
    folders.iter().find_map(|folder| read_to_string(folder.join(RULE_FILE)).ok())
}

/// What is checked of the machine at the end, when `findings` has all else: the udev rule, the disk of the folder `out`, for cameras that send so many megabytes per
/// second, and how the clocks ran since `before`.
#[must_use]
pub fn check_machine(findings: &[Finding], (out, mb_per_s): (&Path, Option<f64>), before: HostTimes) -> [Finding; 3] {
    let is_needed = findings.iter().any(|finding| finding.is_forbidden);
    [
        check_rule(installed_rule(&rule_folders()).as_deref(), is_needed),
        check_disk(out, free_space(out), mb_per_s),
        check_host_clock(before, host_times()),
    ]
}

/// Whether the udev rule is there and this version's; `is_needed` where this user may not use a device.
#[must_use]
pub fn check_rule(installed: Option<&str>, is_needed: bool) -> Finding {
    match installed {
        Some(text) if text == UDEV_RULES && is_needed => Finding::fail(
            "udev",
            "the udev rule is installed, and still you may not use a device",
            "sudo udevadm control --reload && sudo udevadm trigger, or plug the device in again; over ssh, join its group instead",
        ),
        Some(text) if text == UDEV_RULES => Finding::pass("udev", "the udev rule of this version is installed"),
        Some(_) => Finding::warn("udev", "the installed udev rule is that of another version, or was changed", INSTALL),
        None if is_needed => Finding::fail("udev", "no udev rule lets you use the devices", INSTALL),
        None => Finding::pass("udev", "the devices may be used without the udev rule"),
    }
}

/// Bytes that this user may still write at `folder`, or where it will be made.
///
/// # Errors
/// The operating system's.
pub fn free_space(folder: &Path) -> io::Result<u64> {
    let whole = std::path::absolute(folder)?;
    let there = whole.ancestors().find(|path| path.exists()).unwrap_or(&whole);
    let space = statvfs(there)?;
    Ok(space.f_bavail.saturating_mul(space.f_frsize))
}

/// Whether a recording has room in `folder`, where `free` bytes are left; the cameras send `mb_per_s` megabytes per second, as far as that is known.
#[must_use]
pub fn check_disk(folder: &Path, free: io::Result<u64>, mb_per_s: Option<f64>) -> Finding {
    const REMEDY: &str = "delete old recordings, or record on another disk (--out, --record)";
    let free = match free {
        Ok(free) => free,
        Err(error) => {
            return Finding::fail(
                "disk",
                format!("{}: {error}", folder.display()),
                "name a folder that can be written",
            );
        }
    };
    let rate = mb_per_s.unwrap_or(USUAL_MB_PER_S);
    let lasts = Duration::try_from_secs_f64(free as f64 * 1e-6 / rate).unwrap_or(Duration::MAX);
    let reason = format!(
        "{:.1} GB are free in {}: some {} minutes of recording at {rate:.0} MB/s",
        free as f64 * 1e-9,
        folder.display(),
        lasts.as_secs() / 60
    );
    if free < LEAST_FREE {
        return Finding::fail("disk", reason, REMEDY);
    }
    if lasts < LITTLE_FREE { Finding::warn("disk", reason, REMEDY) } else { Finding::pass("disk", reason) }
}

/// The host's clocks at one instant, in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HostTimes {
    /// Since 1970, as people set it.
    pub real: f64,
    /// Since the start, slewed by NTP and never set: images and poses are stamped by it.
    pub monotonic: f64,
    /// Since the start, by the quartz alone.
    pub raw: f64,
}

/// Reads the host's clocks.
#[must_use]
pub fn host_times() -> HostTimes {
    let read = |clock| {
        let time = clock_gettime(clock);
        time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9
    };
    HostTimes { real: read(ClockId::Realtime), monotonic: read(ClockId::Monotonic), raw: read(ClockId::MonotonicRaw) }
}

/// Whether the host's clocks ran evenly from `before` to `after`.
#[must_use]
pub fn check_host_clock(before: HostTimes, after: HostTimes) -> Finding {
    const SYNCHRONISE: &str = "let chrony or systemd-timesyncd keep the clock, and wait until it has settled";
    let (real, monotonic, raw) = (after.real - before.real, after.monotonic - before.monotonic, after.raw - before.raw);
    let set_ms = (real - monotonic) * 1e3;
    let slewed_ppm = if raw > 1.0 { (monotonic / raw - 1.0) * 1e6 } else { 0.0 };
    if after.real < NEVER_SET {
        return Finding::warn("host", "the host's clock was never set: recordings get a wrong date", SYNCHRONISE);
    }
    if set_ms.abs() > SET_MS {
        return Finding::warn(
            "host",
            format!(
                "the host's clock was set by {set_ms:.0} ms in the last {monotonic:.1} s: the times of recordings jump, poses do not"
            ),
            SYNCHRONISE,
        );
    }
    if slewed_ppm.abs() > SLEWED_PPM {
        return Finding::warn("host", format!("the host's clock is slewed by {slewed_ppm:.0} ppm"), SYNCHRONISE);
    }
    Finding::pass(
        "host",
        format!("the host's clock was not set in the last {monotonic:.1} s, and is slewed by {slewed_ppm:.0} ppm"),
    )
}

#[cfg(test)]
mod tests {
    use vergence_board::Verdict;

    use super::*;

    #[test]
    fn a_rule_that_is_missing_or_old_is_found_where_it_is_needed() {
        let folder = tempfile::tempdir().expect("a folder");
        let folders = [folder.path().join("none"), folder.path().to_owned()];
        assert_eq!(installed_rule(&folders), None);
        let missing = check_rule(None, true);
        assert!(missing.verdict == Verdict::Fail && missing.remedy.is_some_and(|how| how.contains("udevadm")));
        assert_eq!(check_rule(None, false).verdict, Verdict::Pass);
        std::fs::write(folder.path().join(RULE_FILE), "# old").expect("written");
        assert_eq!(check_rule(installed_rule(&folders).as_deref(), false).verdict, Verdict::Warn);
        std::fs::write(folder.path().join(RULE_FILE), UDEV_RULES).expect("written");
        assert_eq!(check_rule(installed_rule(&folders).as_deref(), false).verdict, Verdict::Pass);
        assert_eq!(check_rule(installed_rule(&folders).as_deref(), true).verdict, Verdict::Fail);
    }

    #[test]
    fn the_rule_is_needed_where_a_device_is_forbidden_whatever_the_words() {
        let needed = |finding: Finding| check_machine(&[finding], (Path::new("."), None), host_times())[0].verdict;
        assert_ne!(
            needed(Finding::forbidden("cameras", "no right to use /dev/video0", "join its group")),
            Verdict::Pass
        );
        assert_ne!(needed(Finding::fail("rig", "you may not", "read it")), Verdict::Fail);
    }

    #[test]
    fn a_disk_that_is_full_fails_and_one_that_fills_soon_warns() {
        let verdict = |free, rate| check_disk(Path::new("."), Ok(free), rate).verdict;
        assert_eq!(verdict(900_000_000, None), Verdict::Fail);
        assert_eq!(verdict(20_000_000_000, None), Verdict::Warn);
        assert_eq!(verdict(20_000_000_000, Some(10.0)), Verdict::Pass);
        assert_eq!(
            check_disk(Path::new("."), Err(io::ErrorKind::PermissionDenied.into()), None).verdict,
            Verdict::Fail
        );
        let folder = tempfile::tempdir().expect("a folder");
        assert!(free_space(&folder.path().join("not/made/yet")).expect("a disk") > 0);
    }

    #[test]
    fn a_clock_that_is_set_or_slewed_is_found() {
        let before = HostTimes { real: 1.8e9, monotonic: 100.0, raw: 100.0 };
        let after = |real: f64, monotonic: f64| {
            check_host_clock(before, HostTimes { real: before.real + real, monotonic: 100.0 + monotonic, raw: 102.0 })
                .verdict
        };
        assert_eq!(after(2.0, 2.0), Verdict::Pass);
        assert_eq!(after(3.0, 2.0), Verdict::Warn);
        assert_eq!(after(2.01, 2.01), Verdict::Warn);
        let unset = HostTimes { real: 1000.0, ..before };
        assert_eq!(check_host_clock(unset, unset).verdict, Verdict::Warn);
        let now = host_times();
        assert!(now.real > NEVER_SET && now.monotonic > 0.0 && now.raw > 0.0);
    }
}
