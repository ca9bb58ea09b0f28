//! Dark four-sided shapes between saddle points: the tags of a grid, whose corners touch small black squares.
//!
//! At such a corner black meets black across white, as on a chessboard, and edges run off in four directions. Each edge
//! is followed to the nearest saddle point that looks back along it, with dark on its right and light on its left all the
//! way; four such edges that end where they began go clockwise around something dark. Edges may bend: they are cubic
//! curves through both ends in the directions in which they start and end.

use image::GrayImage;
use nalgebra::Vector2;

use crate::detect::intensity::Intensity;
use crate::detect::search::features;

/// A dark shape with four corners.
#[derive(Clone, Copy, Debug)]
pub struct Quad {
    /// Clockwise, as seen.
    pub corners: [Vector2<f64>; 4],
    /// How far the middle of the edge after each corner lies from the straight line to the next one.
    pub bows: [Vector2<f64>; 4],
    /// Least difference between light and dark along the edges, in grey levels.
    pub contrast: f64,
}

/// A saddle point: two dark quarters opposite each other.
struct Saddle {
    at: Vector2<f64>,
    /// Unit vectors along the edges, clockwise as seen; dark lies between the first and the second and between the third
    /// and the fourth.
    rays: [Vector2<f64>; 4],
}

/// A dark quarter of a saddle point: the index of the saddle and that of the quarter, 0 or 1.
type Quarter = (usize, usize);

impl Saddle {
    /// The edge that leaves the quarter clockwise around its dark, and the one that arrives, both outwards.
    fn edges(&self, quarter: usize) -> [Vector2<f64>; 2] {
        let [first, second, third, fourth] = self.rays;
        if quarter == 0 { [first, second] } else { [third, fourth] }
    }
}

/// An edge between two saddle points.
struct Edge {
    to: Quarter,
    bow: Vector2<f64>,
    contrast: f64,
}

/// All dark quads of the image, in the order of the search's saddle points.
pub fn dark_quads(image: &GrayImage, intensity: &Intensity<'_>) -> Vec<Quad> {
    let saddles: Vec<Saddle> = features(image)
        .iter()
        .filter_map(|feature| {
            let at = Vector2::new(f64::from(feature.position.x), f64::from(feature.position.y));
            let angles = [feature.axes.first()?.angle, feature.axes.get(1)?.angle].map(f64::from);
            saddle(intensity, at, angles)
        })
        .collect();
    let edges: Vec<[Option<Edge>; 2]> = (0..saddles.len())
        .map(|index| [0, 1].map(|quarter| edge_from(&saddles, intensity, (index, quarter))))
        .collect();
    let next = |(index, quarter): Quarter| edges.get(index)?.get(quarter)?.as_ref();
    let mut quads = Vec::new();
    for first in (0..saddles.len()).flat_map(|index| [(index, 0), (index, 1)]) {
        let (mut at, mut around, mut sides) = (first, Vec::new(), Vec::new());
        while let Some(edge) = next(at).filter(|_| sides.len() < 4) {
            around.push(at);
            sides.push(edge);
            at = edge.to;
        }
        // Each quad once: from its first corner.
        let (Ok([a, b, c, d]), Ok(sides)) = (<[Quarter; 4]>::try_from(around), <[&Edge; 4]>::try_from(sides)) else {
            continue;
        };
        if at != first || [b, c, d].iter().any(|corner| *corner <= a) {
            continue;
        }
        let corner = |(index, _): Quarter| saddles.get(index).map_or_else(Vector2::zeros, |saddle| saddle.at);
        quads.push(Quad {
            corners: [a, b, c, d].map(corner),
            bows: sides.map(|edge| edge.bow),
            contrast: sides.iter().map(|edge| edge.contrast).fold(f64::INFINITY, f64::min),
        });
    }
    quads
}

