//! The mechanism as a function of its unknowns, with derivatives.
//!
//! `left_from_right(q) = L(q)⁻¹ R(q)`, each chain a product of exponentials. The base frame is held by the left camera at
//! zero. Tilting or shifting a screw is a conjugation: with the twist η of that small motion the exponential E moves by
//! η - Ad(E) η; moving along the screw moves it by the screw itself.

use nalgebra::{Isometry3, Matrix6xX, Unit, UnitQuaternion, Vector3};
use vergence_rig::{Link, Screw};
use vergence_vision::Point;

use crate::extrinsics::Side;
use crate::reprojection::{POSE, moved};
use crate::stage::twist::{Twist, across, as_move, carried, of_move, of_screw, slide, turn};
use crate::stage::unknowns::{Ordinal, Unknown};

/// The unknowns at one point.
#[derive(Clone, Debug)]
pub(crate) struct State {
    pub left: Vec<Link>,
    pub left_at_zero: Isometry3<f64>,
    pub right: Vec<Link>,
    pub right_at_zero: Isometry3<f64>,
    /// Scale of the encoder of each axis, as a ratio to its nominal scale.
    pub scales: Vec<f64>,
    /// Error of the reading of each axis at each stage pose, in millimetres or radians.
    pub reading_errors: Vec<Vec<f64>>,
    /// How far the right camera is from where the mechanism puts it at each stage pose, in its own frame there; empty where it
    /// counts as exact.
    pub returns: Vec<Isometry3<f64>>,
}

/// The mechanism at given encoder readings.
struct Posed<'a> {
    state: &'a State,
    readings: &'a [f64],
}

impl State {
    pub fn links(&self, side: Side) -> &[Link] {
        if side == Side::Left { &self.left } else { &self.right }
    }

    fn link_mut(&mut self, side: Side, link: usize) -> Option<&mut Link> {
        if side == Side::Left { self.left.get_mut(link) } else { self.right.get_mut(link) }
    }

    /// `left_from_right` where the encoders read `readings`.
    pub fn left_from_right(&self, readings: &[f64]) -> Isometry3<f64> {
        let posed = Posed { state: self, readings };
        posed.chain(Side::Left).inverse() * posed.chain(Side::Right)
    }

    /// How far the right camera is from where the mechanism puts it at stage pose `pose`, in its own frame.
    pub fn returned(&self, pose: Option<usize>) -> Isometry3<f64> {
        pose.and_then(|pose| self.returns.get(pose)).copied().unwrap_or_else(Isometry3::identity)
    }

    /// The move of the right camera against the left one by each unknown; errors of readings and returns are those of stage
    /// pose `pose`.
    pub fn derivative(&self, readings: &[f64], unknowns: &[Unknown], pose: Option<usize>) -> Matrix6xX<f64> {
        let posed = Posed { state: self, readings };
        let left_from_base = posed.chain(Side::Left).inverse();
        let by_mechanism = left_from_base * posed.chain(Side::Right);
        let left_from_right = by_mechanism * self.returned(pose);
        let mut nth = Ordinal::default();
        let columns: Vec<Twist> = unknowns
            .iter()
            .map(|&unknown| match (unknown, nth.next(unknown)) {
                (Unknown::Return { pose: of }, nth) if pose == Some(of) => turned(&by_mechanism.rotation, nth),
                (unknown, nth) => {
                    as_move(&left_from_right, &carried(&left_from_base, &posed.twist(unknown, nth, pose)))
                }
            })
            .collect();
        Matrix6xX::from_columns(&columns)
    }

    /// The move of [`Self::left_from_right`] by the reading of `axis`.
    pub fn by_reading(&self, readings: &[f64], axis: usize) -> Twist {
        let column = self.derivative(readings, &[Unknown::Reading { pose: 0, axis }], Some(0));
        column.column(0).into_owned()
    }

    /// Moved by the components of a step.
    pub fn plus(&self, unknowns: &[Unknown], step: &[f64]) -> Self {
        let mut next = self.clone();
        let mut nth = Ordinal::default();
        let mut base_move = Twist::zeros();
        let mut returned = vec![Twist::zeros(); self.returns.len()];
        for (&unknown, &amount) in unknowns.iter().zip(step) {
            let nth = nth.next(unknown);
            match unknown {
                Unknown::Direction { side, link, .. } => {
                    let Some(before) = self.links(side).get(link) else { continue };
                    let tilt = UnitQuaternion::from_scaled_axis(across(&direction(&before.screw))[nth % 2] * amount);
                    if let Some(after) = next.link_mut(side, link) {
                        match &mut after.screw {
                            Screw::Slide { along } => *along = tilt * *along,
                            Screw::Turn { about, .. } => *about = tilt * *about,
                        }
                    }
                }
                Unknown::Line { side, link, .. } => {
                    let Some(before) = self.links(side).get(link) else { continue };
                    let shift = across(&direction(&before.screw))[nth % 2] * amount;
                    if let Some(Link { screw: Screw::Turn { through, .. }, .. }) = next.link_mut(side, link) {
                        *through = Point::from_mm(through.mm() + shift);
                    }
                }
                Unknown::Rotation => base_move[nth % 3] = amount,
                Unknown::Position => base_move[3 + nth % 3] = amount,
                Unknown::Scale { axis } => next.scales[axis] += amount,
                Unknown::Reading { pose, axis } => next.reading_errors[pose][axis] += amount,
                Unknown::Return { pose } => returned[pose][nth % POSE] = amount,
            }
        }
        next.returns.iter_mut().zip(&returned).for_each(|(pose, by)| *pose = moved(pose, by));
        next.right_at_zero = moved(&self.right_at_zero, &base_move);
        next
    }
}

