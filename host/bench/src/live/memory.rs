//! Memory of this process, as Linux tells it.

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
}
