//! What can go wrong with an experiment.

use vergence_board::BoardError;
use vergence_sim::SimError;

/// Why an experiment gives no result.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
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
    /// The simulated rig cannot be started.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// The simulated board does not do what it is asked.
    #[error(transparent)]
    Board(#[from] BoardError),
}

/// Why the demonstration measures nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DemoError {
    /// The board does not do what it is asked.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// The simulated robot cannot be started.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// No pulse came to the simulated cameras.
    #[error("the simulated cameras were not triggered")]
    NotTriggered,
    /// The images give no matches.
    #[error("the simulated images cannot be matched: {0}")]
    Matching(String),
    /// The pose has no zones.
    #[error("the zones of this pose: {0}")]
    Zones(String),
    /// A file cannot be written.
    #[error("{0}")]
    File(String),
    /// Pulse and images do not tell where the cameras were.
    #[error("the pose at the exposure is unknown: {0}")]
    UnknownPose(String),
}
