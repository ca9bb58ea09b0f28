//! Axes whose position is known badly when photographs were taken, because an encoder died or nobody wrote it down.

use std::str::FromStr;

use vergence_alignment::FusedPose;
use vergence_camera::CameraImage;
use vergence_matching::Matcher;
use vergence_pipeline::{AxisByImages, PairImages, Search, axes_by_images, axes_told};
use vergence_rig::{AxisPosition, JointsAt, Rig};
use vergence_vision::Length;

use crate::failure::Failure;

/// The axes that the images are asked for.
#[derive(Clone, Debug, clap::Args)]
pub struct Uncertain {
    /// An axis whose position is known badly, and the standard deviation of it, such as separation=2deg: the images tell it, as far as
    /// they can. Without a standard deviation the axis may stand anywhere in its range, and its position need not be given.
    #[arg(long, value_name = "AXIS[=SIGMA]", conflicts_with_all = ["points", "baseline_speed", "separation_speed"])]
    uncertain: Vec<UncertainAxis>,
}

/// An axis, and how well it is known.
#[derive(Clone, Debug, PartialEq)]
struct UncertainAxis {
    name: String,
    sigma: Option<AxisPosition>,
}

impl FromStr for UncertainAxis {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let Some((name, sigma)) = text.split_once('=') else { return Ok(Self { name: text.into(), sigma: None }) };
        let angle = sigma.parse().map(AxisPosition::Rotary);
        let sigma: Result<_, _> = angle.or_else(|_| sigma.parse::<Length>().map(AxisPosition::Linear));
        match sigma {
            Ok(sigma) if sigma.value() > 0.0 => Ok(Self { name: name.into(), sigma: Some(sigma) }),
            _ => Err(format!("'{text}' does not say how well an axis is known: write it like separation=2deg")),
        }
    }
}

impl Uncertain {
    /// Whether all axes are known.
    pub fn is_empty(&self) -> bool {
        self.uncertain.is_empty()
    }

    /// Puts an axis that may stand anywhere, and of which no position is given, into the middle of its range.
    pub fn fill(&self, rig: &Rig, positions: &mut [Option<AxisPosition>]) {
        for (axis, position) in rig.axes.iter().zip(positions) {
            if position.is_none() && self.uncertain.iter().any(|of| of.name == axis.name && of.sigma.is_none()) {
                let [low, high] = axis.range.map(AxisPosition::value);
                *position = Some(AxisPosition::from_value(axis.kind, 0.5 * (low + high)));
            }
        }
    }

    /// The joints with the axes at `values`, the uncertain ones as uncertain as they are said to be.
    ///
    /// # Errors
    /// An axis that the rig does not have, or of another kind.
    pub fn joints(&self, rig: &Rig, values: &[f64]) -> Result<JointsAt, Failure> {
        let counts = rig.axes.iter().zip(values).map(|(axis, &value)| axis.counts_at(value)).collect();
        let none = vec![0.0; rig.axes.len()];
        let mut joints = JointsAt { counts, sigma: none.clone(), timing: none };
        for UncertainAxis { name, sigma } in &self.uncertain {
            let found = rig.axes.iter().zip(&mut joints.sigma).find(|(axis, _)| axis.name == *name);
            let Some((axis, of_axis)) = found else {
                let names: Vec<_> = rig.axes.iter().map(|axis| axis.name.as_str()).collect();
                let names = names.join(", ");
                return Err(Failure::usage(format!("rig '{}' has no axis '{name}', but {names}", rig.name)));
            };
            let counts = match sigma {
                Some(sigma) if !sigma.is_of(axis.kind) => {
                    return Err(Failure::usage(format!("axis '{name}' of rig '{}' is of another kind", rig.name)));
                }
                Some(sigma) => sigma.value() / axis.value_per_count(),
                None => axis.sigma_of_range(),
            };
            *of_axis = counts;
        }
        Ok(joints)
    }

    /// Narrows `joints` to what a pair of photographs tells of them.
    ///
    /// # Errors
    /// Where the images are not of these cameras, or tell nothing of the axes.
    pub fn narrowed(
        &self,
        [left, right]: [&CameraImage; 2],
        (rig, search): (&Rig, &Search),
        joints: &JointsAt,
        matcher: &dyn Matcher,
    ) -> Result<JointsAt, Failure> {
        let images = PairImages { left: &left.image, right: &right.image };
        let found = axes_by_images(images, (rig, search), joints, matcher)
            .map_err(|error| Failure::usage(format!("{} and {}: {error}", left.name, right.name)))?;
        found.ok_or_else(|| {
            let names: Vec<_> = self.uncertain.iter().map(|axis| axis.name.as_str()).collect();
            Failure::check(format!(
                "{} and {} do not tell {}: fewer than 20 matches agree wherever it may stand; give a position nearer to the truth, or \
                 images with more texture in the field that both cameras see",
                left.name,
                right.name,
                names.join(", ")
            ))
        })
    }

    /// Where the uncertain axes stand by joints and images together.
    pub fn told(&self, rig: &Rig, joints: &JointsAt, fused: Option<&FusedPose>) -> Vec<AxisByImages> {
        let is_named = |&index: &usize| self.uncertain.iter().any(|of| of.name == rig.axes[index].name);
        let axes: Vec<_> = (0..rig.axes.len()).filter(is_named).collect();
        axes_told(rig, joints, fused, &axes)
    }
}

#[cfg(test)]
mod tests {
    use vergence_vision::Angle;

    use super::*;

    #[test]
    fn an_axis_and_its_standard_deviation_are_read() {
        let read = |text: &str| text.parse::<UncertainAxis>();
        assert_eq!(read("separation").map(|axis| (axis.name, axis.sigma)), Ok(("separation".into(), None)));
        let sigma = Some(AxisPosition::Rotary(Angle::from_deg(2.0)));
        assert_eq!(read("separation=2deg").map(|axis| axis.sigma), Ok(sigma));
        let sigma = Some(AxisPosition::Linear(Length::from_mm(5.0)));
        assert_eq!(read("baseline=5mm").map(|axis| axis.sigma), Ok(sigma));
        for wrong in ["separation=", "separation=2", "separation=-2deg", "separation=0deg"] {
            assert!(read(wrong).is_err_and(|error| error.contains("separation=2deg")), "{wrong}");
        }
    }
}
