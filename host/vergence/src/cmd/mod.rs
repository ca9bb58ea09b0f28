//! One module per verb.

mod board_options;
mod camera_options;
mod connect;
mod link_figures;
mod reconnect;
pub mod report;

pub mod arm;
pub mod bench;
pub mod calibrate;
pub mod camera;
pub mod capture;
pub mod clear;
pub mod completions;
pub mod config;
pub mod demo;
pub mod depth;
pub mod devices;
pub mod disarm;
pub mod doctor;
pub mod flash;
pub mod home;
pub mod image;
pub mod link_test;
pub mod mode;
pub mod models;
pub mod monitor;
pub mod move_to;
pub mod plan;
pub mod run;
pub mod sim;
pub mod soak;
pub mod status;
pub mod stop;
pub mod target;
pub mod trigger;
pub mod zones;