/// The move of a camera by component `nth` of a move in its own frame, which is turned by `rotation`.
fn turned(rotation: &UnitQuaternion<f64>, nth: usize) -> Twist {
    let axis = rotation * Vector3::ith(nth % 3, 1.0);
    let mut twist = Twist::zeros();
    twist.fixed_rows_mut::<3>(3 * (nth / 3 % 2)).copy_from(&axis);
    twist
}

/// Direction of a slide, or of the line of a turn.
pub(crate) fn direction(screw: &Screw) -> Unit<Vector3<f64>> {
    match screw {
        Screw::Slide { along } => *along,
        Screw::Turn { about, .. } => *about,
    }
}

impl Posed<'_> {
    fn position(&self, axis: usize) -> f64 {
        let scale = self.state.scales.get(axis).copied().unwrap_or(1.0);
        scale * self.readings.get(axis).copied().unwrap_or(0.0)
    }

    fn displacement(&self, link: &Link) -> Isometry3<f64> {
        link.screw.displacement(link.share * self.position(link.axis))
    }

    /// The product of the exponentials before link `end`.
    fn before(&self, side: Side, end: usize) -> Isometry3<f64> {
        self.state.links(side).iter().take(end).fold(Isometry3::identity(), |pose, link| pose * self.displacement(link))
    }

    /// `base_from_camera`.
    fn chain(&self, side: Side) -> Isometry3<f64> {
        let at_zero = if side == Side::Left { self.state.left_at_zero } else { self.state.right_at_zero };
        self.before(side, usize::MAX) * at_zero
    }

    /// The twist, in the base frame, of the right camera against the left by component `nth` of `unknown`.
    fn twist(&self, unknown: Unknown, nth: usize, pose: Option<usize>) -> Twist {
        match unknown {
            Unknown::Direction { side, link, .. } => self.by_screw(side, link, |screw| match screw {
                Screw::Slide { along } => turn(across(along)[nth % 2], Vector3::zeros()),
                Screw::Turn { about, through } => turn(across(about)[nth % 2], through.mm()),
            }),
            Unknown::Line { side, link, .. } => {
                self.by_screw(side, link, |screw| slide(across(&direction(screw))[nth % 2]))
            }
            Unknown::Rotation => self.by_right_at_zero(nth % 3),
            Unknown::Position => self.by_right_at_zero(3 + nth % 3),
            Unknown::Scale { axis } => self.by_position(axis) * self.readings.get(axis).copied().unwrap_or(0.0),
            Unknown::Reading { pose: of, axis } if pose == Some(of) => {
                self.by_position(axis) * self.state.scales.get(axis).copied().unwrap_or(1.0)
            }
            Unknown::Reading { .. } | Unknown::Return { .. } => Twist::zeros(),
        }
    }

    fn by_screw(&self, side: Side, index: usize, motion: impl Fn(&Screw) -> Twist) -> Twist {
        let Some(link) = self.state.links(side).get(index) else { return Twist::zeros() };
        let eta = motion(&link.screw);
        let twist = carried(&self.before(side, index), &(eta - carried(&self.displacement(link), &eta)));
        if side == Side::Left { -twist } else { twist }
    }

    fn by_right_at_zero(&self, component: usize) -> Twist {
        let mut step = Twist::zeros();
        step[component] = 1.0;
        carried(&self.before(Side::Right, usize::MAX), &of_move(&self.state.right_at_zero, &step))
    }

    fn by_position(&self, axis: usize) -> Twist {
        let mut sum = Twist::zeros();
        for (side, sign) in [(Side::Left, -1.0), (Side::Right, 1.0)] {
            for (index, link) in self.state.links(side).iter().enumerate().filter(|(_, link)| link.axis == axis) {
                sum += carried(&self.before(side, index), &of_screw(&link.screw)) * (sign * link.share);
            }
        }
        sum
    }
}
