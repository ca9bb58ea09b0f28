//! A mechanism that was not built exactly as drawn: the truth that a calibration of a simulated rig looks for.

use nalgebra::{Isometry3, Unit, UnitQuaternion, Vector3};
use vergence_rig::{Chain, Link, Rig, Screw};
use vergence_vision::{Frame, Point, Transform};

use crate::Random;

/// Standard deviation of a screw's direction about each axis, in radians.
const DIRECTION_RAD: f64 = 0.017;
/// Standard deviation of a screw's or camera's place along each axis, in millimetres.
const PLACE_MM: f64 = 2.0;
/// Standard deviation of an encoder's scale, relative.
const SCALE: f64 = 0.003;

/// The rig `drawn` as it was built by hand: screws and cameras are a little off, and encoders count a little more or less.
/// The same seed gives the same mechanism.
#[must_use]
pub fn built(drawn: &Rig, seed: u64) -> Rig {
    let mut off = Off(Random::new(seed));
    let scales: Vec<f64> = drawn.axes.iter().map(|_| 1.0 + SCALE * off.0.normal()).collect();
    let mount = off.mount();
    let right_at_zero = drawn.right_chain.at_zero();
    Rig {
        left_chain: off.chain(&drawn.left_chain, drawn.left_chain.at_zero(), &scales),
        right_chain: off.chain(&drawn.right_chain, Transform::from_isometry(right_at_zero.isometry() * mount), &scales),
        ..drawn.clone()
    }
}

/// Random departures from the drawing.
struct Off(Random);

impl Off {
    fn mount(&mut self) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_scaled_axis(self.0.vector(DIRECTION_RAD));
        Isometry3::from_parts(self.0.vector(PLACE_MM).into(), turn)
    }

    fn direction(&mut self, drawn: Unit<Vector3<f64>>) -> Unit<Vector3<f64>> {
        UnitQuaternion::from_scaled_axis(self.0.vector(DIRECTION_RAD)) * drawn
    }

    fn chain<C: Frame>(
        &mut self,
        drawn: &Chain<C>,
        at_zero: Transform<vergence_vision::Base, C>,
        scales: &[f64],
    ) -> Chain<C> {
        let link = |link: &Link| {
            let screw = match link.screw {
                Screw::Slide { along } => Screw::Slide { along: self.direction(along) },
                Screw::Turn { about, through } => Screw::Turn {
                    about: self.direction(about),
                    through: Point::from_mm(through.mm() + self.0.vector(PLACE_MM)),
                },
            };
            Link { share: link.share * scales.get(link.axis).copied().unwrap_or(1.0), screw, axis: link.axis }
        };
        Chain::new(drawn.links().iter().map(link).collect(), at_zero)
    }
}
