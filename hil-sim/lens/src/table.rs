//! All that a camera needs of a design, traced once: chief rays, light and spots over the angle to the axis.

use std::sync::{Arc, OnceLock};

use vergence_vision::Angle;

use crate::chief_rays::ChiefRays;
use crate::curve::{Curve, Symmetry};
use crate::design::{BuiltIn, Design};
use crate::error::DesignError;
use crate::trace::Limits;

/// Step of the angle from one spot to the next. A spot takes a thousand rays, and its width changes slowly.
const STEP: Angle = Angle::from_deg(2.0);

/// The f-number to which a lens is stopped down unless it is narrower itself: wide open, its spots are wider than the corners of a target
/// that a calibration measures.
const F_NUMBER: f64 = 2.8;

/// Curves of a design over the angle to the axis. Millimetres at the design's own size.
#[derive(Clone, Debug)]
pub struct LensTable {
    pub(crate) design: Design,
    pub(crate) focal_length: f64,
    pub(crate) rays: ChiefRays,
    /// Distance from the axis of the centroid of the spot.
    pub(crate) centroid: Curve,
    /// Root mean square widths of the spot, along the radius and across it.
    pub(crate) spot: [Curve; 2],
}

impl LensTable {
    /// Traces a design, with the light that `limits` let pass.
    ///
    /// # Errors
    /// Where no light passes inside the field that the design states.
    pub fn of(design: &Design, limits: Limits) -> Result<Self, DesignError> {
        let rays = ChiefRays::of(design, limits)?;
        let count = (rays.height.end() / STEP.rad()).floor() as usize;
        let angle = |number: usize| Angle::from_rad(STEP.rad() * number as f64);
        let spots = (0..=count).map(|number| design.spot(angle(number), limits)).collect::<Result<Vec<_>, _>>()?;
        let curve = |values: Vec<f64>, symmetry| Curve::new(STEP.rad(), values, symmetry);
        let off = curve(spots.iter().map(|spot| spot.centroid_from_chief).collect(), Symmetry::Odd);
        let centroid = rays.height.mapped(|theta, height| height + off.at(theta).0, Symmetry::Odd);
        Ok(Self {
            design: design.clone(),
            focal_length: design.focal_length(),
            centroid,
            spot: [
                curve(spots.iter().map(|spot| spot.radial).collect(), Symmetry::Even),
                curve(spots.iter().map(|spot| spot.tangential).collect(), Symmetry::Even),
            ],
            rays,
        })
    }

    /// The table of a built-in design at f/2.8, traced at the first call.
    ///
    /// # Errors
    /// None where the program was built from the files that its tests have read.
    pub fn built_in(lens: BuiltIn) -> Result<Arc<Self>, DesignError> {
        static TABLES: [OnceLock<Arc<LensTable>>; BuiltIn::ALL.len()] = [const { OnceLock::new() }; BuiltIn::ALL.len()];
        let cell = &TABLES[lens as usize];
        if let Some(table) = cell.get() {
            return Ok(Arc::clone(table));
        }
        let table = Arc::new(Self::of(&lens.design()?.stopped_down(F_NUMBER), lens.limits())?);
        Ok(Arc::clone(cell.get_or_init(|| table)))
    }

    /// The design's name.
    #[must_use]
    pub fn name(&self) -> &str {
        self.design.name()
    }

    /// The publication from which the design is.
    #[must_use]
    pub fn source(&self) -> &str {
        self.design.source()
    }

    /// The focal length divided by the diameter of the entrance pupil.
    #[must_use]
    pub const fn f_number(&self) -> f64 {
        self.design.f_number()
    }
}

impl BuiltIn {
    /// What ends its rays. The rims of the Nikkor are not known well enough: the patent prints none.
    const fn limits(self) -> Limits {
        match self {
            Self::Sigma8 => Limits::Rims,
            Self::Nikkor6 => Limits::Stop,
        }
    }
}
