//! One module per verb.

mod camera_options;
mod connect;
mod model_options;
pub mod options;
mod reconnect;
mod stage_pose;
mod target_options;

pub mod bench;
pub mod calibrate;
pub mod camera;
pub mod capture;
pub mod completions;
pub mod config;
pub mod demo;
pub mod depth;
pub mod devices;
pub mod doctor;
pub mod flash;
pub mod image;
pub mod link_test;
pub mod log;
pub mod models;
pub mod monitor;
pub mod move_to;
pub mod orders;
pub mod plan;
pub mod reproduce;
pub mod run;
pub mod sim;
pub mod soak;
pub mod status;
pub mod stop;
pub mod target;
pub mod trigger;
pub mod zones;
