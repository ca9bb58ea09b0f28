//! A bench that was not built exactly as drawn.

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use vergence_calibration::StagePose;
use vergence_rig::{AxisPosition, BENCH_TOML, Chain, Link, Rig, Screw};
use vergence_vision::{KannalaBrandt, Left, Point, Right, Transform};

use super::{Dice, Pair, lens, other_lens};

/// The drawing, the true mechanism, and its encoders.
pub struct Bench {
    pub drawn: Rig,
    /// As built.
    pub left: Chain<Left>,
    /// As built.
    pub right: Chain<Right>,
    /// True positions are readings times these.
    pub scales: [f64; 2],
    pub lenses: [KannalaBrandt; 2],
    /// Whether the encoders read in steps; without, they read exactly.
    pub steps: bool,
    /// How far the right camera returns to a pose beside where the screws put it: standard deviation of each component, in radians and
    /// millimetres. `None`: exactly.
    pub returns: Option<[f64; 2]>,
}

impl Bench {
    /// Screws off by about a degree and 2 mm, the right camera by as much, encoders by a few parts in a thousand.
    pub fn built(dice: &mut Dice) -> Self {
        let lenses = [lens(), other_lens()];
        let drawn = Rig { left_camera: lenses[0], right_camera: lenses[1], ..Rig::from_toml(BENCH_TOML).unwrap() };
        let mount = drawn.right_chain.at_zero().isometry()
            * Isometry3::from_parts(
                Translation3::from(dice.vector(2.0)),
                UnitQuaternion::from_scaled_axis(dice.vector(1f64.to_radians())),
            );
        Self {
            left: Chain::new(off(drawn.left_chain.links(), dice), drawn.left_chain.at_zero()),
            right: Chain::new(off(drawn.right_chain.links(), dice), Transform::from_isometry(mount)),
            scales: [1.0 + 0.003 * dice.normal(), 1.0 + 0.003 * dice.normal()],
            lenses,
            drawn,
            steps: true,
            returns: None,
        }
    }

    /// The same with all of the separation on the right camera.
    pub fn with_the_left_camera_fixed(self) -> Self {
        let whole = |links: &[Link]| links.iter().map(|link| Link { share: 1.0, ..*link }).collect();
        let drawn = Rig {
            left_chain: Chain::new(Vec::new(), self.drawn.left_chain.at_zero()),
            right_chain: Chain::new(whole(self.drawn.right_chain.links()), self.drawn.right_chain.at_zero()),
            ..self.drawn
        };
        let right = Chain::new(whole(self.right.links()), self.right.at_zero());
        Self { left: Chain::new(Vec::new(), self.left.at_zero()), right, drawn, ..self }
    }

    /// Where the axes are at `readings`, to a fraction of an encoder's step.
    pub fn left_from_right(&self, readings: &[f64; 2]) -> Transform<Left, Right> {
        let values = [readings[0] * self.scales[0], readings[1] * self.scales[1]];
        self.left.base_from_camera(&values).inverse() * self.right.base_from_camera(&values)
    }

    /// Where the right camera comes to stand at `readings`.
    pub fn returned(&self, readings: &[f64; 2], dice: &mut Dice) -> Transform<Left, Right> {
        let there = self.left_from_right(readings);
        let Some(returns) = self.returns else { return there };
        let [turn, shift] = returns.map(|sigma| dice.vector(sigma));
        Transform::new(UnitQuaternion::from_scaled_axis(turn) * there.rotation(), there.origin().mm() + shift)
    }

    /// What the encoders say.
    pub fn read(&self, readings: &[f64; 2]) -> Vec<AxisPosition> {
        let read = self.drawn.axes.iter().zip(readings).map(|(axis, &reading)| {
            let step = axis.value_at((reading / axis.value_per_count()).floor());
            AxisPosition::from_value(axis.kind, if self.steps { step } else { reading })
        });
        read.collect()
    }

    pub fn pose(&self, readings: [f64; 2], views: usize, noise_px: f64, dice: &mut Dice) -> StagePose {
        // The stage stops near where it was sent, not on the edge of an encoder's step.
        let readings = [readings[0] + 0.01 * dice.normal(), readings[1] + 1e-3 * dice.normal()];
        let left_from_right = self.returned(&readings, dice);
        let pair = Pair { left: self.lenses[0], right: self.lenses[1], left_from_right, noise_px };
        StagePose { readings: self.read(&readings), views: pair.views(views, dice) }
    }

    /// Somewhere in the range of the axes.
    pub fn anywhere(&self, dice: &mut Dice) -> [f64; 2] {
        [0, 1].map(|axis| {
            let [low, high] = self.drawn.axes[axis].range.map(AxisPosition::value);
            dice.between(low, high)
        })
    }
}

fn off(links: &[Link], dice: &mut Dice) -> Vec<Link> {
    let mut tilted =
        |direction: Unit<Vector3<f64>>| UnitQuaternion::from_scaled_axis(dice.vector(1f64.to_radians())) * direction;
    let screws: Vec<Screw> = links
        .iter()
        .map(|link| match link.screw {
            Screw::Slide { along } => Screw::Slide { along: tilted(along) },
            Screw::Turn { about, through } => Screw::Turn { about: tilted(about), through },
        })
        .collect();
    let mut moved = |screw| match screw {
        Screw::Turn { about, through } => {
            Screw::Turn { about, through: Point::from_mm(through.mm() + dice.vector(2.0)) }
        }
        slide => slide,
    };
    links.iter().zip(screws).map(|(link, screw)| Link { screw: moved(screw), ..*link }).collect()
}

/// The corners of the range of the bench's axes, its middle, and herbivore pose.
pub const SIX_POSES: [[f64; 2]; 6] = {
    const DEG: f64 = std::f64::consts::PI / 180.0;
    [[60.0, 0.0], [220.0, 0.0], [60.0, 130.0 * DEG], [220.0, 130.0 * DEG], [140.0, 65.0 * DEG], [145.0, 120.0 * DEG]]
};
