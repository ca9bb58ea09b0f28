//! Laws of arrays by the splined stereographic model.
#![allow(clippy::expect_used, clippy::panic, reason = "a test fails loudly")]

mod foreign_models;

use foreign_models::{PINHOLE, SIZE, at, central};
use nalgebra::Vector3;
use proptest::prelude::*;
use vergence_vision::{
    BatchLens, Camera, Instructions, KannalaBrandt, Pixel, SightRegion, SplineGrid, SplinedStereographic, fit_lens,
};

const ROWS: u32 = 500;
/// Of so many pixels that a lens made, it may refuse one.
const REFUSED: usize = 100;

/// A lens whose surface has waves of any direction and length; `None` where it is no lens.
fn lens(order: usize, counts: [usize; 2], field_deg: f64, height: f64, waves: [f64; 4]) -> Option<KannalaBrandt> {
    let grid = SplineGrid { order, columns: counts[0], rows: counts[1], field_deg };
    let wave = |index: usize, [along, across]: [f64; 2]| {
        let place = [index % counts[0], index / counts[0]].map(|count| count as f64);
        height * (along * place[0] + across * place[1]).sin()
    };
    let [a, b, c, d] = waves;
    let control = (0..counts[0] * counts[1]).map(|index| [wave(index, [a, b]), wave(index, [c, d])]).collect();
    let model = central(SplinedStereographic { pinhole: PINHOLE, grid, control });
    let fit = fit_lens(model.as_ref(), SightRegion { size: SIZE, outline: &[] }).ok()?;
    Some(fit.lens.computed_by(model, 1.0))
}

proptest! {
    #![proptest_config(ProptestConfig { max_global_rejects: 24, ..ProptestConfig::with_cases(24) })]

    /// Inside the field and outside, arrays are what the model says of each point and pixel: the same refusals, and 1e-9 rad where it says something.
    #[test]
    fn arrays_are_the_model_inside_and_outside(
        order in 2..=3_usize,
        counts in [8..24_usize, 8..20_usize],
        field_deg in 120.0..220.0,
        height in 0.0..0.02,
        waves in [0.0..1.0, 0.0..1.0, 0.0..1.0, 0.0..1.0],
    ) {
        let Some(lens) = lens(order, counts, field_deg, height, waves) else { return Err(TestCaseError::reject("no lens")) };
        for instructions in [Instructions::Best, Instructions::Baseline] {
            let batch = BatchLens::new(&lens).with_instructions(instructions);
            let sent: Vec<_> = (0..ROWS).map(|row| at(3.1 * f64::from(row) / f64::from(ROWS), 2.4 * f64::from(row))).collect();
            let points: Vec<[f64; 3]> = sent.iter().map(|ray| (ray.vector() * 700.0).into()).collect();
            let pixels = batch.project(&points);
            for (sent, [u, v]) in sent.iter().zip(&pixels) {
                match lens.project(sent) {
                    Ok(pixel) => prop_assert!((pixel.u - u).hypot(pixel.v - v) < 1e-9 * PINHOLE[0], "{sent:?}: {u}, {v}"),
                    Err(_) => prop_assert!(u.is_nan() && v.is_nan(), "{sent:?}: {u}, {v}"),
                }
            }
            let seen = sent.iter().zip(&pixels).filter(|(_, pixel)| pixel[0].is_finite());
            let mut refused = 0;
            for (sent, back) in seen.clone().zip(batch.unproject(&seen.clone().map(|(_, pixel)| *pixel).collect::<Vec<_>>())) {
                // Another ray may have the same pixel, where the surface is folded.
                let single = lens.unproject::<Camera>(Pixel { u: sent.1[0], v: sent.1[1] }).map(|ray| ray.vector());
                refused += usize::from(single.is_err());
                let off = (Vector3::from(back) - single.unwrap_or(sent.0.vector())).norm();
                prop_assert!(off < 1e-9, "{sent:?}: {off}");
            }
            // Of pixels that the lens itself made it refuses none, or those beside folds.
            prop_assert!(refused * REFUSED <= seen.count(), "{refused} pixels refused");
            let raster: Vec<[f64; 2]> =
                (0..ROWS).map(|row| [f64::from(row % 25) * 120.0 - 400.0, f64::from(row / 25) * 150.0 - 450.0]).collect();
            for (&[u, v], back) in raster.iter().zip(batch.unproject(&raster)) {
                match lens.unproject::<Camera>(Pixel { u, v }) {
                    Ok(ray) => {
                        let off = (ray.vector() - Vector3::from(back)).norm();
                        prop_assert!(off < 1e-9, "{u}, {v}: {off}");
                    }
                    Err(_) => prop_assert!(back[0].is_nan(), "{u}, {v}: {back:?}"),
                }
            }
        }
    }
}
