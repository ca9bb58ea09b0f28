//! What the robot measures in its three modes, in a simulated corridor, with joints that are not where they say.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};
use vergence_matching::{GuidedMatcher, Matcher};
use vergence_pipeline::{Method, PairCloud, PairImages, PairPose, cloud_of_pairs, pair_cloud, score};
use vergence_rig::{Rig, RigPose};
use vergence_scene::Scene;
use vergence_sim::{Room, RoomCamera};
use vergence_vision::{Angle, Kernel, Left, Length, PixelPair, Side, Transform};

const ORIGAKER: &str = include_str!("../../../docs/rigs/origaker.toml");
/// Width of the images: half of the real ones, which takes a quarter of the time.
const WIDTH: u32 = 640;

fn rig() -> Rig {
    Rig::from_toml(ORIGAKER).expect("the robot's file").with_sensors(WIDTH).expect("a sensor")
}

fn values(rig: &Rig, mode: &str) -> Vec<f64> {
    rig.mode(mode).expect("a mode").targets.iter().map(|target| target.value()).collect()
}

/// The corridor with the robot at its start.
fn corridor() -> Arc<Room> {
    let world_from_base = Transform::new(UnitQuaternion::identity(), Vector3::zeros());
    Arc::new(Room { scene: Scene::corridor(), world_from_base })
}

struct Measured {
    cloud: PairCloud,
    median: f64,
    near: f64,
    joints_alone: f64,
}

/// Photographs the corridor with the joints truly at `truth` radians and measures it with the pose that they say.
fn measure(rig: &Rig, said: &RigPose, truth: &[f64], seed: u64) -> Measured {
    let room = corridor();
    let true_pose = rig.pose_at_values(truth);
    let photograph = |side| {
        let camera = RoomCamera { side, lens: *rig.camera(side), room: Arc::clone(&room), seed };
        camera.photograph(&true_pose, 0)
    };
    let (left, right) = (photograph(Side::Left), photograph(Side::Right));
    let images = PairImages { left: &left, right: &right };
    let matcher: &dyn Matcher = &GuidedMatcher::default();
    let pose = PairPose::standing(said.clone());
    let cloud = pair_cloud(images, rig, &pose, Method::from(matcher), &mut |_| ()).expect("a cloud");
    let world_from_left = room.world_from_left(true_pose.base_from_left);
    let ranges = |cloud: &PairCloud| -> Vec<_> {
        let truth = |pixels: &PixelPair| {
            let ray = world_from_left * rig.left_camera.unproject::<Left>(pixels.left).ok()?;
            room.scene.cast(&world_from_left.origin(), &ray).map(|hit| hit.range)
        };
        cloud
            .points
            .iter()
            .map(|found| (Length::from_mm(found.point.point.mm().norm()), truth(&found.point.pixels)))
            .collect()
    };
    let scored = score(&ranges(&cloud));
    // The same matches with the pose by the joints, taken for certain.
    let pairs: Vec<_> = cloud.points.iter().map(|found| (found.point.pixels, 0.2)).collect();
    let certain = RigPose { rotation_sigma: Angle::from_deg(0.02), ..said.clone() };
    let alone = cloud_of_pairs(&pairs, &left, rig, &PairPose::standing(certain), Kernel::default()).expect("a cloud");
    Measured {
        median: scored.all.median,
        near: scored.near.median,
        joints_alone: score(&ranges(&alone)).all.median,
        cloud,
    }
}

#[test]
fn each_mode_measures_the_corridor() {
    let rig = rig();
    for mode in ["gecko", "spider", "stick-bug"] {
        let nominal = values(&rig, mode);
        let found = measure(&rig, &rig.pose_read_at(&nominal), &nominal, 1);
        println!(
            "{mode}: {} points, median {:.4}, within 1.5 m {:.4}, by the joints alone {:.4}, {:?}",
            found.cloud.points.len(),
            found.median,
            found.near,
            found.joints_alone,
            found.cloud.fused_pose.map(|fused| (fused.told_by_images, fused.rotation_sigma().deg()))
        );
        assert!(found.cloud.points.len() > 200, "{mode}: {}", found.cloud.points.len());
        assert!(found.near < 0.02, "{mode}: {}", found.near);
    }
}

/// Half a degree at a driven corner turns the cameras at gecko by four degrees.
#[test]
fn at_gecko_the_images_tell_the_pose() {
    let rig = rig();
    let nominal = values(&rig, "gecko");
    for (joint, degrees, seed) in [(0, -0.5, 3), (1, -0.5, 4), (2, -0.5, 5)] {
        let mut truth = nominal.clone();
        truth[joint] += f64::to_radians(degrees);
        let found = measure(&rig, &rig.pose_read_at(&nominal), &truth, seed);
        let fused = found.cloud.fused_pose.expect("a pose by joints and images");
        println!(
            "axis {joint} off by {degrees}: {} points, median {:.4}, by the joints alone {:.4}; images told {:.2}, {:.3}",
            found.cloud.points.len(),
            found.median,
            found.joints_alone,
            fused.told_by_images,
            fused.rotation_sigma()
        );
        assert!(
            found.median < 0.03 && found.joints_alone > 2.0 * found.median,
            "{} {}",
            found.median,
            found.joints_alone
        );
    }
}
