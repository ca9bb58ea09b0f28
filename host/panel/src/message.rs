//! Messages between page and panel.

use serde::Deserialize;
use serde_json::Value;
use vergence_rig::{AxisPosition, DepthGoal, DepthSigma, Rig};
use vergence_vision::{Angle, Length};

use crate::streams::Outgoing;

/// What a page sends, as JSON such as `{"do": "mode", "name": "human"}`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "do", rename_all = "snake_case", deny_unknown_fields)]
pub enum PageMessage {
    /// It is there, and drives or watches.
    Beat,
    /// It wants to drive.
    Take,
    /// It hands over to the page that asks, or to nobody.
    HandOver,
    /// Brake and disarm; every page may.
    Stop,
    /// Find the reference of all axes.
    Home,
    /// Clear the latched fault.
    Clear,
    /// Go to a mode of the rig.
    Mode {
        /// Its name.
        name: String,
    },
    /// Go to a position of every axis.
    Move {
        /// In millimetres or degrees, in the order of the rig's axes.
        to: Vec<f64>,
    },
    /// Find the pose that meets a goal; nothing moves.
    Plan(GoalOrder),
    /// Hold a recording that is played.
    Pause,
    /// Play it on.
    Resume,
    /// Play it from elsewhere.
    Jump {
        /// Seconds after its first event.
        to_s: f64,
    },
}

/// The goal that a page asks for.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GoalOrder {
    /// Whether `sigma_mm` limits the forward coordinate or the range.
    pub forward: bool,
    /// The largest standard deviation, in millimetres.
    pub sigma_mm: f64,
    /// The distance at which it holds, in millimetres.
    pub range_mm: f64,
    /// The directions to both sides of forward for which it holds, in degrees.
    pub half_width_deg: f64,
}

/// An order to the rig.
#[derive(Clone, Debug, PartialEq)]
pub enum Order {
    /// Find the reference of all axes.
    Home,
    /// Clear the latched fault.
    Clear,
    /// Go to this position of every axis.
    Go {
        /// In words, for the log, such as `human`.
        to: String,
        /// Number of the mode; zero for none.
        mode: vergence_protocol::Mode,
        /// The position of every axis.
        targets: Vec<AxisPosition>,
    },
}

impl GoalOrder {
    /// The goal; `None` where a number is none or makes no sense.
    #[must_use]
    pub fn goal(&self) -> Option<DepthGoal> {
        let lengths = [self.sigma_mm, self.range_mm];
        let sensible = lengths.iter().all(|length| length.is_finite() && *length > 0.0)
            && (0.0..180.0).contains(&self.half_width_deg);
        sensible.then_some(DepthGoal {
            sigma: if self.forward { DepthSigma::Forward } else { DepthSigma::Range },
            limit: Length::from_mm(self.sigma_mm),
            range: Length::from_mm(self.range_mm),
            half_width: Angle::from_deg(self.half_width_deg),
        })
    }
}

impl Order {
    /// The order to go to the mode of `rig` with this name.
    ///
    /// # Errors
    /// A sentence for people where the rig has no such mode.
    pub fn mode(rig: &Rig, name: &str) -> Result<Self, String> {
        let mode = rig.mode(name).ok_or_else(|| format!("rig '{}' has no mode '{name}'", rig.name))?;
        Ok(Self::Go { to: mode.name.clone(), mode: mode.number, targets: mode.targets.clone() })
    }

