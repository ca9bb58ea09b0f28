//! A lens of this program as a splined stereographic model, for mrcal, which has no polynomial fisheye model.

use nalgebra::{DMatrix, DVector};

use vergence_vision::{
    Camera, Formula, InvalidLens, KannalaBrandt, NoFit, Pixel, SplineGrid, SplinedStereographic, UnitRay,
};

/// A splined model in place of a lens, and how far it is off over the image.
#[derive(Clone, Debug, PartialEq)]
pub struct SplineFit {
    /// The model.
    pub model: SplinedStereographic,
    /// Root mean square of the distances between the pixels of equal rays, in pixels.
    pub rms_px: f64,
    /// The largest of these distances.
    pub largest_px: f64,
}

/// Control points across: a cubic spline of these is far below a thousandth of a pixel from any polynomial lens.
const COLUMNS: usize = 24;
/// Places across the image where lens and model are made to agree.
const ACROSS: u32 = 90;

/// A ray by its stereographic image, and its pixel.
struct Place {
    ray: UnitRay<Camera>,
    u: [f64; 2],
    pixel: Pixel,
}

/// Fits the control points of a cubic surface to the directions of a lens, by least squares over its image.
///
/// # Errors
/// [`NoFit`].
pub fn fit_spline(lens: &KannalaBrandt) -> Result<SplineFit, NoFit> {
    let places = places(lens);
    if places.len() < COLUMNS * COLUMNS {
        return Err(NoFit::Unseen(places.len()));
    }
    let extent = |axis: usize| places.iter().map(|place| place.u[axis].abs()).fold(0.0, f64::max);
    let fx = lens.k()[0];
    let pinhole = [fx, fx * lens.aspect(), lens.centre().u, lens.centre().v];
    // Rounded up to a whole degree: the name of the model holds it.
    let field_deg = (4.0 * (extent(0) / 2.0).atan()).to_degrees().ceil() + 1.0;
    let mut grid = SplineGrid { order: 3, columns: COLUMNS, rows: COLUMNS, field_deg };
    grid.rows = (2.0 * extent(1) * grid.intervals_per_unit()).ceil() as usize + 4;
    let mut model = SplinedStereographic { pinhole, grid, control: vec![[0.0; 2]; grid.columns * grid.rows] };
    model.control = control(&model, &places).ok_or(NoFit::Lens(InvalidLens::NotFinite))?;
    let off: Vec<f64> = places.iter().filter_map(|place| off(&model, place)).collect();
    let rms_px = (off.iter().map(|off| off * off).sum::<f64>() / off.len() as f64).sqrt();
    Ok(SplineFit { model, rms_px, largest_px: off.iter().copied().fold(0.0, f64::max) })
}

fn off(model: &SplinedStereographic, place: &Place) -> Option<f64> {
    let pixel = model.image(&place.ray.vector())?;
    Some((pixel.u - place.pixel.u).hypot(pixel.v - place.pixel.v))
}

fn places(lens: &KannalaBrandt) -> Vec<Place> {
    let size = lens.size();
    let step = f64::from(size.width.max(size.height)) / f64::from(ACROSS);
    let count = |pixels: u32| (f64::from(pixels) / step).round().max(1.0) as u32;
    let along = |index: u32, pixels: u32| f64::from(pixels) * f64::from(index) / f64::from(count(pixels)) - 0.5;
    let place = |pixel: Pixel| {
        let ray: UnitRay<Camera> = lens.unproject(pixel).ok()?;
        let d = ray.vector();
        Some(Place { ray, u: [2.0 * d.x / (1.0 + d.z), 2.0 * d.y / (1.0 + d.z)], pixel })
    };
    let rows = 0..=count(size.height);
    rows.flat_map(|row| (0..=count(size.width)).map(move |column| (row, column)))
        .filter_map(|(row, column)| place(Pixel { u: along(column, size.width), v: along(row, size.height) }))
        .collect()
}

/// The control points: both coordinates by the same normal equations. Those that no place tells stay near zero.
fn control(model: &SplinedStereographic, places: &[Place]) -> Option<Vec<[f64; 2]>> {
    let count = model.control.len();
    let mut normal = DMatrix::<f64>::zeros(count, count);
    let mut right = DMatrix::<f64>::zeros(count, 2);
    let [fx, fy, cx, cy] = model.pinhole;
    for place in places {
        let Some(weights) = model.weights(place.u) else { continue };
        let wanted = [(place.pixel.u - cx) / fx - place.u[0], (place.pixel.v - cy) / fy - place.u[1]];
        for (i, by_i) in &weights {
            for (j, by_j) in &weights {
                normal[(*i, *j)] += by_i * by_j;
            }
            right[(*i, 0)] += by_i * wanted[0];
            right[(*i, 1)] += by_i * wanted[1];
        }
    }
    let hold = 1e-9 * normal.diagonal().max();
    normal += DMatrix::from_diagonal(&DVector::from_element(count, hold));
    let solved = normal.cholesky()?.solve(&right);
    Some(solved.row_iter().map(|row| [row[0], row[1]]).collect())
}
