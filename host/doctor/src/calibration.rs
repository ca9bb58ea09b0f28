//! How old a calibration is.

use std::path::Path;
use std::time::UNIX_EPOCH;

use vergence_board::Finding;
use vergence_rig::{Provenance, Rig};

use crate::machine::HostTimes;

/// After half a year, a rig that is carried about has had time to change.
const OLD_DAYS: i64 = 180;
const SECONDS_PER_DAY: f64 = 86_400.0;

/// When a calibration was made, in days since 1970.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Age {
    /// By the date in the file.
    Stated(i64),
    /// By the time at which the file was written last.
    Written(i64),
    /// Nothing tells it.
    Unknown,
}

/// What helps where a rig file cannot be read.
pub const MEND_RIG: &str = "mend the file, which docs/rig-file.md describes, or 'vergence calibrate rollback'";

/// What is said of a rig that was read from a file, which may be that of the active calibration, or is the built-in one.
#[must_use]
pub fn check_rig_file(rig: &Rig, file: Option<(&Path, bool)>, now: HostTimes) -> Vec<Finding> {
    let Some((path, is_active)) = file else {
        return vec![Finding::warn(
            "rig",
            format!("the built-in '{}', which is nobody's real rig; no calibration is active", rig.name),
            "calibrate, or name your rig file with --rig or VERGENCE_RIG",
        )];
    };
    let active = if is_active { "the active calibration, " } else { "" };
    let found = Finding::pass("rig", format!("'{}' from {active}{}", rig.name, path.display()));
    vec![found, check_calibration_age(calibration_age(path), now)]
}

/// When the calibration in the rig file `path` was made.
#[must_use]
pub fn calibration_age(path: &Path) -> Age {
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let provenance = text.parse::<toml::Table>().ok().and_then(|mut file| file.remove("provenance"));
    let date = provenance.and_then(|table| table.try_into::<Provenance>().ok()).and_then(|origin| origin.date);
    if let Some(day) = date.and_then(|date| days_since_1970(&date)) {
        return Age::Stated(day);
    }
    let written = path.metadata().and_then(|file| file.modified()).ok();
    let since = written.and_then(|time| time.duration_since(UNIX_EPOCH).ok());
    since.map_or(Age::Unknown, |since| Age::Written((since.as_secs_f64() / SECONDS_PER_DAY) as i64))
}

/// Whether a calibration of this age is still to be trusted.
#[must_use]
pub fn check_calibration_age(age: Age, now: HostTimes) -> Finding {
    const REMEDY: &str = "vergence doctor --cameras ... says whether it still fits; else calibrate again";
    let today = (now.real / SECONDS_PER_DAY) as i64;
    let (made, how) = match age {
        Age::Stated(made) => (made, "by its date"),
        Age::Written(made) => (made, "by the time of its file, which states no date"),
        Age::Unknown => return Finding::warn("age", "nothing tells when the calibration was made", REMEDY),
    };
    let days = today - made;
    let reason = format!("the calibration is {days} days old {how}");
    match days {
        // Time zones differ by a day.
        ..-1 => Finding::warn(
            "age",
            format!("the calibration was made {} days from now {how}", -days),
            "set the host's clock",
        ),
        OLD_DAYS.. => Finding::warn("age", reason, REMEDY),
        _ => Finding::pass("age", reason),
    }
}

/// Days from 1970 to a date such as `2026-03-31`, which other text may follow (H. Hinnant, chrono-compatible low-level date algorithms).
fn days_since_1970(date: &str) -> Option<i64> {
    let mut parts = date.get(..10)?.split('-').map(str::parse::<i64>);
    let (Ok(year), Ok(month), Ok(day)) = (parts.next()?, parts.next()?, parts.next()?) else { return None };
    if !(1..=12).contains(&month) || !(1..=31).contains(&day) {
        return None;
    }
    // Years begin in March, so that the leap day is their last.
    let year = if month <= 2 { year - 1 } else { year };
    let era = year.div_euclid(400);
    let of_era = year.rem_euclid(400);
    let of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    Some(era * 146_097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year - 719_468)
}

#[cfg(test)]
mod tests {
    use vergence_board::Verdict;

    use super::*;

    #[test]
    fn dates_become_days() {
        for (date, days) in
            [("1970-01-01", 0), ("2000-02-29", 11_016), ("2000-03-01", 11_017), ("2026-11-26T10:00", 20_783)]
        {
            assert_eq!(days_since_1970(date), Some(days), "{date}");
        }
        for bad in ["today", "2026-13-01", "26-1-1", "2026/11/26"] {
            assert_eq!(days_since_1970(bad), None, "{bad}");
        }
    }

    #[test]
    fn an_old_calibration_is_found_by_its_date_or_by_that_of_its_file() {
        let now = HostTimes { real: 20_783.5 * SECONDS_PER_DAY, monotonic: 0.0, raw: 0.0 };
        let verdict = |age| check_calibration_age(age, now).verdict;
        assert_eq!(verdict(Age::Stated(20_700)), Verdict::Pass);
        assert_eq!(verdict(Age::Stated(20_500)), Verdict::Warn);
        assert_eq!(verdict(Age::Stated(20_800)), Verdict::Warn);
        assert_eq!(verdict(Age::Unknown), Verdict::Warn);
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("rig.toml");
        let origin = "name = 'x'\n[provenance]\nprogram = 'vergence'\ninputs_sha256 = 'ab'\n";
        std::fs::write(&file, origin).expect("written");
        assert!(matches!(calibration_age(&file), Age::Written(days) if days > 20_000));
        std::fs::write(&file, format!("{origin}date = '2026-01-31'\n")).expect("written");
        assert_eq!(calibration_age(&file), Age::Stated(20_484));
        assert_eq!(calibration_age(&folder.path().join("none")), Age::Unknown);
    }
}