    /// The order to go to these positions, in millimetres or degrees.
    ///
    /// # Errors
    /// A sentence for people where they are not those of the axes of `rig`, or out of range.
    pub fn go(rig: &Rig, to: &[f64]) -> Result<Self, String> {
        if to.len() != rig.axes.len() || to.iter().any(|value| !value.is_finite()) {
            return Err(format!("rig '{}' has {} axes: say a position for each", rig.name, rig.axes.len()));
        }
        let position = |kind, value: f64| match kind {
            vergence_protocol::AxisKind::Linear => AxisPosition::Linear(Length::from_mm(value)),
            vergence_protocol::AxisKind::Rotary => AxisPosition::Rotary(Angle::from_deg(value)),
        };
        let targets: Vec<_> = rig.axes.iter().zip(to).map(|(axis, &value)| position(axis.kind, value)).collect();
        vergence_board::check_range(rig, &targets).map_err(|error| error.to_string())?;
        let words = rig.axes.iter().zip(&targets).map(|(axis, target)| format!("{} {target}", axis.name));
        Ok(Self::Go { to: words.collect::<Vec<_>>().join(", "), mode: vergence_protocol::Mode(0), targets })
    }
}

/// A message of a `header` in JSON and the bytes that follow it.
///
/// It begins with the length of the header, little-endian in four bytes. The header is filled up with spaces so that what follows begins
/// at a multiple of four bytes, as arrays of 32-bit numbers in a browser must.
#[must_use]
pub fn packed(header: &Value, payload: &[u8]) -> Outgoing {
    let mut text = header.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut bytes = Vec::with_capacity(4 + text.len() + payload.len());
    bytes.extend_from_slice(&(text.len() as u32).to_le_bytes());
    bytes.extend_from_slice(&text);
    bytes.extend_from_slice(payload);
    Outgoing::Binary(bytes.into())
}

#[cfg(test)]
mod tests {
    use serde_json::json;
    use vergence_rig::BENCH_TOML;

    use super::*;

    #[test]
    fn pages_are_understood_and_what_is_no_message_is_refused() {
        let read = |text: &str| serde_json::from_str::<PageMessage>(text);
        assert_eq!(read(r#"{"do": "hand_over"}"#).expect("a message"), PageMessage::HandOver);
        assert_eq!(
            read(r#"{"do": "mode", "name": "human"}"#).expect("a message"),
            PageMessage::Mode { name: "human".into() }
        );
        for wrong in ["", "{}", r#"{"do": "fly"}"#, r#"{"do": "move"}"#, r#"{"do": "move", "to": ["1"]}"#, "[1]"] {
            assert!(read(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn what_follows_a_header_begins_at_a_multiple_of_four_bytes() {
        for name in ["", "a", "ab", "abc", "abcd"] {
            let Outgoing::Binary(bytes) = packed(&json!({ "name": name }), &[1, 2, 3]) else { panic!("binary") };
            let length = u32::from_le_bytes(bytes[..4].try_into().expect("four bytes")) as usize;
            let header: Value = serde_json::from_slice(&bytes[4..4 + length]).expect("JSON");
            assert_eq!((length % 4, &header["name"], &bytes[4 + length..]), (0, &json!(name), &[1, 2, 3][..]));
        }
    }

    #[test]
    fn positions_beyond_the_range_are_refused_before_anything_is_sent() {
        let rig = Rig::from_toml(BENCH_TOML).expect("the bench");
        assert!(Order::go(&rig, &[145.0, 60.0]).is_ok() && Order::mode(&rig, "human").is_ok());
        for wrong in [&[145.0][..], &[145.0, 500.0], &[f64::NAN, 0.0], &[145.0, 60.0, 1.0]] {
            assert!(Order::go(&rig, wrong).is_err(), "{wrong:?}");
        }
        assert!(Order::mode(&rig, "owl").is_err_and(|why| why.contains("owl")));
    }

    #[test]
    fn a_goal_that_makes_no_sense_is_none() {
        let order = GoalOrder { forward: true, sigma_mm: 1.0, range_mm: 350.0, half_width_deg: 40.0 };
        let goal = order.goal().expect("a goal");
        assert_eq!(goal, "sigma_z <= 1mm at 350mm over +-40deg".parse().expect("the same in words"));
        for wrong in [
            GoalOrder { sigma_mm: 0.0, ..order },
            GoalOrder { range_mm: f64::INFINITY, ..order },
            GoalOrder { half_width_deg: 180.0, ..order },
        ] {
            assert_eq!(wrong.goal(), None);
        }
    }
}
