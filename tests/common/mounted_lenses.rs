//! Lenses traced through a published design, in the place of a bench's ideal ones, and how well they are mounted.
#![allow(dead_code, reason = "each test file uses its own part")]

use vergence_lens::Displacement;
use vergence_scene::{LensChoice, TrueLens};
use vergence_vision::{Angle, KannalaBrandt, Length};

#[derive(Clone, Copy)]
pub enum Mounted {
    Perfectly,
    By(Mounting),
    /// As lenses are: by a share of [`BADLY`] that lies anywhere between none and all, which is what calibrations count on before any view.
    AsUsual,
}

/// In micrometres and degrees.
#[derive(Clone, Copy)]
pub struct Mounting {
    pub decentre_um: f64,
    pub tilt_deg: f64,
    pub sensor_tilt_deg: f64,
}

pub const BADLY: Mounting = Mounting { decentre_um: 10.0, tilt_deg: 0.05, sensor_tilt_deg: 0.4 };

impl Mounted {
    /// The lens of this `design` in the place of an ideal one. The seed decides where the elements are.
    pub fn lens(self, design: &str, ideal: &KannalaBrandt, seed: u64) -> TrueLens {
        let choice: LensChoice = design.parse().expect("a lens");
        let lens = choice.in_place_of(ideal).expect("a lens");
        let (Some(displacement), TrueLens::Traced(traced)) = (self.displacement(seed), &lens) else {
            return lens;
        };
        TrueLens::Traced(traced.clone().displaced(&displacement).expect("light in the whole field"))
    }

    /// How badly, and by which share of it; `None` of a lens whose elements are where they should be.
    fn displacement(self, seed: u64) -> Option<Displacement> {
        /// Multiples of the golden section lie evenly between 0 and 1.
        const GOLDEN: f64 = 0.618_033_988_749_894_9;
        let (by, share) = match self {
            Self::Perfectly => return None,
            Self::By(mounting) => (mounting, 1.0),
            Self::AsUsual => (BADLY, (0.37 + GOLDEN * seed as f64).fract()),
        };
        Some(Displacement {
            decentre: Length::from_mm(share * 1e-3 * by.decentre_um),
            tilt: Angle::from_deg(share * by.tilt_deg),
            sensor_tilt: Angle::from_deg(share * by.sensor_tilt_deg),
            seed,
        })
    }
}
