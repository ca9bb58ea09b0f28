//! Camera models, rays, triangulation with covariance, and field-of-view zones.
//!
//! From pixels to points:
//!
//! - [`KannalaBrandt`] unprojects pixels to rays and projects rays to pixels, past 90°, with a pupil that moves and elements
//!   off the axis; [`OpenCvFisheye`] holds the
//!   parameters of other programs;
//! - [`CameraModel`] is what the camera models of other programs have in common with it; [`fit_lens`] makes a lens that comes near any of
//!   them, and [`KannalaBrandt::computed_by`] one that is computed by the model itself;
//! - [`ray_to_plane`] and [`dihedral`] measure how well two rays agree with the cameras' relative pose;
//! - [`pseudo_intersection`] makes a point of two rays, and [`covariance()`] gives its uncertainty;
//! - [`PointUncertainty`] adds the uncertainty that all points of a pair share, from lenses and pose;
//! - [`cloud()`] does all of this for many matches and counts the dropped ones by reason;
//! - [`BatchLens`], [`triangulate_batch`] and [`BatchPair`] do the same arithmetic for whole arrays.
//!
//! [`zones_exact`] and [`circle_zones`] compute how much of the surroundings both cameras, one, or none see.
//!
//! Conventions: millimetres and radians inside, units named at every boundary; camera frame x right, y down,
//! z forward along the optical axis; pixel (0, 0) is the centre of the top-left pixel; a ray is a unit vector with any
//! sign of z, because the lenses see past 90°, and nothing here divides by z. `left_from_right` maps coordinates in
//! the right frame to coordinates in the left frame.
//!
//! Everything is a pure function of its arguments.

mod asymmetry;
mod batch;
mod cloud;
mod covariance;
mod epipolar;
mod foreign;
mod foreign_model;
mod frames;
mod gates;
mod import;
mod invalid_lens;
mod kannala_brandt;
mod lens_derivatives;
mod lens_step;
mod match_sigma;
mod median;
mod pupil;
mod radial_series;
mod shared_covariance;
mod stand_in;
mod stereo_pair;
mod triangulation;
mod uncertainty;
mod units;
mod virtual_view;
mod zones;

pub use asymmetry::Asymmetry;
pub use batch::{
    BatchLens, BatchPair, BatchPoints, BatchTriangulation, Instructions, ProjectedPoints, triangulate_batch,
};
pub use cloud::{Cloud, CloudPoint, cloud, cloud_of_each, cloud_point};
pub use covariance::{covariance, range_sigma};
pub use epipolar::{dihedral, ray_to_plane};
pub use foreign::{
    CameraModel, Central, DoubleSphere, Eucm, Fisheye624, Formula, LensFit, LensSteps, Mei, ModelParameter, NoFit,
    OCam, ParameterUnit, Pinhole, Radtan, Sight, SightRegion, SplineGrid, SplinedStereographic, fit_lens, model_of,
};
pub use foreign_model::ForeignModel;
pub use frames::{Base, Camera, Frame, Left, Point, Right, Side, Transform, UnitRay, Virtual, World};
pub use gates::{DropReason, Gates};
pub use import::OpenCvFisheye;
pub use invalid_lens::InvalidLens;
pub use kannala_brandt::{ImageSize, InvalidImageSize, KannalaBrandt, OutsideField, Pixel};
pub use lens_derivatives::{CENTRAL_PARAMETERS, LENS_PARAMETER_NAMES, LENS_PARAMETERS};
pub use match_sigma::MatchSigma;
pub use median::median;
pub use pupil::{Pupil, SeenPoint, pupil_shift, pupil_shift_by_sine, pupil_shift_slope};
pub use shared_covariance::{SHARED_PARAMETERS, SharedCovariance};
pub use stereo_pair::{PixelPair, StereoPair};
pub use triangulation::{
    AngularNorm, Feet, Kernel, Rejection, Triangulated, UnknownKernel, angular, closest_approach, edge_plane, mid2,
    midpoint, pseudo_intersection, rectified, reprojection,
};
pub use uncertainty::{PointUncertainty, ResidualUncertainty};
pub use units::{Angle, InvalidQuantity, Length, Time};
pub use virtual_view::{Face, InvalidView, UnknownFace, VirtualView};
pub use zones::{
    Arc, BodyMask, Coverage, PAPER_FIELD, PUBLISHED_MODES, PlacedCamera, PlanarCamera, PublishedMode, SolidZones,
    ZoneMap, Zones, ZonesError, circle_zones, paper_eq3, paper_eq3_applies, solid_zones, symmetric_pair, zones_exact,
};
