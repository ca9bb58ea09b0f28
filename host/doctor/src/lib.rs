//! What is well with cameras, calibration, models and this machine, what is not, and what to do: the part of `vergence doctor` beside the board's own
//! checks, and `vergence camera test`.
//!
//! Each check is a function of facts that were gathered before, so that a full disk or a missing rule can be tested without one.

mod calibration;
mod camera_test;
mod cameras;
mod figures;
mod fit;
mod machine;
mod models;
mod report;
mod verdicts;

pub use calibration::{Age, MEND_RIG, calibration_age, check_calibration_age, check_rig_file};
pub use camera_test::{CameraTest, Heard, HeardImage, Taken};
pub use cameras::{CameraEntry, check_cameras, list_cameras};
pub use figures::{CameraFigures, ImageFigures, Step, TestFigures, TriggerFigures, figures};
pub use fit::{Running, check_fit, fit};
pub use machine::{
    HostTimes, UDEV_RULES, check_disk, check_host_clock, check_machine, check_rule, free_space, host_times,
    installed_rule, rule_folders,
};
pub use models::check_models;
pub use report::{test_in_words, test_json};
pub use verdicts::{check_bandwidth, check_test};
