//! Labels of targets that two cameras see, where an image alone leaves them open.
//!
//! A target is a free body: only the label that one camera gives a corner *relative to the other's* matters. Each
//! relative labelling of a view means another relative pose of the cameras. The cameras stood the same way in all views,
//! and a wrong labelling turns or shifts the target about itself, which for targets held differently means different
//! relative poses: the pose that most views allow is the true one, unless the targets were all held alike.

use std::collections::BTreeSet;

use nalgebra::{Isometry3, Point3, Translation3, UnitQuaternion, Vector2, Vector3};
use vergence_targets::{Relabelling, SeenTarget};
use vergence_vision::{KannalaBrandt, Left, Point, Right};

use super::{FEWEST_VIEWS, StereoView};
use crate::arun::fit_rotation_translation;
use crate::planar_pose::target_pose;

/// A pair of labels fits a relative pose if the corners of both cameras are this near, in squares, root mean square. A
/// wrong one is a square off or more.
const FITS_SQUARES: f64 = 0.25;
/// So many more views must fit the relative pose taken than any pose under which they are labelled otherwise.
const LEAD: usize = 2;
/// A view with more pairs of labellings than this, as of a small part of a large target, gives no relative poses of its own to
/// try: it is labelled by the others.
const MOST_TRIED: usize = 250_000;

/// Why a view of a pair is left out: its labels are open.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LabelError {
    /// Too few views agree on a relative pose.
    #[error(
        "its image allows several labellings of the corners, and only {agree} views agree on a relative pose, of \
         {FEWEST_VIEWS} at least: show the whole target, one whose columns plus rows are odd, or one with tags"
    )]
    TooFewAgree {
        /// Number of views that agree.
        agree: usize,
    },
    /// Another relative pose, with other labels, fits nearly as many views.
    #[error(
        "its image allows several labellings of the corners, and more than one fits all views: turn and tilt the target \
         between views, take one whose columns plus rows are odd, or one with tags"
    )]
    Undecided,
    /// No labelling fits the relative pose of the other views.
    #[error("its image allows several labellings of the corners, and none fits the relative pose of the other views")]
    NoneFits,
}

/// Pairs the targets that two cameras saw, left and right, under labels that agree. Where an image allows several
/// labellings they are tried jointly over all views; a view whose labels stay open is left out, with the reason.
#[must_use]
pub fn label_pairs(lenses: [&KannalaBrandt; 2], seen: &[[&SeenTarget; 2]]) -> Vec<Result<StereoView, LabelError>> {
    let is_open = |pair: &[&SeenTarget; 2]| pair.iter().any(|target| !target.is_certain());
    if !seen.iter().any(is_open) {
        return seen.iter().map(|pair| Ok(pair_under(pair, Relabelling::SAME))).collect();
    }
    let views: Vec<Option<Placed>> = seen.iter().map(|pair| Placed::new(lenses, pair)).collect();
    let agreed = agreed_pose(&views);
    let label = |(pair, view): (&[&SeenTarget; 2], &Option<Placed>)| {
        if !is_open(pair) {
            return Ok(pair_under(pair, Relabelling::SAME));
        }
        let change = view.as_ref().and_then(|view| view.change_at(agreed.as_ref().ok()?));
        match (agreed.as_ref(), change) {
            (Ok(_), Some(change)) => Ok(pair_under(pair, change)),
            (Ok(_), None) => Err(LabelError::NoneFits),
            (Err(reason), _) => Err(*reason),
        }
    };
    seen.iter().zip(&views).map(label).collect()
}

fn pair_under([left, right]: &[&SeenTarget; 2], change: Relabelling) -> StereoView {
    StereoView { name: left.view.name.clone(), left: left.view.clone(), right: right.relabelled(change) }
}

/// A target as each camera alone places it.
struct Placed {
    left_from_target: Isometry3<f64>,
    right_from_target: Isometry3<f64>,
    /// The right camera's corners on the target, in squares.
    corners: Vec<Point3<f64>>,
    left: Vec<Relabelling>,
    right: BTreeSet<Relabelling>,
    pitch_mm: f64,
}

impl Placed {
    /// `None` where a camera cannot place the target.
    fn new([left_lens, right_lens]: [&KannalaBrandt; 2], [left, right]: &[&SeenTarget; 2]) -> Option<Self> {
        let pose =
            |lens, target: &SeenTarget| Some(*target_pose(lens, &target.view).ok()?.camera_from_target.isometry());
        let pitch_mm = left.pitch.mm();
        let corner = |mm: [f64; 2]| Point3::from((Vector2::from(mm) / pitch_mm).push(0.0));
        Some(Self {
            left_from_target: pose(left_lens, left)?,
            right_from_target: pose(right_lens, right)?,
            corners: right.view.corners.iter().map(|seen| corner(seen.target_mm)).collect(),
            left: left.labellings.clone(),
            right: right.labellings.iter().copied().collect(),
            pitch_mm,
        })
    }

