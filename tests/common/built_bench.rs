//! A bench that was not built as drawn, what its encoders read: the truth for tests of
//! whole calibrations.

use nalgebra::Vector3;
use vergence_rig::{BENCH_TOML, Rig, RigPose};
use vergence_vision::{Angle, Asymmetry, KannalaBrandt, OpenCvFisheye, Pupil};

/// Baseline in millimetres and separation in degrees of the stage poses that calibrate.
pub const POSES: [[f64; 2]; 6] =
    [[60.0, 0.0], [220.0, 0.0], [60.0, 126.0], [220.0, 126.0], [140.0, 63.0], [145.0, 115.0]];

/// Numbers from -1 to 1, evenly and about normally distributed.
pub struct Dice(u64);

impl Dice {
    pub fn new(seed: u64) -> Self {
        let mut dice = Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ 0xca1b);
        (0..8).for_each(|_| _ = dice.uniform());
        dice
    }

    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| 0.5 * self.uniform()).sum()
    }

    pub fn vector(&mut self) -> Vector3<f64> {
        Vector3::new(self.normal(), self.normal(), self.normal())
    }
}

/// The bench as a workshop leaves it: lenses, screws, scales and mounts off the drawing.
pub fn as_built(dice: &mut Dice) -> Rig {
    let mut line = |mm: f64| {
        let at = mm * dice.vector();
        format!("through = [\"{}mm\", \"{}mm\", \"{}mm\"]", at.x, at.y, at.z)
    };
    let (left, right) = (line(2.0), line(2.0));
    let through = "through = [\"0mm\", \"0mm\", \"0mm\"]";
    let mut tilted = |x: f64, y: f64, z: f64| {
        let off = 0.008 * dice.vector();
        format!("[{}, {}, {}]", x + off.x, y + off.y, z + off.z)
    };
    let text = BENCH_TOML
        .replace("slide_along = [1.0, 0.0, 0.0]", &format!("slide_along = {}", tilted(1.0, 0.0, 0.0)))
        .replacen("turn_about = [0.0, 1.0, 0.0]", &format!("turn_about = {}", tilted(0.0, 1.0, 0.0)), 1)
        .replacen(through, &left, 1)
        .replacen(through, &right, 1)
        .replace("share = 1.0", &format!("share = {}", 1.0 + 0.002 * dice.normal()));
    let (origin, turn) = (1.5 * dice.vector(), 0.008 * dice.vector());
    let at_zero = format!(
        "[right.at_zero]\norigin = [\"{}mm\", \"{}mm\", \"{}mm\"]\nrotation_vector = [\"{}rad\", \"{}rad\", \"{}rad\"]\n",
        origin.x, origin.y, origin.z, turn.x, turn.y, turn.z
    );
    let rig = Rig::from_toml(&(text + &at_zero)).expect("a rig");
    let (left_camera, right_camera) = (lens(&rig.left_camera, dice), lens(&rig.right_camera, dice));
    Rig { left_camera, right_camera, ..rig }
}

fn lens(drawn: &KannalaBrandt, dice: &mut Dice) -> KannalaBrandt {
    let OpenCvFisheye { fx, cx, cy, k, .. } = drawn.to_opencv();
    let fx = fx * (1.0 + 0.005 * dice.normal());
    let off = [2e-3, 1e-3, 3e-4, 5e-5].map(|sigma| sigma * dice.normal());
    let k = std::array::from_fn(|index| k[index] + off[index]);
    let lens = OpenCvFisheye { fx, fy: fx, cx: cx + 3.0 * dice.normal(), cy: cy + 3.0 * dice.normal(), k };
    KannalaBrandt::from_opencv(lens, Angle::from_deg(97.0), drawn.size()).expect("a lens")
}

/// The bench with lenses as they are made and mounted: each with a pupil that moves, and with decentring and thin prism of a share, anywhere between
/// none and all, of those that traced lenses with displaced elements have (docs/measured/lenses.md, "What lenses have before any view").
pub fn mounted(rig: Rig, dice: &mut Dice) -> Rig {
    let mut lens = |lens: KannalaBrandt| {
        let share = 0.5 + 0.5 * dice.uniform();
        let mut draw = |sigma: f64| share * sigma * dice.normal();
        let mut along = || {
            let p = draw(6.2e-4);
            let square = -1.5 * p + draw(8.4e-4);
            let fourth = 0.38 * p + 0.32 * square + draw(1.7e-4);
            [p, square, fourth, 0.073 * p + 0.027 * square - 0.60 * fourth + draw(4.2e-5)]
        };
        let ([p1, s0, s1, p3], [p2, s2, s3, p4]) = (along(), along());
        let pupil = Pupil::from_mm([1.5 + 1.5 * dice.uniform(), 0.3 * dice.normal()]);
        let asymmetry = Asymmetry::from_array([p1, p2, s0, s1, s2, s3, p3, p4]);
        lens.with_pupil(pupil).and_then(|lens| lens.with_asymmetry(asymmetry)).expect("a lens")
    };
    let (left_camera, right_camera) = (lens(rig.left_camera), lens(rig.right_camera));
    Rig { left_camera, right_camera, ..rig }
}

/// What the encoders read, in millimetres and radians, near a wished pose, and the true pose there: within a count.
pub fn stand(rig: &Rig, wished: [f64; 2], dice: &mut Dice) -> ([f64; 2], RigPose) {
    let mut read = [0.0; 2];
    let mut truth = [0.0; 2];
    for (index, axis) in rig.axes.iter().enumerate() {
        let counts = axis.counts_at(wished[index]).round();
        read[index] = axis.value_at(counts);
        truth[index] = read[index] + 0.5 * axis.value_per_count() * dice.uniform();
    }
    (read, rig.pose_at_values(&truth))
}
