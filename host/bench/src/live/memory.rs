//! Memory and computing time of this process, as Linux tells them.

/// Mebibytes that are resident, and most that ever were; zero where the system does not tell.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Memory {
    /// Now.
    pub resident: u64,
    /// The most so far.
    pub peak: u64,
}

impl Memory {
    /// Reads `/proc/self/status` (proc_pid_status(5): VmRSS and VmHWM, in kibibytes).
    #[must_use]
    pub fn now() -> Self {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let of = |name: &str| {
            let line = status.lines().find_map(|line| line.strip_prefix(name));
            line.and_then(|rest| rest.split_whitespace().next()?.parse::<u64>().ok()).unwrap_or_default() / 1024
        };
        Self { resident: of("VmRSS:"), peak: of("VmHWM:") }
    }

    /// Counts the most from now on (proc_pid_clear_refs(5)). Where the system does not let it, the most stays that of the whole process.
    pub fn forget_peak() {
        let _ = std::fs::write("/proc/self/clear_refs", "5");
    }
}

/// Seconds that all threads of this process have computed, in steps of 10 ms; zero where the system does not tell.
///
/// It reads `/proc/self/stat` (proc_pid_stat(5): utime and stime, in hundredths of a second), and says what work costs where other programs share the machine.
#[must_use]
pub fn computed_seconds() -> f64 {
    /// Fields between the name of the program and utime.
    const BEFORE: usize = 11;
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields.skip(BEFORE).take(2).filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() / 100.0
}
