//! The covariance that a rig file states of the pose of a trunk, against a trunk simulated with springs and play. Play and loads are
//! simulated; nothing of it is measured on a robot.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use vergence_plant::servo::{Mechanism, ServoMoment};
use vergence_protocol::Counts;
use vergence_rig::linkage::{TrunkCameras, TrunkLinks};
use vergence_rig::{JointsAt, Rig};
use vergence_sim::{Play, Trunk, TrunkMechanics};

const SAMPLES: u64 = 150;

fn drawn() -> Rig {
    Rig::from_toml(include_str!("../../../docs/rigs/origaker.toml")).expect("the robot's file")
}

/// Of one mode, root mean squares over samples: of rotation in radians and of position in millimetres, as they are and as stated.
struct Sampled {
    mode: String,
    found: [f64; 2],
    stated: [f64; 2],
    /// Of the play of a corner, in radians.
    play: f64,
}

/// The trunk moved from spider to every mode, each time with other joints, another load and at another instant.
/// `nearest` makes a target a whole number of counts: half a count to one side of it, or to the other.
fn sample(rig: &Rig, nearest: fn(f64) -> f64) -> Vec<Sampled> {
    let trunk = rig.trunk.as_ref().expect("a trunk");
    let per_count = rig.axes[0].value_per_count();
    let mode = |mode: &vergence_rig::Mode| {
        let mut squares = [0.0; 5];
        for seed in 0..SAMPLES {
            let mut random = Pcg64Mcg::seed_from_u64(seed ^ 0x7ace);
            let play = Play::of_seed(seed);
            let loads: [f64; 5] = std::array::from_fn(|_| 0.6 * (random.random::<f64>() - 0.5));
            let seconds = 1000.0 * random.random::<f64>();
            let counts: Vec<i32> = trunk
                .axes
                .iter()
                .map(|&axis| nearest(rig.axes[axis].counts_at(mode.targets[axis].value())) as i32)
                .collect();
            // A servo stands anywhere within the step of its encoder.
            let outputs: [f64; 5] =
                std::array::from_fn(|joint| (f64::from(counts[joint]) + random.random::<f64>()) * per_count);
            let mechanics = TrunkMechanics { loads, ..TrunkMechanics::default() };
            let mut moved = Trunk::built((TrunkLinks::default(), TrunkCameras::default()), mechanics, play);
            let (from, mut torques) = (moved.outputs(), [0.0; 5]);
            for step in 1..=80 {
                let share = f64::from(step.min(60)) / 60.0;
                let angle = |joint: usize| from[joint] + share * (outputs[joint] - from[joint]);
                let moments =
                    std::array::from_fn::<_, 5, _>(|joint| ServoMoment { angle: angle(joint), velocity: 0.0 });
                moved.torques(seconds, &moments, &mut torques);
            }
            let mut read = vec![Counts(0); 5];
            trunk.axes.iter().zip(&counts).for_each(|(&axis, &counts)| read[axis] = Counts(counts));
            let pose = rig.pose(&JointsAt::latched(&read));
            let (stated, truth) = (pose.left_from_right, moved.left_from_right());
            let turn = stated.rotation().angle_to(&truth.rotation());
            let shift = (stated.origin().mm() - truth.origin().mm()).norm();
            let part = |first: usize| pose.covariance().fixed_view::<3, 3>(first, first).trace();
            let of_play = (0..3).map(|joint| play[joint].at(seconds, loads[joint]).powi(2)).sum::<f64>() / 3.0;
            for (sum, square) in squares.iter_mut().zip([turn.powi(2), shift.powi(2), part(0), part(3), of_play]) {
                *sum += square / SAMPLES as f64;
            }
        }
        let [turn, shift, stated_turn, stated_shift, play] = squares.map(f64::sqrt);
        Sampled { mode: mode.name.clone(), found: [turn, shift], stated: [stated_turn, stated_shift], play }
    };
    rig.modes.iter().map(mode).collect()
}

fn ratios(rig: &Rig, nearest: fn(f64) -> f64) -> Vec<(String, [f64; 2])> {
    let list = sample(rig, nearest).into_iter().map(|sampled| {
        let ratio = [0, 1].map(|part: usize| sampled.stated[part] / sampled.found[part]);
        println!(
            "{}: off by {:.3} deg {:.3} mm, stated {:.3} deg {:.3} mm: ratio {:.2} and {:.2}; play {:.4} deg",
            sampled.mode,
            sampled.found[0].to_degrees(),
            sampled.found[1],
            sampled.stated[0].to_degrees(),
            sampled.stated[1],
            ratio[0],
            ratio[1],
            sampled.play.to_degrees()
        );
        (sampled.mode, ratio)
    });
    list.collect()
}

/// The file assumes more play than the simulated joints have: what it states is on the safe side, and not beyond all reason.
#[test]
fn the_drawing_states_more_than_the_joints_play() {
    for (mode, ratio) in ratios(&drawn(), f64::floor) {
        assert!(ratio.iter().all(|ratio| (1.0..4.0).contains(ratio)), "{mode}: {ratio:?}");
    }
}

/// With the play that the joints have, what the file states of rotations is what is found; also at the dead centre, where it is no linear
/// function of the joints. Of positions it is up to twice: two simulated folds between corners that play hold each other, and cameras
/// rise and sink less than the play of one fold lets them.
#[test]
fn the_covariance_is_that_of_the_play_in_the_file() {
    for (mode, ratio) in ratios(&with_play_of_the_joints(), f64::floor) {
        assert!((0.8..1.25).contains(&ratio[0]) && (0.8..2.0).contains(&ratio[1]), "{mode}: {ratio:?}");
    }
}

/// Held half a count beyond the dead centre the links press, and all joints together lean to where there is room: their play is no
/// longer each its own, as the covariance takes it. It then states too little; by how much is held here.
#[test]
fn pressed_beyond_the_dead_centre_the_covariance_is_too_small() {
    for (mode, ratio) in ratios(&with_play_of_the_joints(), f64::ceil) {
        assert!(ratio[0] > if mode == "gecko" { 0.6 } else { 0.8 }, "{mode}: {ratio:?}");
    }
}

/// The drawing with the play that the simulated joints have.
fn with_play_of_the_joints() -> Rig {
    let mut rig = drawn();
    let play = sample(&rig, f64::floor)[0].play;
    rig.trunk.as_mut().expect("a trunk").passive_play = 0.0;
    rig.axes.iter_mut().for_each(|axis| axis.play = 2.0 * play);
    rig
}
