//! The cameras of the live loop, attached or simulated.

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::mpsc::Sender;
use tokio::time::{Instant, sleep};
use vergence_board::{HostClock, Shared};
use vergence_camera::{Camera, CameraError, CameraEvent, Played, SharedTime, attach};
use vergence_rig::{Rig, Shutter};
use vergence_scene::TrueLens;
use vergence_sim::{LiveCamera, Rendering, Room, RoomCamera, SimulatedRig, Unplug, Unplugged};
use vergence_vision::{ImageSize, Side};

use crate::LiveError;

/// Watches two attached cameras, left and right; `openers` open them, now and after each time that one was gone. Their events go
/// to `listener`.
///
/// # Errors
/// [`LiveError::NoCamera`] where neither is there now.
pub fn attach_both<O>(openers: [O; 2], listener: &Sender<(Side, CameraEvent)>) -> Result<(), LiveError>
where
    O: Fn() -> Result<Box<dyn Camera>, CameraError> + Send + 'static,
{
    let opened = match openers.each_ref().map(|open| open()) {
        [Err(left), Err(right)] => return Err(LiveError::NoCamera(Box::new([left, right]))),
        opened => opened,
    };
    for ((side, open), first) in [Side::Left, Side::Right].into_iter().zip(openers).zip(opened) {
        let mut first = Some(first);
        attach(side, move || first.take().unwrap_or_else(&open), listener.clone());
    }
    Ok(())
}

/// Plays two folders or videos, left and right, at the pace at which they were taken; `rate` numbered images make a second. Their events go to
/// `listener`, which is closed after the last image. `warn` is told of images without a partner, which are left out.
///
/// # Errors
/// As of [`Played::open`].
pub fn play_both(
    paths: [&Path; 2],
    (rate, clock): (f64, HostClock),
    listener: &Sender<(Side, CameraEvent)>,
    warn: impl FnOnce(String),
) -> Result<(), CameraError> {
    let now: SharedTime = Arc::new(move || Duration::from_micros(clock.now().0));
    let Played { cameras, alone } = Played::open(&paths, rate, &now)?;
    for (side, camera) in [Side::Left, Side::Right].into_iter().zip(cameras) {
        let mut camera = Some(Box::new(camera) as Box<dyn Camera>);
        attach(side, move || camera.take().ok_or(CameraError::Ended), listener.clone());
    }
    if let Some(first) = alone.first() {
        let first = first.display();
        warn(format!("{} images have no partner and are left out: {first} is the first", alone.len()));
    }
    Ok(())
}

/// Starts two simulated cameras, left and right with these lenses and shutters, on `mechanics` in the furnished room, and unplugs them as
/// `unplugged` says; `seed` is that of the noise of their images, which are rendered in real time. Their events go to `listener`.
pub fn simulate_both(
    cameras: [(TrueLens, Shutter); 2],
    mechanics: &Shared<SimulatedRig>,
    (seed, unplugged): (u64, &[Unplugged]),
    clock: HostClock,
    listener: &Sender<(Side, CameraEvent)>,
) {
    let room = Arc::new(Room::with_rig());
    for (side, (lens, shutter)) in [Side::Left, Side::Right].into_iter().zip(cameras) {
        let camera = RoomCamera { side, lens, room: Arc::clone(&room), seed };
        let camera = LiveCamera::new(camera, shutter, unplugged).with_rendering(Rendering::Quick);
        tokio::spawn(drive(camera, mechanics.clone(), clock, listener.clone()));
    }
}

/// Passes the events of `camera` to the listener until it is closed. `rig` carries the camera; `clock` stamps its images.
pub async fn drive(
    mut camera: LiveCamera,
    rig: Shared<SimulatedRig>,
    clock: HostClock,
    listener: Sender<(Side, CameraEvent)>,
) {
    let born = Instant::now();
    while !listener.is_closed() {
        let events = {
            let mut rig = rig.lock();
            rig.run_to_now();
            camera.poll(&rig, born.elapsed(), clock.now())
        };
        for event in events {
            if listener.send((camera.side(), event)).await.is_err() {
                return;
            }
        }
        sleep(LiveCamera::POLL_PERIOD).await;
    }
}

/// The rig whose simulated cameras take images of `size`: the same lenses before sensors of the same millimetres.
///
/// # Errors
/// [`CameraError::Simulated`] for a size of another shape than the rig file's, and with masks, which are of the file's pixels.
pub fn sized(rig: Rig, size: ImageSize) -> Result<Rig, CameraError> {
    if rig.masks.iter().any(Option::is_some) {
        let why = "--size does not scale masks: leave it out, or take a rig file without them";
        return Err(CameraError::Simulated(why.into()));
    }
    let sized = rig
        .with_sensors(size.width)
        .map_err(|error| CameraError::Simulated(format!("no lens has {} columns: {error}", size.width)))?;
    for side in [Side::Left, Side::Right] {
        let ImageSize { width, height } = sized.camera(side).size();
        if height != size.height {
            return Err(CameraError::Simulated(format!(
                "--size has another shape than the images of the {side} camera in the rig file: choose {width}x{height}"
            )));
        }
    }
    Ok(sized)
}

/// What is unplugged of the cameras; the encoders among `unplug` are unplugged from `mechanics`, which are those of `rig`.
///
/// # Errors
/// [`CameraError::Simulated`] where nothing that can be unplugged has this name.
pub fn unplugged(
    unplug: &[Unplug],
    rig: &Rig,
    mechanics: &Shared<SimulatedRig>,
) -> Result<Vec<Unplugged>, CameraError> {
    let mut cameras = Vec::new();
    for unplug in unplug {
        match unplug {
            Unplug::Camera(camera) => cameras.push(*camera),
            Unplug::Encoder { axis: name, times } => {
                let axis = rig.axes.iter().position(|axis| axis.name == *name).filter(|_| rig.trunk.is_none());
                let no = || CameraError::Simulated(format!("rig '{}' has no stage '{name}' to unplug", rig.name));
                mechanics.lock().unplug_encoder(axis.ok_or_else(no)?, *times);
            }
            // The cable knows it already.
            Unplug::Link(_) => {}
        }
    }
    Ok(cameras)
}
