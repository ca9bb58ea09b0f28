//! Goals of depth accuracy, such as `sigma_z <= 1mm at 350mm over +-40deg`.

use std::fmt;
use std::str::FromStr;

use vergence_vision::{Angle, Length};

/// The standard deviation that a [`DepthGoal`] limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthSigma {
    /// `sigma_z`, of the coordinate along forward.
    Forward,
    /// `sigma_range`, of the distance from the middle of both cameras.
    Range,
}

/// A limit of the standard deviation of depth, in the horizontal plane at one range, over azimuths around forward.
///
/// ```
/// # use vergence_rig::DepthGoal;
/// let goal: DepthGoal = "sigma_z <= 1mm at 350mm over +-40deg".parse()?;
/// assert_eq!((goal.limit.mm(), goal.range.mm()), (1.0, 350.0));
/// # Ok::<(), vergence_rig::InvalidGoal>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthGoal {
    /// The standard deviation that is limited.
    pub sigma: DepthSigma,
    /// Largest allowed standard deviation.
    pub limit: Length,
    /// Distance from the middle of both cameras.
    pub range: Length,
    /// Largest azimuth to each side of forward.
    pub half_width: Angle,
}

/// Error of parsing a [`DepthGoal`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is no goal: write it as 'sigma_z <= 1mm at 350mm over +-40deg' (or sigma_range)")]
pub struct InvalidGoal(String);

impl FromStr for DepthGoal {
    type Err = InvalidGoal;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        parse(text).ok_or_else(|| InvalidGoal(text.to_owned()))
    }
}

fn parse(text: &str) -> Option<DepthGoal> {
    let (sigma, rest) = text.split_once("<=")?;
    let (limit, rest) = rest.split_once(" at ")?;
    let (range, width) = rest.split_once(" over ")?;
    let sigma = match sigma.trim() {
        "sigma_z" => DepthSigma::Forward,
        "sigma_range" => DepthSigma::Range,
        _ => return None,
    };
    let width = width.trim();
    let half_width: Angle = width.strip_prefix("+-").or_else(|| width.strip_prefix('±'))?.parse().ok()?;
    let (limit, range): (Length, Length) = (limit.parse().ok()?, range.parse().ok()?);
    let sensible = limit.mm() > 0.0 && range.mm() > 0.0 && (0.0..180.0).contains(&half_width.deg());
    sensible.then_some(DepthGoal { sigma, limit, range, half_width })
}

impl fmt::Display for DepthGoal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self.sigma {
            DepthSigma::Forward => "sigma_z",
            DepthSigma::Range => "sigma_range",
        };
        let [limit, range, half_width] = [self.limit.mm(), self.range.mm(), self.half_width.deg()].map(typed);
        write!(f, "{name} <= {limit} mm at {range} mm over ±{half_width}°")
    }
}

/// A number as it was typed, without the last digits that the conversion of units has put behind it.
fn typed(value: f64) -> f64 {
    const DIGITS: f64 = 1e9;
    (value * DIGITS).round() / DIGITS
}
