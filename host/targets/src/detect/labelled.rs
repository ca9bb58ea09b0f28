//! Corners of which it is known where on a flat target they are: measured, completed and judged by one another.

use std::collections::BTreeMap;

use nalgebra::Vector2;
use vergence_vision::{KannalaBrandt, Pixel, median};

use super::intensity::Intensity;
use super::plane::TargetPlane;
use super::predict::Prediction;
use super::refine::refine;
use super::saddle::Quadrants;
use super::{CornerQuality, DetectedCorner};

/// A corner as it is printed.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Place on the target in cells: a cell is that part of the target about a corner which looks as on a chessboard.
    pub cell: Vector2<f64>,
    /// The sign of [`Quadrants::saddle`]: 1 where the quarter to the right and below is white.
    pub colour: f64,
}

/// The corners that were found, by index.
pub type Corners = BTreeMap<u32, DetectedCorner>;

/// An image, and the target that it shows.
pub struct LabelledTarget<'a> {
    pub image: &'a Intensity<'a>,
    /// A camera calibrated roughly, if there is one.
    pub hint: Option<&'a KannalaBrandt>,
    /// Every corner of the target, by index.
    pub places: Vec<Place>,
}

impl LabelledTarget<'_> {
    /// The corner near where it is expected, if there is one with the right colours.
    pub fn corner(&self, index: u32, expected: &Prediction, filled: bool) -> Option<(u32, DetectedCorner)> {
        const SMALLEST_PX: f64 = 5.0;
        const LEAST_CONTRAST: f64 = 16.0;
        let spacing = expected.spacing();
        if spacing.is_nan() || spacing < SMALLEST_PX || self.image.margin(expected.position) < 0.0 {
            return None;
        }
        let found = refine(self.image, expected.position, expected)?;
        let quadrants = Quadrants::read(self.image, found.position, &expected.steps)?;
        let colour = self.places.get(index as usize)?.colour;
        let clear = quadrants.is_corner(LEAST_CONTRAST) && quadrants.saddle() * colour > 0.0;
        let pixel = Pixel { u: found.position.x, v: found.position.y };
        let corner = DetectedCorner { index, pixel, sigma_px: found.sigma_px, filled, quality: CornerQuality::Good };
        clear.then_some((index, corner))
    }

    /// With a known camera: the corners, measured again along edges that bend as it makes them, and those that they predict
    /// besides.
    pub fn completed(&self, mut corners: Corners) -> Corners {
        for _ in 0..2 {
            let Some(plane) = self.plane(&corners) else { break };
            let expected =
                (0..).zip(&self.places).filter_map(|(index, place)| Some((index, plane.project(place.cell)?)));
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

    /// The corners without those that are unlike the others.
    pub fn judged(&self, mut corners: Corners) -> Corners {
        self.drop_unclear(&mut corners);
        self.drop_misplaced(&mut corners);
        corners
    }

    fn cell(&self, index: u32) -> Option<Vector2<f64>> {
        self.places.get(index as usize).map(|place| place.cell)
    }

    fn plane(&self, corners: &Corners) -> Option<TargetPlane<'_>> {
        let at = |corner: &DetectedCorner| Vector2::new(corner.pixel.u, corner.pixel.v);
        let observed: Vec<_> =
            corners.values().filter_map(|corner| Some((self.cell(corner.index)?, at(corner)))).collect();
        TargetPlane::fit(self.hint?, &observed)
    }

    /// Drops corners whose grey levels fit a corner much less than those of the corners about them do.
    fn drop_unclear(&self, corners: &mut Corners) {
        // As for chessboards.
        const MEDIANS: f64 = 1.8;
        const NEIGHBOURS: usize = 12;
        let unclear = |corner: &DetectedCorner| {
            let own = self.cell(corner.index)?;
            let mut others: Vec<(f64, f64)> = corners
                .values()
                .filter(|other| other.index != corner.index)
                .filter_map(|other| Some(((self.cell(other.index)? - own).norm(), other.sigma_px)))
                .collect();
            others.sort_by(|a, b| a.0.total_cmp(&b.0));
            let usual = median(others.into_iter().take(NEIGHBOURS).map(|(_, sigma)| sigma).collect())?;
            (corner.sigma_px > MEDIANS * usual).then_some(corner.index)
        };
        let bad: Vec<u32> = corners.values().filter_map(unclear).collect();
        corners.retain(|index, _| !bad.contains(index));
    }

    /// Drops corners that are much further than the others from where the plane of the target has them, the worst first.
    fn drop_misplaced(&self, corners: &mut Corners) {
        const MEDIANS: f64 = 6.0;
        const LEAST_PX: f64 = 0.3;
        while let Some(plane) = self.plane(corners) {
            let off = |corner: &DetectedCorner| {
                let expected = plane.project(self.cell(corner.index)?)?;
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
