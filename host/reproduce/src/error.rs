//! What can go wrong with an experiment.

/// Why an experiment gives no result.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ReproduceError {
    /// The built-in bench, or a variation of it, is refused.
    #[error("the simulated bench cannot be built: {0}")]
    Rig(String),
    /// The simulated views give no calibration.
    #[error("the simulated bench cannot be calibrated: {0}")]
    Calibration(String),
    /// A picture of the page cannot be encoded.
    #[error("a picture of the page cannot be encoded: {0}")]
    Picture(String),
}
