//! Finds a grid of AprilTags as Kalibr prints it, whole or in part.
//!
//! 1. Dark quads between saddle points are read as tags (`tags`): every tag says which it is and which way up.
//! 2. Tags that do not lie beside their neighbours as on the grid are dropped.
//! 3. Each corner is refined to a fraction of a pixel (`refine`), along edges that bend as the camera, if it is known at
//!    least roughly, makes them (`plane`).
//! 4. With a known camera, tags that were missed are looked for where the others predict their corners, and corners that
//!    are not where the others predict them are dropped.

use std::collections::BTreeMap;

use image::GrayImage;
use nalgebra::Vector2;
use vergence_vision::{KannalaBrandt, Pixel, median};

use super::intensity::Intensity;
use super::plane::TargetPlane;
use super::predict::Prediction;
use super::refine::refine;
use super::saddle::Quadrants;
use super::tags::{TagFamily, dark_quads, read_tag};
use super::{CornerQuality, DetectError, DetectedCorner, FEWEST_CORNERS};
use crate::AprilGridSpec;

/// A tag in the image: its corners, clockwise from its upper left one.
type Tag = [Vector2<f64>; 4];

/// The corners of the grid in `image`, in ascending order of index: four for each tag, from its lower left one against the
/// clock, as Kalibr counts them. `hint` is a camera calibrated roughly, if there is one.
///
/// # Errors
/// [`DetectError`] if the image shows too few tags, or the grid has more than there are.
pub fn detect_april_grid(
    image: &GrayImage,
    grid: &AprilGridSpec,
    hint: Option<&KannalaBrandt>,
) -> Result<Vec<DetectedCorner>, DetectError> {
    if !grid.is_usable() {
        return Err(DetectError::UnusableGrid { columns: grid.columns, rows: grid.rows });
    }
    let intensity = Intensity::new(image);
    let search = Search { image: &intensity, grid, hint };
    let tags = search.beside_neighbours(&search.tags(image));
    let mut corners = search.refined(&tags);
    search.drop_unclear(&mut corners);
    search.drop_misplaced(&mut corners);
    if corners.len() < FEWEST_CORNERS {
        return Err(DetectError::NoTags { found: corners.len() / 4 });
    }
    Ok(corners.into_values().collect())
}

/// What is looked for, and where.
struct Search<'a> {
    image: &'a Intensity<'a>,
    grid: &'a AprilGridSpec,
    hint: Option<&'a KannalaBrandt>,
}

