//! The cameras that `vergence run` names.

use tokio::sync::mpsc::Sender;
use vergence_board::HostClock;
use vergence_camera::CameraEvent;
use vergence_live::{attach_both, simulate_both};
use vergence_rig::{Rig, Shutter};
use vergence_sim::Unplugged;
use vergence_vision::{KannalaBrandt, Side};

use super::Args;
use crate::failure::Failure;
use crate::sim::SharedRig;

/// Reads when a simulated camera is unplugged, in time since its start: `left@2s..4s`.
///
/// # Errors
/// Says how it is written.
pub fn parse_unplugged(text: &str) -> Result<Unplugged, String> {
    let read = || {
        let (side, times) = text.split_once('@')?;
        let (from, until) = times.split_once("..")?;
        let side = match side {
            "left" => Side::Left,
            "right" => Side::Right,
            _ => return None,
        };
        let time = |text| humantime::parse_duration(text).ok();
        Some(Unplugged { side, from: time(from)?, until: time(until)? })
    };
    read().ok_or_else(|| format!("'{text}' does not say when a camera is unplugged: write it like left@2s..4s"))
}

/// Starts both cameras; their events go to `listener`.
///
/// # Errors
/// Where neither camera is there.
pub fn start(
    args: &Args,
    rig: &Rig,
    simulated: Option<&SharedRig>,
    clock: HostClock,
    listener: &Sender<(Side, CameraEvent)>,
) -> Result<(), Failure> {
    match (simulated, args.cameras.as_slice()) {
        (Some(mechanics), _) => {
            simulate_both(rig, mechanics, (args.seed, &args.unplug), clock, listener);
            Ok(())
        }
        (None, [left, right]) => {
            let opener = |device: &String, lens: KannalaBrandt, shutter: Shutter| {
                let (device, options) = (device.clone(), args.camera.for_size(lens.size()));
                let rolling = shutter.span(lens.size().height);
                move || options.open_rolling(&device, clock, rolling)
            };
            let [left_shutter, right_shutter] = rig.shutters;
            let left = opener(left, rig.left_camera, left_shutter);
            Ok(attach_both([left, opener(right, rig.right_camera, right_shutter)], listener)?)
        }
        _ => Err(Failure::usage("name the left and the right camera: --cameras /dev/video0 /dev/video2")),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn the_time_of_unplugging_is_parsed() {
        let out = parse_unplugged("left@2s..3500ms").expect("it is well formed");
        assert_eq!((out.side, out.from, out.until.as_millis()), (Side::Left, Duration::from_secs(2), 3500));
        for wrong in ["left", "left@2s", "top@1s..2s", "left@1..2"] {
            assert!(parse_unplugged(wrong).is_err_and(|error| error.contains("left@2s..4s")), "{wrong}");
        }
    }
}
