//! The cameras of the live loop, attached or simulated.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use tokio::sync::mpsc::Sender;
use tokio::time::{Instant, sleep};
use vergence_board::{HostClock, Shared};
use vergence_camera::{Camera, CameraError, CameraEvent, Played, SharedTime, attach};
use vergence_rig::Shutter;
use vergence_scene::TrueLens;
use vergence_sim::{LiveCamera, Rendering, Room, RoomCamera, SimulatedRig, Unplugged};
use vergence_vision::Side;

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
/// `listener`, which is closed after the last image. Returns the images without a partner, which are left out.
///
/// # Errors
/// As of [`Played::open`].
pub fn play_both(
    paths: [&Path; 2],
    rate: f64,
    clock: HostClock,
    listener: &Sender<(Side, CameraEvent)>,
) -> Result<Vec<PathBuf>, CameraError> {
    let now: SharedTime = Arc::new(move || Duration::from_micros(clock.now().0));
    let Played { cameras, alone } = Played::open(&paths, rate, &now)?;
    for (side, camera) in [Side::Left, Side::Right].into_iter().zip(cameras) {
        let mut camera = Some(Box::new(camera) as Box<dyn Camera>);
        attach(side, move || camera.take().ok_or(CameraError::Ended), listener.clone());
    }
    Ok(alone)
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
