//! The precision bench of the paper in simulation: the target, the drawing of the rig, and the rig as it was really
//! built.

use vergence_rig::{BENCH_TOML, Rig};
use vergence_scene::Target;
use vergence_vision::{ImageSize, KannalaBrandt, Length, OpenCvFisheye};

use crate::error::ReproduceError;
use vergence_sim::{Random, built};
use vergence_targets::TargetSpec;

/// 9 x 6 corners of 20 mm, as in the paper.
pub const TARGET: TargetSpec = TargetSpec { columns: 9, rows: 6, square: Length::from_mm(20.0) };
/// The same target as the renderer knows it.
#[must_use]
pub const fn scene_target() -> Target {
    Target { columns: TARGET.columns, rows: TARGET.rows, square: TARGET.square }
}

/// Modes of the rig that the bench compares.
pub const MODES: [&str; 2] = ["human", "herbivore"];
/// Sensors of 2048 x 2048 pixels.
const SIZE: ImageSize = ImageSize { width: 2048, height: 2048 };
/// The image circle of 196° just fills the sensor. The paper does not publish its lens.
const PIXELS_PER_RADIAN: f64 = 599.0;

/// One rig, as it was drawn and as it was built; only the simulator knows the latter.
#[derive(Clone, Debug)]
pub struct Bench {
    /// Axes, modes and nominal mechanism. Its lenses are those of the built-in bench, and nothing uses them.
    pub drawn: Rig,
    /// As it was built: screws off by about a degree and 2 mm, encoders by a few parts in a thousand, other lenses.
    pub built: Rig,
}

impl Bench {
    /// The bench that `seed` stands for.
    ///
    /// # Errors
    /// Where the built-in bench is refused.
    pub fn new(seed: u64) -> Result<Self, ReproduceError> {
        let drawn = Rig::from_toml(BENCH_TOML).map_err(|error| ReproduceError::Rig(error.to_string()))?;
        let mut random = Random::new(seed ^ 0x6c65_6e73);
        let (left_camera, right_camera) = (lens(&drawn, &mut random)?, lens(&drawn, &mut random)?);
        let built = Rig { left_camera, right_camera, ..built(&drawn, seed) };
        Ok(Self { drawn, built })
    }
}

/// The bench's lens on the larger sensor; no two are alike.
fn lens(drawn: &Rig, random: &mut Random) -> Result<KannalaBrandt, ReproduceError> {
    let nominal = drawn.left_camera.to_opencv();
    let fx = PIXELS_PER_RADIAN + 2.0 * random.normal();
    let middle = 0.5 * f64::from(SIZE.width - 1);
    let lens = OpenCvFisheye {
        fx,
        fy: fx * (1.0 + 3e-4 * random.normal()),
        cx: middle + 3.0 * random.normal(),
        cy: middle + 3.0 * random.normal(),
        k: nominal.k.map(|k| k * (1.0 + 0.05 * random.normal())),
    };
    KannalaBrandt::from_opencv(lens, drawn.left_camera.theta_max(), SIZE)
        .map_err(|error| ReproduceError::Rig(error.to_string()))
}

/// The built-in bench with sensors of the same size that have `width` pixels across.
pub fn bench_with_sensors(width: u32) -> Result<Rig, ReproduceError> {
    let rig = Rig::from_toml(BENCH_TOML).map_err(|error| ReproduceError::Rig(error.to_string()))?;
    rig.with_sensors(width).map_err(|error| ReproduceError::Rig(error.to_string()))
}
