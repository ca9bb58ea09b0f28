//! Errors of the simulated rig.

use vergence_control::SettingsError;
use vergence_rig::Rig;

/// Why a rig cannot be simulated, or its simulation ended.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SimError {
    /// The controller cannot work with the axes of the rig.
    #[error("rig '{rig}' cannot be simulated: {why}")]
    Axes {
        /// Name of the rig.
        rig: String,
        /// The reason why the controller refuses the settings.
        why: String,
    },
    /// The rig has no trunk that servos could move.
    #[error("rig '{0}' has no trunk: name the rig file of a robot with --rig")]
    NoTrunk(String),
    /// No wiring of the simulated chip has so many axes.
    #[error("rig '{rig}' has {axes} axes, and the wirings of the board have one to three")]
    OtherAxes {
        /// Name of the rig.
        rig: String,
        /// Number of axes of the rig.
        axes: usize,
    },
    /// A program cannot run on the chip.
    #[error("{name}: {why}")]
    Program {
        /// Name of the program.
        name: String,
        /// The reason why the file is refused.
        why: String,
    },
    /// Bytes that are not the flash of a simulated board.
    #[error("this is not the flash of a simulated board")]
    NotFlash,
    /// The board does not start with the settings in its flash.
    #[error("the board does not start with these settings: {0}")]
    Settings(String),
    /// The simulated processor stopped.
    #[error("the simulated board stopped: {0}")]
    Stopped(String),
}

/// Puts the controller's refusal of the axes of `rig` in words.
pub(crate) fn refusal(error: SettingsError, rig: &Rig) -> String {
    let name = |axis: usize| rig.axes.get(axis).map_or_else(|| axis.to_string(), |axis| format!("'{}'", axis.name));
    match error {
        SettingsError::AxisCount if rig.axes.is_empty() => "it has no axes".into(),
        SettingsError::AxisCount => format!("its controller drives no more than {} axes", vergence_protocol::MAX_AXES),
        SettingsError::NotPositive { axis } => {
            format!("a speed, scale or distance of axis {} is not positive", name(axis))
        }
        SettingsError::Range { axis } => format!("axis {} has a range that its stage cannot have", name(axis)),
        SettingsError::StepRate { axis } => {
            format!("axis {} needs more than {} steps a second", name(axis), vergence_control::LARGEST_STEP_RATE)
        }
        other => format!("its controller refuses the settings: {other}"),
    }
}