impl Search<'_> {
    /// Every tag of the grid that is read exactly once, by number.
    fn tags(&self, image: &GrayImage) -> BTreeMap<u32, Tag> {
        const FAMILY: TagFamily = AprilGridSpec::FAMILY;
        let mut seen: BTreeMap<u32, Vec<Tag>> = BTreeMap::new();
        for quad in dark_quads(image, self.image) {
            if let Some((id, corners)) = read_tag(self.image, &quad, &FAMILY, self.grid.tags()) {
                seen.entry(id).or_default().push(corners);
            }
        }
        // Two of one number: a mirror, or another sheet. Neither can be trusted.
        seen.into_iter().filter_map(|(id, tags)| <[Tag; 1]>::try_from(tags).ok().map(|[tag]| (id, tag))).collect()
    }

    /// The tags that lie where most of their neighbours expect them; those without a neighbour are dropped.
    fn beside_neighbours(&self, tags: &BTreeMap<u32, Tag>) -> BTreeMap<u32, Tag> {
        /// In sides of the tag: a mean of two neighbours' steps bends less.
        const FARTHEST: f64 = 0.5;
        let pitch = 1.0 + self.grid.spacing;
        let agrees = |id: u32, other: u32| -> Option<bool> {
            let [from, to] = [id, other].map(|id| self.grid.place(id));
            let away = [to[0] - from[0], to[1] - from[1]];
            if away == [0, 0] || away[0].abs() > 1 || away[1].abs() > 1 {
                return None;
            }
            let (tag, neighbour) = (tags.get(&id)?, tags.get(&other)?);
            let [own, theirs] = [tag, neighbour].map(axes);
            let step = |axis: usize| (own[axis] + theirs[axis]) * (0.5 * pitch * f64::from(away[axis]));
            let off = middle(neighbour) - middle(tag) - step(0) - step(1);
            Some(off.norm() < FARTHEST * own[0].norm().max(own[1].norm()))
        };
        let keeps = |id: u32| {
            let votes: Vec<bool> = tags.keys().filter_map(|&other| agrees(id, other)).collect();
            let for_it = votes.iter().filter(|vote| **vote).count();
            2 * for_it > votes.len()
        };
        tags.iter().filter(|(id, _)| keeps(**id)).map(|(&id, &tag)| (id, tag)).collect()
    }

    /// The corners of `tags` that can be refined, and with a known camera those that these predict besides.
    fn refined(&self, tags: &BTreeMap<u32, Tag>) -> BTreeMap<u32, DetectedCorner> {
        let mut corners: BTreeMap<u32, DetectedCorner> = BTreeMap::new();
        for (&id, tag) in tags {
            for corner in 0..4 {
                let expected = self.by_tag(tag, corner);
                corners.extend(self.corner(id * 4 + index_of(corner), &expected, false));
            }
        }
        for _ in 0..2 {
            let Some(plane) = self.plane(&corners) else { break };
            let expected =
                (0..4 * self.grid.tags()).filter_map(|index| Some((index, plane.project(self.cell(index))?)));
            corners = expected
                .filter_map(|(index, expected)| {
                    let known = corners.get(&index);
                    let position = known.map_or(expected.position, |at| Vector2::new(at.pixel.u, at.pixel.v));
                    self.corner(index, &Prediction { position, ..expected }, known.is_none_or(|known| known.filled))
                })
                .collect();
        }
        corners
    }

    /// The corner near where it is expected, if there is one with the right colours.
    fn corner(&self, index: u32, expected: &Prediction, filled: bool) -> Option<(u32, DetectedCorner)> {
        const SMALLEST_PX: f64 = 5.0;
        const LEAST_CONTRAST: f64 = 16.0;
        let spacing = expected.spacing();
        if spacing.is_nan() || spacing < SMALLEST_PX || self.image.margin(expected.position) < 0.0 {
            return None;
        }
        let found = refine(self.image, expected.position, expected)?;
        let quadrants = Quadrants::read(self.image, found.position, &expected.steps)?;
        // The tag lies to the right of and below its upper left corner, and the other way at the next one: dark there.
        let colour = if index.is_multiple_of(2) { 1.0 } else { -1.0 };
        let clear = quadrants.is_corner(LEAST_CONTRAST) && quadrants.saddle() * colour > 0.0;
        let pixel = Pixel { u: found.position.x, v: found.position.y };
        let corner = DetectedCorner { index, pixel, sigma_px: found.sigma_px, filled, quality: CornerQuality::Good };
        clear.then_some((index, corner))
    }

    /// Where a corner of a tag is, counted clockwise from the upper left, and how the grid runs there, by the tag alone.
    fn by_tag(&self, tag: &Tag, corner: usize) -> Prediction {
        let [top_left, top_right, bottom_right, bottom_left] = *tag;
        let along = if corner < 2 { top_right - top_left } else { bottom_right - bottom_left };
        let across = if corner == 0 || corner == 3 { bottom_left - top_left } else { bottom_right - top_right };
        let cell = self.grid.cell();
        let position = tag.get(corner).copied().unwrap_or(top_left);
        Prediction { position, steps: [along * cell, across * cell], bends: [Vector2::zeros(); 2], variance: 0.0 }
    }

    /// A corner's place on the grid, in cells.
    fn cell(&self, index: u32) -> Vector2<f64> {
        Vector2::from(self.grid.corner_mm(index)) / (self.grid.tag.mm() * self.grid.cell())
    }

    fn plane(&self, corners: &BTreeMap<u32, DetectedCorner>) -> Option<TargetPlane<'_>> {
        let at = |corner: &DetectedCorner| Vector2::new(corner.pixel.u, corner.pixel.v);
        let observed: Vec<_> = corners.values().map(|corner| (self.cell(corner.index), at(corner))).collect();
        TargetPlane::fit(self.hint?, &observed)
    }

    /// Drops corners whose grey levels fit a corner much less than those of the corners about them do.
    fn drop_unclear(&self, corners: &mut BTreeMap<u32, DetectedCorner>) {
        // As for chessboards.
        const MEDIANS: f64 = 1.8;
        const NEIGHBOURS: usize = 12;
        let unclear = |corner: &DetectedCorner| {
            let mut others: Vec<(f64, f64)> = corners
                .values()
                .filter(|other| other.index != corner.index)
                .map(|other| ((self.cell(other.index) - self.cell(corner.index)).norm(), other.sigma_px))
                .collect();
            others.sort_by(|a, b| a.0.total_cmp(&b.0));
            let usual = median(others.into_iter().take(NEIGHBOURS).map(|(_, sigma)| sigma).collect());
            usual.is_some_and(|usual| corner.sigma_px > MEDIANS * usual)
        };
        let bad: Vec<u32> = corners.values().filter(|corner| unclear(corner)).map(|corner| corner.index).collect();
        corners.retain(|index, _| !bad.contains(index));
    }

    /// Drops corners that are much further than the others from where the plane of the grid has them, the worst first.
    fn drop_misplaced(&self, corners: &mut BTreeMap<u32, DetectedCorner>) {
        const MEDIANS: f64 = 6.0;
        const LEAST_PX: f64 = 0.3;
        while let Some(plane) = self.plane(corners) {
            let off = |corner: &DetectedCorner| {
                let expected = plane.project(self.cell(corner.index))?;
                let off = expected.position - Vector2::new(corner.pixel.u, corner.pixel.v);
                Some((corner.index, off.norm()))
            };
            let errors: Vec<(u32, f64)> = corners.values().filter_map(off).collect();
            let usual = median(errors.iter().map(|(_, error)| *error).collect()).unwrap_or(0.0);
            let worst = errors.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
            match worst.filter(|(_, error)| *error > (MEDIANS * usual).max(LEAST_PX)) {
                Some((index, _)) => corners.remove(&index),
                None => return,
            };
        }
    }
}

/// Kalibr's number of a corner that is counted clockwise from the upper left.
const fn index_of(corner: usize) -> u32 {
    3 - corner as u32
}

fn middle(tag: &Tag) -> Vector2<f64> {
    tag.iter().sum::<Vector2<f64>>() / 4.0
}

/// The tag's sides to the right and down, the mean of both opposite ones.
fn axes([top_left, top_right, bottom_right, bottom_left]: &Tag) -> [Vector2<f64>; 2] {
    [
        (top_right - top_left + bottom_right - bottom_left) * 0.5,
        (bottom_left - top_left + bottom_right - top_right) * 0.5,
    ]
}
