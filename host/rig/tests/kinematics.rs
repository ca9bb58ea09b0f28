//! Kinematics: the poses of the cameras by the positions of the axes.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

use nalgebra::{Matrix3, Matrix4, Vector3};
use proptest::prelude::*;
use vergence_rig::{BENCH_TOML, JointsAt, Rig, RigCalibration};

fn bench() -> Rig {
    Rig::from_toml(BENCH_TOML).expect("the built-in rig is right")
}

/// The bench with pinions 20 mm behind the optical centres and a tilted, displaced right camera.
fn crooked_bench() -> Rig {
    let at_zero = "[right.at_zero]\norigin = [\"1.5mm\", \"-0.4mm\", \"2mm\"]\n\
                   rotation_vector = [\"0.5deg\", \"-0.3deg\", \"1deg\"]\n[[left.screw]]";
    let toml = BENCH_TOML
        .replace("through = [\"0mm\", \"0mm\", \"0mm\"]", "through = [\"0mm\", \"0mm\", \"-20mm\"]")
        .replacen("[[left.screw]]", at_zero, 1);
    Rig::from_toml(&toml).expect("a rig")
}

fn close(got: Vector3<f64>, expected: [f64; 3]) {
    assert!((got - Vector3::from(expected)).norm() < 1e-9, "{got:?} is not {expected:?}");
}

#[test]
fn in_human_mode_the_cameras_look_the_same_way() {
    let pose = bench().pose_at_values(&[145.0, 0.0]);
    close(pose.left_from_right.origin().mm(), [145.0, 0.0, 0.0]);
    assert!(pose.left_from_right.rotation().angle() < 1e-12);
}

#[test]
fn in_herbivore_mode_each_camera_has_turned_outward_by_half() {
    let pose = bench().pose_at_values(&[145.0, 120f64.to_radians()]);
    // The left axis points 60° to the left of forward, so forward is to the right of it, and the right camera lies
    // to the right and behind: 145 (cos 60°, 0, -sin 60°).
    close(pose.base_from_left.rotation() * Vector3::z(), [-60f64.to_radians().sin(), 0.0, 0.5]);
    close(pose.left_from_right.origin().mm(), [72.5, 0.0, -145.0 * 60f64.to_radians().sin()]);
    let turn = pose.left_from_right.rotation().scaled_axis();
    close(turn, [0.0, 120f64.to_radians(), 0.0]);
    let there_and_back = pose.left_from_right * pose.right_from_left();
    close(there_and_back.origin().mm(), [0.0; 3]);
}

/// exp of a twist as a power series of a 4 x 4 matrix, with none of the chain's own formulas.
fn exponential(twist: Matrix4<f64>) -> Matrix4<f64> {
    let (mut sum, mut term) = (Matrix4::identity(), Matrix4::identity());
    for n in 1..60 {
        term = term * twist / f64::from(n);
        sum += term;
    }
    sum
}

fn turn_about_y_behind(amount: f64) -> Matrix4<f64> {
    let omega = Matrix3::new(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0) * amount;
    let mut twist = Matrix4::zeros();
    twist.fixed_view_mut::<3, 3>(0, 0).copy_from(&omega);
    twist.fixed_view_mut::<3, 1>(0, 3).copy_from(&(-omega * Vector3::new(0.0, 0.0, -20.0)));
    exponential(twist)
}

proptest! {
    /// Brockett's product of exponentials, summed as a power series.
    #[test]
    fn the_chain_is_a_product_of_exponentials(baseline in 60.0..220.0f64, separation in 0.0..2.2f64) {
        let rig = crooked_bench();
        let pose = rig.pose_at_values(&[baseline, separation]);
        let left = turn_about_y_behind(-0.5 * separation);
        let zero = nalgebra::Isometry3::new(
            Vector3::new(1.5, -0.4, 2.0),
            Vector3::new(0.5, -0.3, 1.0).map(f64::to_radians),
        );
        let slide = Matrix4::new_translation(&Vector3::new(baseline, 0.0, 0.0));
        let right = slide * turn_about_y_behind(0.5 * separation) * zero.to_homogeneous();
        let expected = left.try_inverse().expect("rigid") * right;
        let got = pose.left_from_right.isometry().to_homogeneous();
        prop_assert!((got - expected).norm() < 1e-9, "{} {}", got, expected);
    }

    /// The standard deviations of the joints add to those of the calibration.
    #[test]
    fn joint_sigma_becomes_pose_sigma(x in 120_000.0..440_000.0f64, s in 0.0..36_000.0f64, dx in 0.0..50.0f64, ds in 0.0..50.0f64) {
        let mut rig = bench();
        rig.calibration = RigCalibration::exact();
        let pose = rig.pose(&JointsAt { counts: vec![x, s], sigma: vec![dx, ds], timing: vec![0.0; 2] });
        // The separation turns the relative pose one to one; both cameras sit on their pinions.
        let turned = ds * std::f64::consts::TAU / 100_000.0;
        prop_assert!((pose.rotation_sigma.rad() - turned).abs() < 1e-9);
        // In the right camera's frame the right camera moves by dx along the slide; the turn moves the left centre only
        // together with the frame: half of it acts before the slide.
        let baseline = rig.axes[0].value_at(x);
        let moved = (dx * 0.0005).hypot(baseline * turned / 2.0);
        prop_assert!((pose.translation_sigma.mm() - moved).abs() < 1e-3 * moved + 1e-9, "{:?} {}", pose, moved);
    }
}
