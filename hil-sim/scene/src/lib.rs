//! Simulated fisheye images with exact ground truth.
//!
//! A [`Scene`] is a closed room of analytic shapes with procedural textures. [`render`] takes an image of it through a
//! [`Lens`], an ideal Kannala-Brandt one or a published design that was traced, by casting rays: each pixel is the mean of rays spread over its square, then blurred by the
//! lens, exposed, made noisy and quantised as a sensor does. The range stored with each pixel is that of the ray
//! through its centre, solved in closed form. A [`Target`] alone before an even grey ([`Scene::target_alone`]) renders
//! quickly, by a monochrome camera ([`photograph_sheet`]) ten times as quickly.
//!
//! The world frame has x to the right, y down and z forward, in millimetres, so that a camera with the identity pose
//! looks forward and level. Colours are linear RGB from 0 to 1. The same arguments give the same bytes on any number of
//! threads: all randomness is a hash of the seed and of the pixel.

mod blur;
mod bundle;
mod corridor;
mod furnish;
mod hierarchy;
mod lens;
mod light;
mod optics;
mod outlook;
mod packet;
mod quick;
mod quick_bundle;
mod quick_canvas;
mod quick_edges;
mod quick_eye;
mod quick_glance;
mod quick_sensor;
mod quick_spread;
mod radiance;
mod range_map;
mod rays;
mod real;
mod render;
mod room;
mod scene;
mod shape;
mod sheet;
mod sheet_edges;
mod sheet_picture;
mod sight;
mod span;
mod target;
mod texture;
mod texture_noise;
mod trace;

pub use corridor::CorridorPlan;
pub use lens::{Lens, LensChoice, LensRays, TrueLens, UnknownLens};
pub use optics::Optics;
pub use quick::{RayTable, render_quick};
pub use range_map::RangeMap;
pub use render::{Photograph, View, render, render_rolling};
pub use scene::Scene;
pub use sheet::{MarkerBoard, Sheet, TagGrid, TagPrint};
pub use sheet_picture::{SheetView, photograph_sheet};
pub use target::Target;
pub use trace::{Hit, SurfaceId};
