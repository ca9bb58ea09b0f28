//! What is unplugged of a simulated rig for a while: a camera, or the encoder of an axis.

use std::str::FromStr;
use std::time::Duration;

use vergence_vision::Side;

/// A time span during which a simulated camera is unplugged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unplugged {
    /// Side of the camera.
    pub side: Side,
    /// Age of the camera at which it is unplugged.
    pub from: Duration,
    /// Age of the camera at which it is plugged in again.
    pub until: Duration,
}

/// What is unplugged for a while, as `left@2s..4s` or `separation@2s..4s`, in time since the start.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unplug {
    /// A camera.
    Camera(Unplugged),
    /// The encoder of an axis: its count stays as it is, and what is moved meanwhile is never counted.
    Encoder {
        /// Name of the axis.
        axis: String,
        /// When it is unplugged, and plugged in again.
        times: [Duration; 2],
    },
    /// The cable between host and board.
    Link([Duration; 2]),
}

impl FromStr for Unplug {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = || {
            let (what, times) = text.split_once('@')?;
            let (from, until) = times.split_once("..")?;
            let times = [humantime::parse_duration(from).ok()?, humantime::parse_duration(until).ok()?];
            let camera = |side| Self::Camera(Unplugged { side, from: times[0], until: times[1] });
            Some(match what {
                "" => return None,
                "left" => camera(Side::Left),
                "right" => camera(Side::Right),
                "link" => Self::Link(times),
                axis => Self::Encoder { axis: axis.to_owned(), times },
            })
        };
        read().ok_or_else(|| {
            format!("'{text}' does not say what is unplugged and when: write it like left@2s..4s, separation@2s..4s or link@2s..4s")
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test may fail")]

    use super::*;

    #[test]
    fn what_is_unplugged_and_when_is_read() {
        let times = [Duration::from_secs(2), Duration::from_millis(3500)];
        let camera = Unplug::Camera(Unplugged { side: Side::Left, from: times[0], until: times[1] });
        assert_eq!("left@2s..3500ms".parse(), Ok(camera));
        assert_eq!("link@2s..3500ms".parse(), Ok(Unplug::Link(times)));
        assert_eq!("elbow@2s..3500ms".parse(), Ok(Unplug::Encoder { axis: "elbow".into(), times }));
        for wrong in ["left", "left@2s", "@1s..2s", "left@1..2"] {
            assert!(wrong.parse::<Unplug>().is_err_and(|error| error.contains("left@2s..4s")), "{wrong}");
        }
    }
}
