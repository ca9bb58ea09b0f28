//! Least-squares registration of the windows around a match, to a few hundredths of a pixel.
//!
//! The method is inverse compositional Gauss-Newton (S. Baker and I. Matthews, "Lucas-Kanade 20 years on", IJCV 56(3),
//! 2004) with gain, bias and the slope of the gain as linear unknowns. Between two views with epipolar rows a plane maps by
//! x' = x + t_x + s_x x + s_y y, y' = y, so rows stay rows. The unknown t_y absorbs the error of the pose; it is the
//! distance of the match from its epipolar curve.

mod template;
mod warp;
mod window;

use self::template::Template;
pub(crate) use self::warp::Warp;
use crate::match_errors::Evidence;
use crate::plane::Pyramid;
use crate::{UnmatchedReason, ViewPixel};

/// The result of a registration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Registered {
    /// The position in the right view that corresponds to the left keypoint.
    pub right: ViewPixel,
    /// Correlation of both windows.
    pub correlation: f64,
    /// What the registration shows of its error.
    pub evidence: Evidence,
}

/// A registration that is not good to a small part of a pixel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Unregistered {
    /// Why it is not.
    pub reason: UnmatchedReason,
    /// Where it ended all the same; `None` where it did not converge.
    pub ended: Option<Registered>,
}

impl From<UnmatchedReason> for Unregistered {
    fn from(reason: UnmatchedReason) -> Self {
        Self { reason, ended: None }
    }
}

const LEAST_CORRELATION: f64 = 0.9;
/// Largest standard deviation of t_x from the residuals, in pixels.
const LARGEST_SIGMA: f64 = 0.15;
/// Largest distance in pixels between a keypoint and the result of registering to the right view and back.
const LARGEST_LOOP: f64 = 0.15;

/// Memory in which windows are prepared: they are too large to be moved about, or to be exchanged but by their addresses.
pub(crate) struct Scratch {
    /// The window of the left view.
    forth: Box<Template>,
    /// The window of the right view, for the way back.
    back: Box<Template>,
}

impl Scratch {
    /// Windows without content.
    pub(crate) fn new() -> Box<Self> {
        Box::new(Self { forth: Box::new(Template::empty()), back: Box::new(Template::empty()) })
    }

    /// Makes the window of the way back that of the way forth: a place that was found in one view is registered in the next from the same window.
    pub(crate) const fn turn(&mut self) {
        std::mem::swap(&mut self.forth, &mut self.back);
    }
}

/// Registers the right view around `right` to the left view around the keypoint `left`, from `level` down to the
/// finest.
///
/// # Errors
/// Why the result is not good to a small part of a pixel, with the result where there is one.
pub(crate) fn register(
    scratch: &mut Scratch,
    [left_levels, right_levels]: [&Pyramid; 2],
    left: ViewPixel,
    right: ViewPixel,
    level: usize,
) -> Result<Registered, Unregistered> {
    let mut warp = Warp { tx: right.x - left.x, ty: right.y - left.y, ..Warp::default() };
    for level in (1..=level).rev() {
        let (Some(from), Some(to)) = (left_levels.levels().get(level), right_levels.levels().get(level)) else {
            return Err(UnmatchedReason::NotRefined.into());
        };
        let scale = (1_usize << level) as f64;
        let at = ViewPixel { x: left.x / scale, y: left.y / scale };
        scratch.forth.prepare(from, at)?;
        warp = scratch.forth.settle(to, warp.scaled(1.0 / scale))?.scaled(scale);
    }
    let from = left_levels.levels().first().ok_or(UnmatchedReason::NotRefined)?;
    scratch.forth.prepare(from, left)?;
    register_prepared(scratch, [left_levels, right_levels], left, warp)
}

/// The same in the finest level alone, from `warp` on: the window of the left view is prepared already.
///
/// # Errors
/// As [`register`].
pub(crate) fn register_prepared(
    scratch: &mut Scratch,
    [left_levels, right_levels]: [&Pyramid; 2],
    left: ViewPixel,
    warp: Warp,
) -> Result<Registered, Unregistered> {
    let Scratch { forth, back } = scratch;
    let (Some(from), Some(to)) = (left_levels.levels().first(), right_levels.levels().first()) else {
        return Err(UnmatchedReason::NotRefined.into());
    };
    let fit = forth.fit(to, warp)?;
    let warp = fit.warp;
    if fit.correlation < LEAST_CORRELATION {
        return Err(UnmatchedReason::LowCorrelation.into());
    }
    let right = ViewPixel { x: left.x + warp.tx, y: left.y + warp.ty };
    let steepness = warp.sx.abs().max(warp.sy.abs());
    let ended = |way_back: f64| {
        let evidence = Evidence { from_residuals: fit.sigmas, residual: fit.residual, steepness, way_back, warp };
        Registered { right, correlation: fit.correlation, evidence }
    };
    if fit.sigmas[0] > LARGEST_SIGMA {
        return Err(Unregistered { reason: UnmatchedReason::Uncertain, ended: Some(ended(f64::INFINITY)) });
    }
    let returned = back.prepare(to, right).and_then(|()| back.settle(from, warp.inverse()));
    let way_back = returned.map_or(f64::INFINITY, |back| (back.tx + warp.tx).hypot(back.ty + warp.ty));
    if way_back > LARGEST_LOOP {
        return Err(Unregistered { reason: UnmatchedReason::NotReversible, ended: Some(ended(way_back)) });
    }
    Ok(ended(way_back))
}

/// Distance of the windows beside a match from its own, in pixels of the view: most of what they show is the same surface.
const BESIDE: f64 = 7.0;
/// The departure of a window that cannot be registered.
const LOST: f64 = f64::INFINITY;

/// How far the disparities to the left, to the right, above and below the match `left` depart from the plane that its registration found,
/// in pixels of the view. A window that shows two surfaces finds a plane between them that the windows beside it do not.
pub(crate) fn departures(
    scratch: &mut Scratch,
    [left_levels, right_levels]: [&Pyramid; 2],
    left: ViewPixel,
    warp: &Warp,
) -> [f64; 4] {
    let planes = left_levels.levels().first().zip(right_levels.levels().first());
    [(-BESIDE, 0.0), (BESIDE, 0.0), (0.0, -BESIDE), (0.0, BESIDE)].map(|(dx, dy)| {
        let there = ViewPixel { x: left.x + dx, y: left.y + dy };
        let on_plane = Warp { tx: warp.tx + warp.sx * dx + warp.sy * dy, ..*warp };
        let found = planes.and_then(|(from, to)| {
            scratch.forth.prepare(from, there).ok()?;
            scratch.forth.settle(to, on_plane).ok()
        });
        found.map_or(LOST, |found| (found.tx - on_plane.tx).abs())
    })
}
