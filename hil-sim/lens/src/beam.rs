//! The beam that fills the stop: how much light passes at an angle, and the spot that it makes.

use nalgebra::Vector3;

use crate::design::Design;
use crate::error::LostRay;
use crate::surface::Ray;
use crate::trace::Limits;

/// Directions around the chief ray in which the edge of the beam is sought.
const AROUND: usize = 48;

/// Halvings of the interval that holds the edge.
const HALVINGS: usize = 30;

/// The image of a far point: where the rays of its beam meet the plane of the image. Millimetres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spot {
    /// How much farther from the axis the mean of the rays lies than the chief ray.
    pub centroid_from_chief: f64,
    /// Root mean square distance from the mean, along the radius.
    pub radial: f64,
    /// The same across it.
    pub tangential: f64,
}

/// Directions in the plane across a beam: away from the axis, and around it.
fn across(chief: &Ray) -> [Vector3<f64>; 2] {
    let around = Vector3::y();
    [around.cross(&chief.along), around]
}

/// The ray parallel to `chief` that is displaced from it.
fn displaced(chief: &Ray, by: Vector3<f64>) -> Ray {
    Ray { at: chief.at + by, ..*chief }
}

/// Distance from the chief ray to the edge of the beam, in each of the directions around it.
fn edge(design: &Design, chief: &Ray, limits: Limits) -> Vec<f64> {
    let widest = 2.0 * design.focal_length() / design.f_number();
    let [outward, around] = across(chief);
    let distance = |number: usize| {
        let angle = std::f64::consts::TAU * number as f64 / AROUND as f64;
        let direction = outward * angle.cos() + around * angle.sin();
        let (mut inside, mut outside) = (0.0, widest);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (inside + outside);
            if design.trace(&displaced(chief, direction * middle), limits).is_ok() {
                inside = middle;
            } else {
                outside = middle;
            }
        }
        inside
    };
    (0..AROUND).map(distance).collect()
}

/// Area across the beam of the rays parallel to `chief` that `limits` let pass, in mm².
pub fn area(design: &Design, chief: &Ray, limits: Limits) -> f64 {
    let edge = edge(design, chief, limits);
    // ½ r² dφ over even steps of φ: exact to the order of the smoothness of the edge.
    edge.iter().map(|r| 0.5 * r * r).sum::<f64>() * std::f64::consts::TAU / edge.len() as f64
}

/// Rings of equal area of the beam, each with a ray in every direction.
const RINGS: usize = 24;

/// The spot of a far point in the paraxial plane of the image, by rays spread evenly over the beam.
pub fn spot(design: &Design, chief: &Ray, limits: Limits) -> Result<Spot, LostRay> {
    let [outward, around] = across(chief);
    let [chief_height, _] = design.on_image(chief, limits)?;
    let edge = edge(design, chief, limits);
    let rays = edge.iter().enumerate().flat_map(|(number, edge)| {
        let angle = std::f64::consts::TAU * number as f64 / AROUND as f64;
        let direction = (outward * angle.cos() + around * angle.sin()) * *edge;
        (0..RINGS).map(move |ring| (direction * ((ring as f64 + 0.5) / RINGS as f64).sqrt(), edge * edge))
    });
    // A direction in which the beam is wide holds more light.
    let (mut light, mut sum, mut squares) = (0.0, [0.0; 2], [0.0; 2]);
    for (by, weight) in rays {
        if let Ok(at) = design.on_image(&displaced(chief, by), limits) {
            light += weight;
            for axis in 0..2 {
                sum[axis] += weight * at[axis];
                squares[axis] += weight * at[axis] * at[axis];
            }
        }
    }
    let mean = sum.map(|sum| sum / light);
    let rms = |axis: usize| (squares[axis] / light - mean[axis] * mean[axis]).max(0.0).sqrt();
    Ok(Spot { centroid_from_chief: mean[0] - chief_height, radial: rms(0), tangential: rms(1) })
}
