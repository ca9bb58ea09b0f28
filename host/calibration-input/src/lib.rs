//! What a calibration is made from, and where it is kept: from pictures, CSV files and live cameras to views of targets.
//!
//! - [`views_in_images`], [`PairImages`]: targets in image files, of one camera or of a pair
//! - [`views_in_corners`], [`pairs_in_corners`], [`stage_poses_in_corners`]: CSV files of corners
//! - [`RecordedSet`], [`LiveSet`]: a set folder of stage poses, read or taken while the rig drives itself
//! - [`TargetCapture`]: a set of views of cameras that stand still
//! - [`TargetWatch`]: whether a target before live cameras is seen, held still, and worth a view
//! - [`CameraFile`], [`LensFiles`]: camera files of any format that is read
//! - [`read_rig`], [`import_rig`]: rig files, and rigs of other programs' cameras
//! - [`Slots`]: calibrations kept under names, one of them active
//!
//! Nothing is printed: functions return values and call back with events. The computations are those of
//! `vergence-calibration`, which reads no file.

mod camera_files;
mod capture;
mod corners;
mod csv_file;
mod error;
mod foreign_rig;
mod image_files;
mod input_hash;
mod lenses;
mod live;
mod points;
mod recorded;
mod store;
mod store_error;
mod target_file;
mod target_images;
mod target_watch;
mod truth;
mod views;

pub use camera_files::{CameraFile, FileLens, bare_document, camera_toml, document_of, read_camera, read_camera_file};
pub use capture::{Captured, Looked, TargetCapture, held_before};
pub use corners::{FrameView, read_corners};
pub use error::InputError;
pub use foreign_rig::{ImportedRig, import_rig, read_rig};
pub use image_files::named_images;
pub use input_hash::InputHash;
pub use lenses::{KnownLenses, LensFiles, LensFreedom};
pub use live::{LiveEvent, LiveSet, RigCameras, SimulatedTarget, printed};
pub use points::{parse_pixel, parse_ray, project, unproject};
pub use recorded::{RecordedSet, StageViews, stage_poses_in_corners};
pub use store::{Slot, SlotKind, Slots};
pub use store_error::StoreError;
pub use target_file::read_target;
pub use target_images::{Missed, MissedReason, Sought, TargetImages};
pub use target_watch::{NAMES, TargetViews, TargetWatch};
pub use truth::TrueError;
pub use views::{
    PairImages, PairLenses, PairMasks, PairViews, ViewEvent, pairs_in_corners, views_in_corners, views_in_images,
};
