//! Why parameters are those of no lens.

use crate::Angle;

/// Why a set of parameters describes no lens.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InvalidLens {
    /// A parameter is infinite or not a number.
    #[error("a camera parameter is not a finite number")]
    NotFinite,
    /// k1 (the focal length in pixels) or the aspect ratio is not positive.
    #[error("focal lengths must be positive")]
    FocalLength,
    /// theta_max is not in (0°, 180°).
    #[error("theta_max is {0:.2}, it must lie between 0° and 180°")]
    ThetaMax(Angle),
    /// The radius stops growing inside the stated field, so that a pixel there would have two rays.
    #[error(
        "the lens polynomial turns over at {turn:.2}, inside theta_max = {stated:.2}: reduce theta_max or recalibrate"
    )]
    TurnsOver {
        /// Field angle at which dr/dθ first reaches zero.
        turn: Angle,
        /// The stated limit of the field.
        stated: Angle,
    },
    /// A parameter of another program's model breaks a rule.
    #[error("{name} is {value}, it must {rule}")]
    OutOfRange {
        /// Name of the parameter.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must do.
        rule: &'static str,
    },
    /// The image of another program's model folds over at its axis.
    #[error("the image folds over at the optical axis: the parameters are those of no camera")]
    FoldsAtAxis,
    /// A name that is none of a camera model.
    #[error(
        "the camera's model has a name that is not known: double sphere, enhanced unified, omnidirectional (Mei), FISHEYE624, OCamCalib, \
         pinhole and splined stereographic are"
    )]
    UnknownModel,
    /// Values that are not exactly the parameters of their model.
    #[error("the values of the camera's model '{0}' are not its parameters: each must be there once, and nothing else")]
    ModelValues(&'static str),
    /// Decentring and thin prism are so large that two rays of the field share a pixel.
    #[error("the tangential and prism coefficients fold the image inside theta_max: reduce theta_max or recalibrate")]
    Folds,
}