/// The saddle point at `at` with edges at these angles from the x axis towards the y axis, in radians; `None` where the
/// quarters do not alternate.
fn saddle(image: &Intensity<'_>, at: Vector2<f64>, angles: [f64; 2]) -> Option<Saddle> {
    use std::f64::consts::PI;
    /// Distances at which the quarters are read, in pixels: inside the smallest squares that the search finds.
    const RADII_PX: [f64; 2] = [2.5, 4.0];
    const LEAST_CONTRAST: f64 = 8.0;
    let [a, b] = angles.map(|angle| angle.rem_euclid(PI));
    let (low, high) = (a.min(b), a.max(b));
    let bounds = [low, high, low + PI, high + PI];
    let ray = |angle: f64| Vector2::new(angle.cos(), angle.sin());
    let quarter = |from: f64, to: f64| {
        let towards = ray(0.5 * (from + to));
        let levels = RADII_PX.map(|radius| image.between(at + radius * towards));
        levels.iter().copied().sum::<Option<f64>>().map(|sum| sum / RADII_PX.len() as f64)
    };
    let levels = [
        quarter(low, high)?,
        quarter(high, low + PI)?,
        quarter(low + PI, high + PI)?,
        quarter(high + PI, low + 2.0 * PI)?,
    ];
    let rays = bounds.map(ray);
    let saddle = 0.5 * (levels[1] + levels[3] - levels[0] - levels[2]);
    if saddle.abs() < LEAST_CONTRAST {
        return None;
    }
    let rays = if saddle > 0.0 { rays } else { [rays[1], rays[2], rays[3], rays[0]] };
    Some(Saddle { at, rays })
}

/// The edge that leaves a dark quarter clockwise: to the nearest saddle point at its other end.
fn edge_from(saddles: &[Saddle], image: &Intensity<'_>, (index, quarter): Quarter) -> Option<Edge> {
    /// Edges turn by less than this from end to end: cosine of about 25°.
    const LEAST_COSINE: f64 = 0.9;
    const SHORTEST_PX: f64 = 4.0;
    let from = saddles.get(index)?;
    let [leaving, _] = from.edges(quarter);
    let mut ends: Vec<(f64, Quarter, Vector2<f64>)> = Vec::new();
    for (other, saddle) in saddles.iter().enumerate() {
        let way = saddle.at - from.at;
        let length = way.norm();
        if length < SHORTEST_PX || way.dot(&leaving) < LEAST_COSINE * length {
            continue;
        }
        for quarter in [0, 1] {
            let [_, arriving] = saddle.edges(quarter);
            if -way.dot(&arriving) >= LEAST_COSINE * length {
                ends.push((length, (other, quarter), arriving));
            }
        }
    }
    ends.sort_by(|a, b| a.0.total_cmp(&b.0));
    ends.into_iter().find_map(|(length, to, arriving)| {
        let end = saddles.get(to.0)?.at;
        // Of the cubic curve with these tangents; the part along the edge bends nothing.
        let bow = (leaving + arriving) * (length / 8.0);
        let along = (end - from.at) / length;
        let bow = bow - along * bow.dot(&along);
        let contrast = contrast_along(image, [from.at, end], bow)?;
        Some(Edge { to, bow, contrast })
    })
}

/// Least difference between light on the left and dark on the right of an edge; `None` where there is none.
fn contrast_along(image: &Intensity<'_>, [start, end]: [Vector2<f64>; 2], bow: Vector2<f64>) -> Option<f64> {
    const ALONG: [f64; 5] = [0.15, 0.325, 0.5, 0.675, 0.85];
    /// Inside the black border of a tag, which is an eighth of its side at least.
    const ASIDE: f64 = 0.06;
    const LEAST_ASIDE_PX: f64 = 1.3;
    const LEAST_CONTRAST: f64 = 12.0;
    let way = end - start;
    let right = Vector2::new(-way.y, way.x) / way.norm();
    let aside = right * (ASIDE * way.norm()).max(LEAST_ASIDE_PX);
    let differences = ALONG.map(|part| {
        let at = start + way * part + bow * (4.0 * part * (1.0 - part));
        Some(image.between(at - aside)? - image.between(at + aside)?)
    });
    let least = differences.into_iter().try_fold(f64::INFINITY, |least, difference| Some(least.min(difference?)))?;
    (least >= LEAST_CONTRAST).then_some(least)
}
