//! The cameras that `vergence run` names.

use std::sync::Arc;

use tokio::sync::mpsc::Sender;
use vergence_rig::Rig;
use vergence_vision::Side;

use super::Args;
use crate::camera::{Camera, Stage};
use crate::failure::Failure;
use crate::link::HostClock;
use crate::live::{Heard, SimulatedEye, attach};
use crate::sim::SharedRig;

/// Starts both cameras; whatever they have to tell goes to `listener`.
///
/// # Errors
/// Where neither camera is there.
pub fn start(
    args: &Args,
    rig: &Rig,
    simulated: Option<&SharedRig>,
    clock: HostClock,
    listener: &Sender<Heard>,
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

fn simulate(args: &Args, rig: &Rig, mechanics: &SharedRig, clock: HostClock, listener: &Sender<Heard>) {
    let stage = Arc::new(Stage::room());
    let lenses = [(Side::Left, rig.left_camera), (Side::Right, rig.right_camera)];
    for ((side, lens), shutter) in lenses.into_iter().zip(rig.shutters) {
        let eye = SimulatedEye {
            side,
            lens,
            shutter,
            stage: Arc::clone(&stage),
            rig: mechanics.clone(),
            clock,
            seed: args.seed,
            unplugged: args.unplug.clone(),
        };
        tokio::spawn(eye.ride(listener.clone()));
    }
}

fn attach_both(
    args: &Args,
    rig: &Rig,
    devices: [&String; 2],
    clock: HostClock,
    listener: &Sender<Heard>,
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
    let opened: Vec<Result<Box<dyn Camera>, Failure>> = openers.iter().map(|open| open()).collect();
    if let [Err(left), Err(right)] = opened.as_slice() {
        return Err(Failure::device(format!("there is no camera: {left}\n{right}")));
    }
    for ((side, open), first) in [Side::Left, Side::Right].into_iter().zip(openers).zip(opened) {
        let mut first = Some(first);
        attach(side, move || first.take().unwrap_or_else(&open), listener.clone());
    }
    Ok(())
}