    /// Changes of the right labels that both images allow together, each once; none where they are too many.
    fn changes(&self) -> BTreeSet<Relabelling> {
        if self.left.len() * self.right.len() > MOST_TRIED {
            return BTreeSet::new();
        }
        let of_left = |left: &Relabelling| {
            let back = left.inverse();
            self.right.iter().map(move |right| right.then(back))
        };
        self.left.iter().flat_map(of_left).collect()
    }

    fn allows(&self, change: Relabelling) -> bool {
        self.left.iter().any(|left| self.right.contains(&change.then(*left)))
    }

    /// The pose of the right camera in the left frame if the right labels change so.
    fn left_from_right(&self, change: Relabelling) -> Isometry3<f64> {
        self.left_from_target * isometry(change, self.pitch_mm) * self.right_from_target.inverse()
    }

    /// The change of the right labels that fits a relative pose, if one does that the images allow.
    fn change_at(&self, left_from_right: &Isometry3<f64>) -> Option<Relabelling> {
        let mut moved = self.left_from_target.inverse() * left_from_right * self.right_from_target;
        moved.translation.vector /= self.pitch_mm;
        let along = moved.rotation * Vector3::x();
        let quarters = (along.y.atan2(along.x) / std::f64::consts::FRAC_PI_2).round() as i32;
        let turn = Relabelling { quarters: quarters.rem_euclid(4) as usize, shift: [0, 0] };
        let turned = isometry(turn, 1.0);
        let count = self.corners.len() as f64;
        let mean = self.corners.iter().map(|corner| moved * corner - turned * corner).sum::<Vector3<f64>>() / count;
        let change = Relabelling { shift: [mean.x.round() as i32, mean.y.round() as i32], ..turn };
        let labelled = isometry(change, 1.0);
        let squares: f64 = self.corners.iter().map(|corner| (moved * corner - labelled * corner).norm_squared()).sum();
        (squares < FITS_SQUARES * FITS_SQUARES * count && self.allows(change)).then_some(change)
    }
}

/// A change of labels as a motion in the target's plane.
fn isometry(change: Relabelling, pitch: f64) -> Isometry3<f64> {
    let turn = std::f64::consts::FRAC_PI_2 * change.quarters as f64;
    let [x, y] = change.shift.map(|squares| f64::from(squares) * pitch);
    Isometry3::from_parts(Translation3::new(x, y, 0.0), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn))
}

/// The changes of labels, one for each view, that a relative pose asks for.
type Changes = Vec<Option<Relabelling>>;

fn changes_at(views: &[Option<Placed>], left_from_right: &Isometry3<f64>) -> Changes {
    views.iter().map(|view| view.as_ref()?.change_at(left_from_right)).collect()
}

fn number_of(changes: &Changes) -> usize {
    changes.iter().flatten().count()
}

/// The relative pose that most views fit.
///
/// # Errors
/// [`LabelError`] where too few do, or another one fits nearly as many.
fn agreed_pose(views: &[Option<Placed>]) -> Result<Isometry3<f64>, LabelError> {
    let of_view =
        |view: &Placed| view.changes().into_iter().map(|change| view.left_from_right(change)).collect::<Vec<_>>();
    let tried: Vec<Changes> = views.iter().flatten().flat_map(of_view).map(|pose| changes_at(views, &pose)).collect();
    // The first of those that fit most: the order is that of the views.
    let best = tried.iter().rev().max_by_key(|changes| number_of(changes)).cloned().unwrap_or_default();
    // Refined by all that fit, more may fit.
    let refined = refined(views, &best).map(|pose| (pose, changes_at(views, &pose)));
    let Some((pose, best)) = refined.filter(|(_, changes)| number_of(changes) >= FEWEST_VIEWS) else {
        return Err(LabelError::TooFewAgree { agree: number_of(&best) });
    };
    let differs = |changes: &Changes| changes.iter().zip(&best).any(|(a, b)| a.is_some() && b.is_some() && a != b);
    let is_rival = |changes: &&Changes| differs(changes) && number_of(changes) + LEAD > number_of(&best);
    if tried.iter().any(|changes| is_rival(&changes)) { Err(LabelError::Undecided) } else { Ok(pose) }
}

/// The relative pose by the corners of all views under these labels.
fn refined(views: &[Option<Placed>], changes: &Changes) -> Option<Isometry3<f64>> {
    let mut pairs = Vec::new();
    for (view, change) in views.iter().zip(changes) {
        let (Some(view), Some(change)) = (view, change) else { continue };
        let labelled = isometry(*change, view.pitch_mm);
        for corner in &view.corners {
            let at = corner * view.pitch_mm;
            let in_left = Point::<Left>::from_mm((view.left_from_target * labelled * at).coords);
            let in_right = Point::<Right>::from_mm((view.right_from_target * at).coords);
            pairs.push((in_left, in_right));
        }
    }
    fit_rotation_translation(&pairs).ok().map(|pose| *pose.isometry())
}
