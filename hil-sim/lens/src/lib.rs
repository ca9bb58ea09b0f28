//! True lenses of the simulation: published fisheye designs, traced surface by surface.
//!
//! A real fisheye lens has no centre of projection: the point where its chief rays cross the axis moves towards the scene as their angle
//! to the axis grows. A [`Design`] holds the surfaces of such a lens and traces rays through them; [`ChiefRays`] is what a camera needs of
//! it: image height, shift of the entrance pupil and illumination over the angle. [`LensTable`] adds the spots, and a [`TracedLens`] is that
//! table before a sensor: pixel to ray with its origin, point to pixel, corners of a target to pixels. Nothing here is shared with the lens models of the
//! estimator, so that a calibration never meets its own formulas.
//!
//! Coordinates of a design: z runs along the axis from the vertex of the first surface towards the image, in millimetres. The scene lies at
//! negative z. Coordinates of a camera: z runs towards the scene, from the paraxial entrance pupil.
//!
//! Source of the formulas: W. T. Welford, Aberrations of Optical Systems, 1986, chapters 3 (paraxial rays) and 4 (finite rays).

mod beam;
mod chief_rays;
mod curve;
mod design;
mod displaced;
mod error;
mod paraxial;
mod surface;
mod table;
mod trace;
mod traced;

pub use beam::Spot;
pub use chief_rays::ChiefRays;
pub use design::{BuiltIn, Design};
pub use displaced::{DisplacedDesign, Displacement};
pub use error::{DesignError, LostRay};
pub use surface::Ray;
pub use table::LensTable;
pub use trace::Limits;
pub use traced::{ImageScale, LensRay, Sensor, TracedLens};
