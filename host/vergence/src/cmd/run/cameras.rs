//! The cameras that `vergence run` names.

use std::sync::Arc;

use tokio::sync::mpsc::Sender;
use vergence_board::HostClock;
use vergence_camera::{Camera, CameraError, CameraEvent, attach};
use vergence_rig::Rig;
use vergence_sim::{LiveCamera, Room, RoomCamera, Unplugged};
use vergence_vision::Side;

use super::Args;
use crate::failure::Failure;
use crate::live::drive;
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
            simulate(args, rig, mechanics, clock, listener);
            Ok(())
        }
        (None, [left, right]) => attach_both(args, rig, [left, right], clock, listener),
        _ => Err(Failure::usage("name the left and the right camera: --cameras /dev/video0 /dev/video2")),
    }
}

fn simulate(args: &Args, rig: &Rig, mechanics: &SharedRig, clock: HostClock, listener: &Sender<(Side, CameraEvent)>) {
    let room = Arc::new(Room::with_rig());
    let lenses = [(Side::Left, rig.left_camera), (Side::Right, rig.right_camera)];
    for ((side, lens), shutter) in lenses.into_iter().zip(rig.shutters) {
        let camera = RoomCamera { side, lens, room: Arc::clone(&room), seed: args.seed };
        let camera = LiveCamera::new(camera, shutter, &args.unplug);
        tokio::spawn(drive(camera, mechanics.clone(), clock, listener.clone()));
    }
}

fn attach_both(
    args: &Args,
    rig: &Rig,
    devices: [&String; 2],
    clock: HostClock,
    listener: &Sender<(Side, CameraEvent)>,
) -> Result<(), Failure> {
    let lenses = [rig.left_camera, rig.right_camera];
    let openers: Vec<_> = devices
        .into_iter()
        .zip(lenses)
        .zip(rig.shutters)
        .map(|((device, lens), shutter)| {
            let (device, options) = (device.clone(), args.camera.for_size(lens.size()));
            let rolling = shutter.span(lens.size().height);
            move || options.open_rolling(&device, clock, rolling)
        })
        .collect();
    let opened: Vec<Result<Box<dyn Camera>, CameraError>> = openers.iter().map(|open| open()).collect();
    if let [Err(left), Err(right)] = opened.as_slice() {
        return Err(Failure::device(format!("there is no camera: {left}\n{right}")));
    }
    for ((side, open), first) in [Side::Left, Side::Right].into_iter().zip(openers).zip(opened) {
        let mut first = Some(first);
        attach(side, move || first.take().unwrap_or_else(&open), listener.clone());
    }
    Ok(())
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
