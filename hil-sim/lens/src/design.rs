//! The design of a lens: its surfaces, as its file lists them.

use serde::Deserialize;
use vergence_vision::Angle;

use crate::error::DesignError;
use crate::surface::Surface;

/// A lens: surfaces in the order in which light meets them, one of them the stop. Millimetres.
#[derive(Clone, Debug)]
pub struct Design {
    name: String,
    source: String,
    f_number: f64,
    field: Angle,
    pub(crate) surfaces: Vec<Surface>,
    /// Index of the stop.
    pub(crate) stop: usize,
    /// Place of the image on the axis.
    pub(crate) image: f64,
}

/// The designs that come with the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BuiltIn {
    /// 197 degrees, f/1.82, 17 elements: JP 2016-184136 A, numerical example 7.
    Sigma8,
    /// 220 degrees, f/2.8, 12 elements, a pupil that moves far: US 3,737,214, example I.
    Nikkor6,
}

impl BuiltIn {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Sigma8, Self::Nikkor6];

    /// The design's name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sigma8 => "sigma8_f18",
            Self::Nikkor6 => "nikkor6_f28",
        }
    }

    /// The design's file.
    #[must_use]
    pub const fn toml(self) -> &'static str {
        match self {
            Self::Sigma8 => include_str!("../designs/sigma8_f18.toml"),
            Self::Nikkor6 => include_str!("../designs/nikkor6_f28.toml"),
        }
    }

    /// The design.
    ///
    /// # Errors
    /// None where the program was built from the files that its tests have read.
    pub fn design(self) -> Result<Design, DesignError> {
        Design::from_toml(self.toml())
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct DesignFile {
    name: String,
    source: String,
    f_number: f64,
    field: String,
    surfaces: Vec<SurfaceLine>,
}

/// One surface and the medium behind it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SurfaceLine {
    radius: Option<f64>,
    #[serde(default)]
    conic: f64,
    #[serde(default)]
    powers: Vec<f64>,
    thickness: f64,
    #[serde(default = "air")]
    index: f64,
    rim: f64,
    #[serde(default)]
    stop: bool,
}

const fn air() -> f64 {
    1.0
}

impl SurfaceLine {
    fn check(&self) -> Result<(), &'static str> {
        let finite = [self.conic, self.thickness, self.index, self.rim, self.radius.unwrap_or(1.0)];
        if !finite.iter().chain(&self.powers).all(|value| value.is_finite()) {
            Err("a value is not a finite number")
        } else if self.radius == Some(0.0) {
            Err("a radius of 0 is no surface; a plane has no radius")
        } else if self.thickness < 0.0 {
            Err("the thickness is negative; surfaces are listed in the order in which light meets them")
        } else if self.index < 1.0 {
            Err("the refractive index is below 1")
        } else if self.rim <= 0.0 {
            Err("the rim must be a positive distance from the axis")
        } else {
            Ok(())
        }
    }
}

impl Design {
    /// Reads a design, whose values are millimetres.
    ///
    /// # Errors
    /// Where the text is not a design's, a value cannot be meant, or the surfaces focus no light.
    pub fn from_toml(text: &str) -> Result<Self, DesignError> {
        let file: DesignFile = toml::from_str(text)?;
        for (index, line) in file.surfaces.iter().enumerate() {
            line.check().map_err(|what| DesignError::Surface { surface: index + 1, what })?;
        }
        let mut stops = file.surfaces.iter().enumerate().filter(|(_, line)| line.stop).map(|(index, _)| index);
        let (Some(stop), None) = (stops.next(), stops.next()) else {
            return Err(DesignError::NoLens("a lens has one stop: one surface with `stop = true`"));
        };
        let field: Angle =
            file.field.parse().map_err(|_| DesignError::NoLens("`field` is an angle, such as \"197deg\""))?;
        if !(field.deg() > 0.0 && field.deg() < 360.0 && file.f_number > 0.0 && file.f_number.is_finite()) {
            return Err(DesignError::NoLens("`field` lies between 0 and 360 degrees, and `f_number` is positive"));
        }
        let (surfaces, image) = placed(&file.surfaces);
        let design =
            Self { name: file.name, source: file.source, f_number: file.f_number, field, surfaces, stop, image };
        let focal_length = design.focal_length();
        if !(focal_length.is_finite() && focal_length > 0.0) {
            return Err(DesignError::NoLens("these surfaces focus no light"));
        }
        Ok(design)
    }

    /// The design's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The publication from which the numbers are.
    #[must_use]
    pub fn source(&self) -> &str {
        &self.source
    }

    /// The focal length divided by the diameter of the entrance pupil.
    #[must_use]
    pub const fn f_number(&self) -> f64 {
        self.f_number
    }

    /// The whole field, from edge to edge.
    #[must_use]
    pub const fn field(&self) -> Angle {
        self.field
    }

    /// The same lens in another size: with a focal length of `mm`.
    #[must_use]
    pub fn with_focal_length(mut self, mm: f64) -> Self {
        let factor = mm / self.focal_length();
        for surface in &mut self.surfaces {
            surface.vertex *= factor;
            surface.curvature /= factor;
            surface.rim *= factor;
            let mut order = 3;
            for power in &mut surface.powers {
                *power /= factor.powi(order);
                order += 2;
            }
        }
        self.image *= factor;
        self
    }

    /// The same lens with its stop closed to `f_number`; it does not open further than designed.
    #[must_use]
    pub fn stopped_down(mut self, f_number: f64) -> Self {
        let closed = f_number.max(self.f_number);
        self.surfaces[self.stop].rim *= self.f_number / closed;
        self.f_number = closed;
        self
    }
}

/// The surfaces at their places on the axis, and the place of the image.
fn placed(lines: &[SurfaceLine]) -> (Vec<Surface>, f64) {
    let (mut vertex, mut index_before) = (0.0, air());
    let surfaces = lines.iter().map(|line| {
        let surface = Surface {
            vertex,
            curvature: line.radius.map_or(0.0, f64::recip),
            conic: line.conic,
            powers: line.powers.clone(),
            index_before,
            index_behind: line.index,
            rim: line.rim,
        };
        vertex += line.thickness;
        index_before = line.index;
        surface
    });
    (surfaces.collect(), vertex)
}
