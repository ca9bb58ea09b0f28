//! The methods of triangulation on the page.

use vergence_page::{Cell, fixed, note, plain, table, text};
use vergence_vision::Kernel;

use crate::study;

/// The tables of triangulation with noise and with slipped matches.
pub fn body(samples: u32) -> String {
    /// Seed of the noise.
    const SEED: u64 = 7;
    let names: Vec<&str> = study::METHODS.iter().map(Kernel::as_str).collect();
    let noise = study::NOISE_PLACES.iter().map(|(name, place)| {
        let rms = study::with_noise(place, 1.0, samples, SEED);
        plain([vec![text(*name)], cells(rms.map(|rms| rms.to_vec()), 3)].concat())
    });
    let slips = study::SLIPS.iter().map(|(name, place, slip)| {
        let errors = study::with_slip(place, *slip);
        let errors = errors.map(|(errors, by_edge)| [errors.as_slice(), &[by_edge]].concat());
        plain([vec![text(format!("{name}, {slip:.0}"))], cells(errors, 2)].concat())
    });
    let noise_heads = [&["point at 350 mm"], names.as_slice()].concat();
    let slip_heads = [&["mode, slip"], names.as_slice(), &["edge plane"]].concat();
    [
        "<h3>With ordinary noise</h3>\n".to_owned(),
        table(&noise_heads, &noise.collect::<Vec<_>>()),
        note(&format!(
            "Root mean square error of the distance from the middle of the rig in millimetres, 1 px of noise in every coordinate at \
             560 px/rad, {samples} samples. No method is better than another."
        )),
        "<h3>With matches that slipped along a vertical edge</h3>\n".to_owned(),
        table(&slip_heads, &slips.collect::<Vec<_>>()),
        note(
            "Error of the depth in millimetres at 350 mm. Here the midpoint falls short, and the pseudo-intersection does not. \
             An error along the epipolar plane is the same in every method.",
        ),
    ]
    .concat()
}

fn cells(values: Option<Vec<f64>>, decimals: i32) -> Vec<Cell> {
    values.unwrap_or_default().into_iter().map(|value| Cell::Number(fixed(value, decimals))).collect()
}
