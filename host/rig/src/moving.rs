//! Measuring while the stages move: every row of both images has its own pose.

use std::time::Duration;

use vergence_vision::{
    Angle, Base, Cloud, CloudPoint, Drop, Gates, Left, PixelPair, StereoPair, Transform, cloud_point,
};

use crate::clock::BoardInstant;
use crate::pose::RigPose;
use crate::rig::Rig;
use crate::track::{Joints, JointsAt, TrackGap};

/// How a sensor exposes its rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Shutter {
    /// All at once.
    #[default]
    Global,
    /// One after the other.
    Rolling {
        /// From the middle of one row's exposure to the next one's, in microseconds; negative where the image is read from
        /// the bottom.
        line_us: f64,
    },
}

impl Shutter {
    /// From the middle of one row's exposure to the next one's, in microseconds; zero where all are exposed at once.
    #[must_use]
    pub const fn line_us(self) -> f64 {
        match self {
            Self::Global => 0.0,
            Self::Rolling { line_us } => line_us,
        }
    }

    /// From the exposure of the first of `rows` rows to that of the last, whichever end is read first.
    #[must_use]
    pub fn span(self, rows: u32) -> Duration {
        let us = self.line_us().abs() * f64::from(rows.saturating_sub(1));
        Duration::from_nanos((us * 1e3).round() as u64)
    }
}

/// When one image was exposed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// The middle of the exposure of the middle row, board clock.
    pub middle: BoardInstant,
    /// How the rows follow.
    pub shutter: Shutter,
    /// Rows of the image.
    pub rows: u32,
}

impl Exposure {
    /// The middle of the exposure of row `v`, with the error bound of the image's instant: it is the same for all rows.
    #[must_use]
    pub fn at_row(&self, v: f64) -> BoardInstant {
        let lines = v - 0.5 * (f64::from(self.rows) - 1.0);
        BoardInstant { us: self.middle.us + lines * self.shutter.line_us(), ..self.middle }
    }
}

/// Both images of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairExposure {
    /// Of the left camera.
    pub left: Exposure,
    /// Of the right camera.
    pub right: Exposure,
}

/// Where the cameras were when the middle rows of a pair were exposed.
#[derive(Clone, Debug, PartialEq)]
pub struct MiddlePose {
    /// Of the left camera at its middle row, and of the right camera at its own.
    pub pose: RigPose,
    /// How far the relative rotation turned from there to the first or the last rows, whichever is farther.
    pub sweep: Angle,
}

/// The pose at the middle rows of a pair, and how much it changes until the others.
///
/// # Errors
/// [`TrackGap`] where the encoder readings do not cover an exposure.
pub fn middle_pose(rig: &Rig, joints: &impl Joints, exposure: &PairExposure) -> Result<MiddlePose, TrackGap> {
    let at = |rows: [f64; 2]| {
        let left = joints.at(exposure.left.at_row(rows[0]))?;
        Ok(rig.pose_of_each(&left, &joints.at(exposure.right.at_row(rows[1]))?))
    };
    let last = [exposure.left.rows, exposure.right.rows].map(|rows| f64::from(rows) - 1.0);
    let pose = at(last.map(|row| 0.5 * row))?;
    let turned = |other: RigPose| pose.left_from_right.rotation().angle_to(&other.left_from_right.rotation());
    let sweep = turned(at([0.0, 0.0])?).max(turned(at(last)?));
    Ok(MiddlePose { pose, sweep: Angle::from_rad(sweep) })
}

/// The points of `pairs`, each triangulated with the pose of the left camera when its row was exposed and that of the right
/// camera when its own was, in the frame of the left camera at its middle row. With each pair stands the standard deviation
/// of its positions in pixels.
///
/// The covariance of the pose in `gates` is replaced by that of each point's own pose: it grows with the speed of the
/// stages and the uncertainty of the exposure's instant.
///
/// # Errors
/// [`TrackGap`] where the encoder readings do not cover an exposure.
pub fn moving_cloud(
    pairs: &[(PixelPair, f64)],
    rig: &Rig,
    joints: &impl Joints,
    exposure: &PairExposure,
    gates: &Gates,
) -> Result<Cloud, TrackGap> {
    let reference_from_base = rig.pose(&joints.at(exposure.left.middle)?).base_from_left.inverse();
    let mut cloud = Cloud::default();
    for (pair_index, (pixels, pixel_sigma)) in pairs.iter().enumerate() {
        let gates = Gates { pixel_sigma: *pixel_sigma, ..*gates };
        let left = joints.at(exposure.left.at_row(pixels.left.v))?;
        let right = joints.at(exposure.right.at_row(pixels.right.v))?;
        match point(pixels, rig, &reference_from_base, [&left, &right], &gates) {
            Ok(point) => cloud.points.push(CloudPoint { pair_index, ..point }),
            Err(reason) => *cloud.dropped.entry(reason).or_default() += 1,
        }
    }
    Ok(cloud)
}

fn point(
    pixels: &PixelPair,
    rig: &Rig,
    reference_from_base: &Transform<Left, Base>,
    [left, right]: [&JointsAt; 2],
    gates: &Gates,
) -> Result<CloudPoint, Drop> {
    let pose = rig.pose_of_each(left, right);
    let pair = StereoPair { left: &rig.left_camera, right: &rig.right_camera, left_from_right: pose.left_from_right };
    let gates = Gates { shared: gates.shared.with_pose(&pose.covariance), ..*gates };
    let point = cloud_point(pixels, &pair, &gates)?;
    let reference_from_left: Transform<Left, Left> = *reference_from_base * pose.base_from_left;
    let turn = reference_from_left.rotation().to_rotation_matrix();
    Ok(CloudPoint {
        point: reference_from_left * point.point,
        covariance: turn * point.covariance * turn.transpose(),
        ..point
    })
}
