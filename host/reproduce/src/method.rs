//! The methods that stand side by side.

/// How the depth of a corner is measured. The paper does not say how its pairs were calibrated; what each method does here is
/// what it must have done at least.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Both pictures are undistorted by a calibration of each lens into pictures of a pinhole; corners are found there, the
    /// pair is calibrated there as two pinhole cameras with radial distortion, and the disparity gives the depth.
    Rectified,
    /// Corners of the fisheye pictures; a pair calibrated where it measures from ten targets, by a bundle of rays for each
    /// target and camera and the rigid transform between the points; the middle between the rays.
    Midpoint,
    /// The same corners and pair; the pseudo-intersection.
    PseudoIntersection,
    /// The same corners; lenses and stage calibrated together from many poses; the pseudo-intersection at the pose that the
    /// encoders read.
    Ours,
}

/// All of them, in the order of the tables.
pub const METHODS: [Method; 4] = [Method::Rectified, Method::Midpoint, Method::PseudoIntersection, Method::Ours];

impl Method {
    /// The name in tables.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Rectified => "rectified",
            Self::Midpoint => "midpoint",
            Self::PseudoIntersection => "pseudo-intersection",
            Self::Ours => "ours",
        }
    }
}
