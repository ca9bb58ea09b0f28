//! What is drawn and written of a measurement, for people and for other programs.
//!
//! - [`match_svg`], [`depth_svg`], [`error_svg`] and [`dense_svg`] draw what was measured on the images; [`zones_svg`],
//!   [`zones_plot`] and [`depth_field_svg`] what a rig can see and how well;
//! - [`CloudFormat`] and [`Table`] are clouds for other programs; [`DenseCloud`] writes all files of a dense one, [`LatestFiles`] those of
//!   the live loop;
//! - [`drift_warning`], [`dense_drift_warning`], [`dropped_lines`] and [`cloud_json`] say what became of a pair;
//! - [`Sheet`] is a chessboard to print;
//! - [`check_ending`] refuses a file name whose ending says another format.
//!
//! Drawings and texts are pure functions of their arguments; what writes a file says so by its name.

mod cloud_report;
mod dense_cloud;
mod endings;
mod error;
mod latest_files;
mod live_report;
mod pictures;
mod points;
mod published_zones;
mod target_sheet;
mod trunk_report;

pub use cloud_report::{
    PoseSource, axes_by_images_json, axes_by_images_words, calibration_json, calibration_line, cloud_json, cloud_lines,
    dense_drift_warning, drift_warning, dropped_json, dropped_lines, pose_source_json, pose_source_line,
    pose_told_json, pose_told_words,
};
pub use dense_cloud::DenseCloud;
pub use endings::{check_ending, check_folder};
pub use error::OutputError;
pub use latest_files::LatestFiles;
pub use live_report::{live_bearings_json, live_cloud_json, live_cloud_words, point_limit_json, point_limit_words};
pub use pictures::{
    DepthView, EXACT_AT, ViewMap, ZonesOf, confidence_image, dense_svg, depth_field_svg, depth_svg, error_svg,
    match_svg, range_image, seen_by_cones, sigma_image, trunk_strip_svg, view_yaml, write_drawing, write_scored_pair,
    zones_plot, zones_svg,
};
pub use points::{CloudEncoding, CloudError, CloudFormat, DenseRow, Table, TableFormat, write_cloud};
pub use published_zones::published_zones;
pub use target_sheet::{Paper, Sheet};
pub use trunk_report::{trunk_leg_json, trunk_leg_table, trunk_path_lines};
