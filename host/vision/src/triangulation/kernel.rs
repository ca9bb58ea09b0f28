//! The choice of a triangulation method by name.

use std::fmt;
use std::str::FromStr;

use nalgebra::Vector3;

use super::{
    AngularNorm, Rejection, Triangulated, angular, edge_plane, mid2, midpoint, pseudo_intersection, rectified,
    reprojection,
};
use crate::{DropReason, Left, Length, PixelPair, Point, Right, StereoPair, UnitRay};

/// A method of triangulation.
///
/// With ordinary pixel noise all but [`Kernel::Rectified`] perform alike. They differ for rays that miss each other by
/// much, as when a match slips along an edge.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Kernel {
    /// The default, [`pseudo_intersection`].
    #[default]
    PseudoIntersection,
    /// The method [`midpoint`].
    Midpoint,
    /// The method [`mid2`].
    Mid2,
    /// The method [`angular`] with [`AngularNorm::L1`].
    AngularL1,
    /// The method [`angular`] with [`AngularNorm::L2`].
    AngularL2,
    /// The method [`angular`] with [`AngularNorm::Linf`].
    AngularLinf,
    /// The method [`reprojection`].
    Reprojection,
    /// The method [`edge_plane`], with the common direction of the edges that all matches lie on.
    EdgePlane(UnitRay<Left>),
    /// The method [`rectified`].
    Rectified,
}

/// Error of parsing a [`Kernel`]: the name belongs to no method.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "'{0}' is no method of triangulation: choose pseudo-intersection, midpoint, mid2, angular-l1, angular-l2, \
     angular-linf, reprojection, rectified, or edge-plane:X,Y,Z with the direction of the edges in the left frame"
)]
pub struct UnknownKernel(String);

impl Kernel {
    /// All methods without parameters.
    pub const ALL: [Self; 8] = [
        Self::PseudoIntersection,
        Self::Midpoint,
        Self::Mid2,
        Self::AngularL1,
        Self::AngularL2,
        Self::AngularLinf,
        Self::Reprojection,
        Self::Rectified,
    ];

    /// Triangulates two matched pixels.
    ///
    /// # Errors
    /// [`DropReason`] for pixels outside the lenses' fields, and for rays that make no point.
    pub fn triangulate(&self, pixels: &PixelPair, pair: &StereoPair<'_>) -> Result<Triangulated, DropReason> {
        let left = pair.left.unproject::<Left>(pixels.left).map_err(|_| DropReason::OutsideLeftField)?;
        let right = pair.right.unproject::<Right>(pixels.right).map_err(|_| DropReason::OutsideRightField)?;
        self.of_rays(pixels, &left, &right, pair)
    }

    /// Triangulates `pixels` whose rays are known; `right` is in the right camera's own frame.
    ///
    /// The rays are intersected between their origins, which the points are then moved from.
    pub(crate) fn of_rays(
        &self,
        pixels: &PixelPair,
        left: &UnitRay<Left>,
        right: &UnitRay<Right>,
        pair: &StereoPair<'_>,
    ) -> Result<Triangulated, DropReason> {
        let (between, origin) = pair.at_origins(left, right);
        let (turned, centre) = (between.left_from_right * *right, between.left_from_right.origin());
        let made = match self {
            Self::PseudoIntersection => pseudo_intersection(left, &turned, &centre),
            Self::Midpoint => midpoint(left, &turned, &centre),
            Self::Mid2 => mid2(left, &turned, &centre),
            Self::AngularL1 => angular(AngularNorm::L1, left, &turned, &centre),
            Self::AngularL2 => angular(AngularNorm::L2, left, &turned, &centre),
            Self::AngularLinf => angular(AngularNorm::Linf, left, &turned, &centre),
            Self::Reprojection => reprojection(pixels, left, right, &between),
            Self::EdgePlane(edge) => edge_plane(edge, left, &turned, &centre),
            Self::Rectified => rectified(left, right, &between.left_from_right),
        }?;
        if pair.is_central() {
            return Ok(made);
        }
        let point = made.point.mm() + origin.mm();
        let right_range = Length::from_mm((point - pair.left_from_right.origin().mm()).norm());
        Ok(Triangulated {
            point: Point::from_mm(point),
            left_range: Length::from_mm(point.norm()),
            right_range,
            ..made
        })
    }

    /// The stable name for the command line and for reports.
    #[must_use]
    pub const fn as_str(&self) -> &'static str {
        match self {
            Self::PseudoIntersection => "pseudo-intersection",
            Self::Midpoint => "midpoint",
            Self::Mid2 => "mid2",
            Self::AngularL1 => "angular-l1",
            Self::AngularL2 => "angular-l2",
            Self::AngularLinf => "angular-linf",
            Self::Reprojection => "reprojection",
            Self::EdgePlane(_) => "edge-plane",
            Self::Rectified => "rectified",
        }
    }
}

impl From<Rejection> for DropReason {
    fn from(rejection: Rejection) -> Self {
        match rejection {
            Rejection::Parallel => Self::Parallax,
            Rejection::OnBaseline => Self::OnBaseline,
            Rejection::Diverging => Self::Diverging,
            Rejection::OutsideView | Rejection::NotConverged => Self::NoPoint,
        }
    }
}

impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl FromStr for Kernel {
    type Err = UnknownKernel;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let known = match name.strip_prefix("edge-plane:") {
            Some(direction) => direction_of(direction).map(Self::EdgePlane),
            None => Self::ALL.into_iter().find(|kernel| kernel.as_str() == name),
        };
        known.ok_or_else(|| UnknownKernel(name.to_owned()))
    }
}

fn direction_of(text: &str) -> Option<UnitRay<Left>> {
    let components: Vec<f64> = text.split(',').map(|component| component.trim().parse().ok()).collect::<Option<_>>()?;
    let &[x, y, z] = components.as_slice() else { return None };
    UnitRay::new(Vector3::new(x, y, z))
}
