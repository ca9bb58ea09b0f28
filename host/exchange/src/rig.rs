//! Cameras read from a file of another program, and the choice of one or two of them.

use vergence_vision::{
    Base, Camera, CameraModel, Central, Formula, ImageSize, InvalidLens, KannalaBrandt, Left, LensFit, NoFit,
    OpenCvFisheye, Pixel, Right, SightRegion, Transform, fit_lens, model_of,
};

use crate::{ExchangeError, Format};

/// A camera of another program.
#[derive(Debug)]
pub struct ForeignCamera {
    /// Its name in the file.
    pub name: String,
    /// Its model.
    pub model: Box<dyn CameraModel>,
    /// Size of its images.
    pub size: ImageSize,
    /// Corners of a polygon in the image outside of which it was not measured; empty where the file says nothing of it.
    pub outline: Vec<Pixel>,
    /// Where it is relative to what the cameras of the file have in common: the first camera, a body, a world. `None` where the file does
    /// not say.
    pub base_from_camera: Option<Transform<Base, Camera>>,
}

/// The cameras of a file.
#[derive(Debug)]
pub struct ForeignRig {
    /// Its format.
    pub format: Format,
    /// The cameras in the order of the file.
    pub cameras: Vec<ForeignCamera>,
}

/// Two cameras and where one is relative to the other.
#[derive(Debug)]
pub struct ForeignPair<'a> {
    /// The left camera.
    pub left: &'a ForeignCamera,
    /// The right camera.
    pub right: &'a ForeignCamera,
    /// The pose of the right camera in the frame of the left one.
    pub left_from_right: Transform<Left, Right>,
}

impl ForeignCamera {
    /// A camera of which only the model is known.
    pub(crate) fn new(name: impl Into<String>, model: Box<dyn CameraModel>, size: ImageSize) -> Self {
        Self { name: name.into(), model, size, outline: Vec::new(), base_from_camera: None }
    }

    pub(crate) fn at(self, base_from_camera: Option<Transform<Base, Camera>>) -> Self {
        Self { base_from_camera, ..self }
    }

    /// The lens of this camera, computed by its own model, and how far the polynomial that comes nearest is off that.
    ///
    /// # Errors
    /// [`ExchangeError::Fit`] where no polynomial comes near.
    pub fn lens(&self) -> Result<LensFit, ExchangeError> {
        let region = SightRegion { size: self.size, outline: &self.outline };
        let fail = |fit| ExchangeError::Fit { camera: self.name.clone(), fit };
        let fit = fit_lens(self.model.as_ref(), region).map_err(fail)?;
        if self.model.as_kannala_brandt().is_some() {
            return Ok(fit);
        }
        let values = self.model.parameters().into_iter().map(|parameter| (parameter.name, parameter.value)).collect();
        let model = model_of(self.model.name(), &values).map_err(|lens| fail(NoFit::Lens(lens)))?;
        Ok(LensFit { lens: fit.lens.computed_by(model, 1.0), ..fit })
    }

    /// By which model the camera is computed, and how far the nearest polynomial is off that, in words; `None` of a camera of this program's
    /// own model.
    #[must_use]
    pub fn remark(&self, fit: &LensFit) -> Option<String> {
        let LensFit { rms_px, largest_px, largest_at, .. } = *fit;
        self.model.as_kannala_brandt().is_none().then(|| {
            format!(
                "{} has the {} model and is computed by it; the polynomial lens that stands for it where other programs or a calibration \
                 change it is {rms_px:.3} px rms off it, {largest_px:.3} px at most, at {largest_at:.1} from the axis",
                self.name,
                self.model.name()
            )
        })
    }
}

impl ForeignRig {
    /// The camera called `name`; where there is none, the one of this number, counted from zero; without a name, the only one.
    ///
    /// # Errors
    /// Where there is no such camera, or several and none is named.
    pub fn camera(&self, name: Option<&str>) -> Result<&ForeignCamera, ExchangeError> {
        let Some(name) = name else {
            return match self.cameras.as_slice() {
                [only] => Ok(only),
                _ => Err(ExchangeError::Several { names: self.names() }),
            };
        };
        let by_name = self.cameras.iter().find(|camera| camera.name == name);
        let by_number = || name.parse().ok().and_then(|index: usize| self.cameras.get(index));
        by_name.or_else(by_number).ok_or_else(|| ExchangeError::NoCamera { name: name.to_owned(), names: self.names() })
    }

    /// Two cameras: those that are named, left and right, or the only two there are, in the order of the file.
    ///
    /// # Errors
    /// Where there are not such two, or the file does not say where they are.
    pub fn pair(&self, names: Option<[&str; 2]>) -> Result<ForeignPair<'_>, ExchangeError> {
        let (left, right) = match (names, self.cameras.as_slice()) {
            (Some([left, right]), _) => (self.camera(Some(left))?, self.camera(Some(right))?),
            (None, [left, right]) => (left, right),
            (None, _) => return Err(ExchangeError::NotTwo { names: self.names() }),
        };
        ForeignPair::new(left, right)
    }

    /// The names of the cameras.
    #[must_use]
    pub fn names(&self) -> Vec<String> {
        self.cameras.iter().map(|camera| camera.name.clone()).collect()
    }
}

impl<'a> ForeignPair<'a> {
    /// Two cameras of one file, or of two whose poses are relative to the same body.
    ///
    /// # Errors
    /// [`ExchangeError::NoPose`], and [`ExchangeError::NotTwo`] of one camera twice.
    pub fn new(left: &'a ForeignCamera, right: &'a ForeignCamera) -> Result<Self, ExchangeError> {
        if std::ptr::eq(left, right) {
            return Err(ExchangeError::NotTwo { names: vec![left.name.clone()] });
        }
        let place = |camera: &ForeignCamera| {
            camera.base_from_camera.ok_or_else(|| ExchangeError::NoPose { camera: camera.name.clone() })
        };
        let left_from_right = (place(left)?.inverse() * place(right)?).renamed();
        if left_from_right.origin().mm().norm() == 0.0 {
            // Files of single cameras put each at its own origin.
            return Err(ExchangeError::NoPose { camera: right.name.clone() });
        }
        Ok(Self { left, right, left_from_right })
    }
}

/// What is needed to say that a camera of a file is none.
pub struct Place<'a> {
    pub format: Format,
    pub camera: &'a str,
}

impl Place<'_> {
    /// A camera of the model `formula`.
    pub fn central(&self, formula: impl Formula + 'static) -> Result<Box<dyn CameraModel>, ExchangeError> {
        Ok(Box::new(Central::new(formula).map_err(|lens| self.invalid(lens))?))
    }

    /// A fisheye lens of OpenCV's form: up to the stated angle, or as far as image and polynomial allow.
    pub fn fisheye(
        &self,
        [fx, fy, cx, cy]: [f64; 4],
        k: [f64; 4],
        size: ImageSize,
        theta_max_deg: Option<f64>,
    ) -> Result<Box<dyn CameraModel>, ExchangeError> {
        let lens = OpenCvFisheye { fx, fy, cx, cy, k };
        let limit =
            theta_max_deg.map_or_else(|| lens.largest_theta(size), |deg| Ok(vergence_vision::Angle::from_deg(deg)));
        let lens = limit.and_then(|limit| KannalaBrandt::from_opencv(lens, limit, size));
        Ok(Box::new(lens.map_err(|lens| self.invalid(lens))?))
    }

    pub fn invalid(&self, lens: InvalidLens) -> ExchangeError {
        ExchangeError::Lens { format: self.format, camera: self.camera.to_owned(), lens }
    }
}
