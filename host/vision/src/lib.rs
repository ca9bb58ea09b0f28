//! Rays, camera models, triangulation and field-of-view zones.
//!
//! From pixels to points:
//!
//! - [`KannalaBrandt`] turns pixels into rays and back, past 90°; [`OpenCvFisheye`] reads other programs' parameters;
//! - [`ray_to_plane`] and [`dihedral`] say how well two rays agree with the cameras' relative pose;
//! - [`pseudo_intersection`] makes a point of two rays and [`covariance()`] says how uncertain it is;
//! - [`PointUncertainty`] adds what all points of a pair share: lenses and pose;
//! - [`cloud()`] does all of this for many pairs of pixels and counts why pairs were dropped;
//! - [`pose_drift`] tells whether the pose is what the pairs say it is;
//! - [`BatchLens`], [`triangulate_batch`] and [`BatchPair`] do the arithmetic for whole arrays.
//!
//! [`study`] compares the methods of triangulation with each other.
//!
//! [`zones_exact`] and [`circle_zones`] tell how much of the surroundings both cameras, one, or none see.
//!
//! Conventions: millimetres and radians inside, units named at every boundary; camera frame x right, y down,
//! z forward along the optical axis; pixel (0, 0) is the centre of the top-left pixel; a ray is a unit vector with any
//! sign of z, because the lenses see past 90°, and nothing here divides by z. `left_from_right` maps coordinates in
//! the right frame to coordinates in the left frame.
//!
//! Everything is a pure function of its arguments.

mod batch;
mod cloud;
mod covariance;
mod epipolar;
mod frames;
mod import;
mod kannala_brandt;
mod lens_derivatives;
mod pose_drift;
pub mod study;
mod triangulation;
mod uncertainty;
mod units;
mod zones;

pub use batch::{BatchLens, BatchPair, BatchPoints, BatchTriangulation, Instructions, triangulate_batch};
pub use cloud::{Cloud, CloudPoint, Drop, Gates, PixelPair, StereoPair, cloud, cloud_of_each, cloud_point};
pub use covariance::{covariance, range_sigma};
pub use epipolar::{dihedral, ray_to_plane};
pub use frames::{Base, Camera, Frame, Left, Point, Right, Side, Transform, UnitRay, World};
pub use import::{OpenCvFisheye, largest_theta};
pub use kannala_brandt::{ImageSize, InvalidLens, KannalaBrandt, OutsideField, Pixel};
pub use lens_derivatives::LENS_PARAMETERS;
pub use pose_drift::{PoseDrift, pose_drift};
pub use triangulation::{
    AngularNorm, Feet, Kernel, Rejection, Triangulated, UnknownKernel, angular, closest_approach, edge_plane, mid2,
    midpoint, pseudo_intersection, rectified, reprojection,
};
pub use uncertainty::{PointUncertainty, ResidualUncertainty, SHARED_PARAMETERS, SharedCovariance};
pub use units::{Angle, InvalidQuantity, Length, Time};
pub use zones::{
    Arc, BodyMask, Coverage, Eye, PAPER_FIELD, PUBLISHED_MODES, PlanarCamera, PublishedMode, SolidZones, ZoneMap,
    Zones, ZonesError, circle_zones, paper_eq3, paper_eq3_applies, solid_zones, symmetric_pair, zones_exact,
};
