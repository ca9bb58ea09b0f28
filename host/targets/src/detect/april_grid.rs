//! Finds a grid of AprilTags as Kalibr prints it, whole or in part.
//!
//! 1. Dark quads between saddle points are read as tags (`tags`): every tag says which it is and which way up.
//! 2. Tags that do not lie beside their neighbours as on the grid are dropped.
//! 3. Each corner is refined to a fraction of a pixel (`refine`).
//! 4. With a known camera, corners are refined again along edges that bend as it makes them, and tags that were missed are
//!    looked for where the others predict their corners; corners that are unlike the others are dropped (`labelled`).

use std::collections::BTreeMap;

use image::GrayImage;
use nalgebra::Vector2;
use vergence_vision::KannalaBrandt;

use super::intensity::Intensity;
use super::labelled::{Corners, LabelledTarget, Place};
use super::predict::Prediction;
use super::tags::{Quad, ReadCode, TagFamily, TagPlace, read_tag};
use super::{DetectError, DetectedCorner, FEWEST_CORNERS, SearchedImage};
use crate::AprilGridSpec;
use crate::april_grid::TAG_BORDER;

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
    detect_from(&SearchedImage::default(), image, grid, hint)
}

/// The same by what the search found in this image before.
pub fn detect_from(
    searched: &SearchedImage,
    image: &GrayImage,
    grid: &AprilGridSpec,
    hint: Option<&KannalaBrandt>,
) -> Result<Vec<DetectedCorner>, DetectError> {
    if !grid.is_usable() {
        return Err(DetectError::UnusableGrid { columns: grid.columns, rows: grid.rows });
    }
    let intensity = Intensity::new(image);
    let search = Search { image: &intensity, grid };
    let tags = search.beside_neighbours(&search.tags(searched.quads(image, &intensity)));
    let places = (0..4 * grid.tags()).map(|index| search.place(index)).collect();
    let target = LabelledTarget { image: &intensity, hint, places };
    let corners = target.judged(target.completed(search.measured(&tags, &target)));
    if corners.len() < FEWEST_CORNERS {
        return Err(DetectError::NoTags { found: corners.len() / 4 });
    }
    Ok(corners.into_values().collect())
}

/// What is looked for, and where.
struct Search<'a> {
    image: &'a Intensity<'a>,
    grid: &'a AprilGridSpec,
}

impl Search<'_> {
    /// Every tag of the grid that is read exactly once, by number.
    fn tags(&self, quads: &[Quad]) -> BTreeMap<u32, Tag> {
        const FAMILY: TagFamily = AprilGridSpec::FAMILY;
        let mut seen: BTreeMap<u32, Vec<Tag>> = BTreeMap::new();
        for quad in quads {
            let place = TagPlace { border: TAG_BORDER, margin: 0.0 };
            if let Some(ReadCode { id, quarters }) = read_tag(self.image, quad, &FAMILY, place, self.grid.tags()) {
                let mut corners = quad.corners;
                corners.rotate_left(quarters);
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

    /// The corners of `tags` that can be refined.
    fn measured(&self, tags: &BTreeMap<u32, Tag>, target: &LabelledTarget<'_>) -> Corners {
        let corners = tags.iter().flat_map(|(&id, tag)| (0..4).map(move |corner| (id, tag, corner)));
        let measured = corners
            .filter_map(|(id, tag, corner)| target.corner(id * 4 + index_of(corner), &self.by_tag(tag, corner), false));
        measured.collect()
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

    /// A corner as it is printed.
    fn place(&self, index: u32) -> Place {
        let cell = Vector2::from(self.grid.corner_mm(index)) / (self.grid.tag.mm() * self.grid.cell());
        // The tag lies to the right of and below its upper left corner, and the other way at the next one: dark there.
        Place { cell, colour: if index.is_multiple_of(2) { 1.0 } else { -1.0 } }
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
