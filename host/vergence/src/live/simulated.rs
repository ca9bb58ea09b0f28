//! Drives a simulated camera of the live loop with the clock.

use tokio::sync::mpsc::Sender;
use tokio::time::{Instant, sleep};
use vergence_board::HostClock;
use vergence_camera::CameraEvent;
use vergence_sim::LiveCamera;
use vergence_vision::Side;

use crate::sim::SharedRig;

/// Passes the events of `camera` to the listener until it is closed. `rig` carries the camera; `clock` stamps its images.
pub async fn drive(mut camera: LiveCamera, rig: SharedRig, clock: HostClock, listener: Sender<(Side, CameraEvent)>) {
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
