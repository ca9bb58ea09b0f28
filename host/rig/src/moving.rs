//! Measuring while the stages move: every row of both images has its own pose.

use vergence_vision::{Cloud, CloudPoint, Drop, Gates, Left, PixelPair, StereoPair, Transform, cloud_point};

use crate::clock::BoardInstant;
use crate::rig::Rig;
use crate::track::{JointTrack, JointsAt, TrackGap};

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
        match self.shutter {
            Shutter::Global => self.middle,
            Shutter::Rolling { line_us } => BoardInstant { us: self.middle.us + lines * line_us, ..self.middle },
        }
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

/// The points of `pairs`, each triangulated with the pose of the left camera when its row was exposed and that of the right
/// camera when its own was, in the frame of the left camera at its middle row.
///
/// The covariance of the pose in `gates` is replaced by that of each point's own pose: it grows with the speed of the
/// stages and the uncertainty of the exposure's instant.
///
/// # Errors
/// [`TrackGap`] where the encoder readings do not cover an exposure.
pub fn moving_cloud(
    pairs: &[PixelPair],
    rig: &Rig,
    track: &JointTrack,
    exposure: &PairExposure,
    gates: &Gates,
) -> Result<Cloud, TrackGap> {
    let reference = track.at(exposure.left.middle)?;
    let mut cloud = Cloud::default();
    for (pair_index, pixels) in pairs.iter().enumerate() {
        let left = track.at(exposure.left.at_row(pixels.left.v))?;
        let right = track.at(exposure.right.at_row(pixels.right.v))?;
        match point(pixels, rig, &reference, [&left, &right], gates) {
            Ok(point) => cloud.points.push(CloudPoint { pair_index, ..point }),
            Err(reason) => *cloud.dropped.entry(reason).or_default() += 1,
        }
    }
    Ok(cloud)
}

fn point(
    pixels: &PixelPair,
    rig: &Rig,
    reference: &JointsAt,
    [left, right]: [&JointsAt; 2],
    gates: &Gates,
) -> Result<CloudPoint, Drop> {
    let pose = rig.pose_of_each(left, right);
    let pair = StereoPair { left: &rig.left_camera, right: &rig.right_camera, left_from_right: pose.left_from_right };
    let gates = Gates { shared: gates.shared.with_pose(&pose.covariance), ..*gates };
    let point = cloud_point(pixels, &pair, &gates)?;
    let reference_from_left: Transform<Left, Left> = rig.pose(reference).base_from_left.inverse() * pose.base_from_left;
    let turn = reference_from_left.rotation().to_rotation_matrix();
    Ok(CloudPoint {
        point: reference_from_left * point.point,
        covariance: turn * point.covariance * turn.transpose(),
        ..point
    })
}
