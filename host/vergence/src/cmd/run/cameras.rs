//! The cameras that `vergence run` names.

use tokio::sync::mpsc::Sender;
use vergence_board::HostClock;
use vergence_camera::CameraEvent;
use vergence_live::{attach_both, simulate_both};
use vergence_rig::{Rig, Shutter};
use vergence_scene::TrueLens;
use vergence_sim::Unplug;
use vergence_vision::{KannalaBrandt, Side};

use super::Args;
use crate::failure::Failure;
use crate::sim::SharedRig;

/// Starts both cameras, simulated ones on these mechanics with these lenses, and unplugs what shall be unplugged; their events go to `listener`.
///
/// # Errors
/// Where neither camera is there, or nothing that can be unplugged has this name.
pub fn start(
    args: &Args,
    rig: &Rig,
    simulated: Option<(&SharedRig, [TrueLens; 2])>,
    clock: HostClock,
    listener: &Sender<(Side, CameraEvent)>,
) -> Result<(), Failure> {
    match (simulated, args.cameras.as_slice()) {
        (Some((mechanics, [left, right])), _) => {
            let mut unplugged = Vec::new();
            for unplug in &args.unplug {
                match unplug {
                    Unplug::Camera(camera) => unplugged.push(*camera),
                    Unplug::Encoder { axis: name, times } => {
                        let axis = rig.axes.iter().position(|axis| axis.name == *name).filter(|_| rig.trunk.is_none());
                        let no = || Failure::usage(format!("rig '{}' has no stage '{name}' to unplug", rig.name));
                        mechanics.lock().unplug_encoder(axis.ok_or_else(no)?, *times);
                    }
                }
            }
            let [left_shutter, right_shutter] = rig.shutters;
            let cameras = [(left, left_shutter), (right, right_shutter)];
            simulate_both(cameras, mechanics, (args.seed, &unplugged), clock, listener);
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
