//! Rays, camera models, triangulation and field-of-view zones.
//!
//! Conventions: millimetres and radians inside, units named at every boundary; camera frame x right, y down,
//! z forward along the optical axis; pixel (0, 0) is the centre of the top-left pixel; a ray is a unit vector with any
//! sign of z, because the lenses see past 90°, and nothing here divides by z. `left_from_right` maps coordinates in
//! the right frame to coordinates in the left frame.
//!
//! Everything is a pure function of its arguments.

mod frames;
mod kannala_brandt;
mod units;

pub use frames::{Base, Camera, Frame, Left, Point, Right, Transform, UnitRay, World};
pub use kannala_brandt::{ImageSize, InvalidLens, KannalaBrandt, OutsideField, Pixel};
pub use units::{Angle, InvalidQuantity, Length};
