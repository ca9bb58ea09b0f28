//! Closed loops of links: the folding trunk that carries a robot's cameras.
//!
//! A [`Loop`] is a chain of revolute joints in Craig's modified Denavit-Hartenberg form (J. Craig, *Introduction to
//! Robotics*, 3rd ed., §3.4) whose product is the identity. Of its joints some are driven; the others follow. The paper's
//! trunk is [`trunk`]: eight links, of which two pairs fold against each other.
//!
//! With both folds flat the trunk is a planar six-bar, which [`SixBar`] solves in closed form. [`Loop::close`] solves any loop
//! from a start near the answer. Where both apply they agree (`tests/linkage.rs`).

mod bodies;
mod cameras;
mod clearance;
mod closing;
mod dh;
mod folded;
mod mobility;
mod path;
mod shape;
mod six_bar;
mod trunk;

pub use bodies::{Gap, TrunkBodies, TrunkBody};
pub use cameras::{CameraMount, TrunkCameras};
pub use clearance::{Clearance, CornerLimits, FlatTrunk, WantedClearance};
pub use closing::{CloseError, Closed};
pub use dh::{DhJoint, Loop};
pub use folded::FoldingTrunk;
pub use mobility::{Mobility, NotDriven};
pub use path::{Branch, Leg, LegSample, NoPath, PathEnd, TrunkPath};
pub use shape::TrunkShape;
pub use six_bar::{Corners, SixBar, SixBarError};
pub use trunk::{TrunkJoint, TrunkLinks, trunk};
