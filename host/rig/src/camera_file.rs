//! Cameras as TOML: the table that rig files and camera files share.

use std::collections::BTreeMap;

use nalgebra::SMatrix;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use vergence_vision::{
    Angle, Asymmetry, CENTRAL_PARAMETERS, ForeignModel, ImageSize, InvalidLens, KannalaBrandt, LENS_PARAMETERS,
    OpenCvFisheye, Pupil, Time, model_of,
};

use crate::exposure::Shutter;
use crate::text::{angle_text, optional_quantity, time_text};

/// The keys of a camera table, with coefficients as in OpenCV fisheye and Kalibr equidistant files.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraTable {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Half the field of view. If absent, [`OpenCvFisheye::largest_theta`].
    #[serde(
        default,
        deserialize_with = "optional_quantity",
        serialize_with = "angle_text",
        skip_serializing_if = "Option::is_none"
    )]
    pub theta_max: Option<Angle>,
    /// Time from the exposure of one row to that of the next, of a rolling shutter; negative where the image is read
    /// from the bottom. If absent, all rows are exposed at once.
    #[serde(
        default,
        deserialize_with = "optional_quantity",
        serialize_with = "time_text",
        skip_serializing_if = "Option::is_none"
    )]
    pub line_time: Option<Time>,
    /// Horizontal focal length in pixels.
    pub fx: f64,
    /// Vertical focal length in pixels.
    pub fy: f64,
    /// Column of the principal point in pixels.
    pub cx: f64,
    /// Row of the principal point in pixels.
    pub cy: f64,
    /// Coefficient of θ³ relative to that of θ.
    pub opencv_k1: f64,
    /// Coefficient of θ⁵ relative to that of θ.
    pub opencv_k2: f64,
    /// Coefficient of θ⁷ relative to that of θ.
    pub opencv_k3: f64,
    /// Coefficient of θ⁹ relative to that of θ.
    pub opencv_k4: f64,
    /// Coefficient e0 of the pupil's shift (θ / sin θ - 1) (e0 + e1 θ²), in millimetres. Absent is zero, here and below: the lens is central.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub pupil_e0_mm: f64,
    /// Coefficient e1, in millimetres.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub pupil_e1_mm: f64,
    /// Decentring p1, in the order of FISHEYE624: OpenCV calls it p2.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub tangential_p1: f64,
    /// Decentring p2; OpenCV's p1.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub tangential_p2: f64,
    /// Thin prism along u, of the square of the radius in focal lengths.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub prism_s0: f64,
    /// Thin prism along u, of its fourth power.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub prism_s1: f64,
    /// Thin prism along v, of the square.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub prism_s2: f64,
    /// Thin prism along v, of the fourth power.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub prism_s3: f64,
    /// Coefficient of θ¹¹ relative to that of θ, the k5 of a lens with six in the form of OpenCV.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub radial_k5: f64,
    /// Coefficient of θ¹³ relative to that of θ.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub radial_k6: f64,
    /// Decentring p3: how p1 grows with the square of the radius in focal lengths.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub tangential_p3: f64,
    /// Decentring p4: the same of p2.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub tangential_p4: f64,
    /// The model of another program by which the camera is computed. The keys above are then those of the polynomial that comes nearest,
    /// which other programs get, and from which a calibration goes on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub model: Option<ModelTable>,
}

/// A camera model of another program.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModelTable {
    /// Its name.
    pub name: String,
    /// Pixels of the camera for each of the model's. If absent, 1.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub scale: f64,
    /// Its parameters, by their names in the program that it comes from.
    pub values: BTreeMap<String, f64>,
}

const fn one() -> f64 {
    1.0
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
#[expect(clippy::float_cmp, reason = "exactly one is the default")]
fn is_one(value: &f64) -> bool {
    *value == 1.0
}

impl ModelTable {
    /// The table of `model`.
    #[must_use]
    pub fn of(model: &ForeignModel) -> Self {
        let values = model.parameters().into_iter().map(|parameter| (parameter.name, parameter.value)).collect();
        Self { name: model.name().to_owned(), scale: model.scale(), values }
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde asks for a reference")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl CameraTable {
    /// Makes the table of a camera with a global shutter.
    #[must_use]
    pub fn of(camera: &KannalaBrandt) -> Self {
        let OpenCvFisheye { fx, fy, cx, cy, k: [opencv_k1, opencv_k2, opencv_k3, opencv_k4] } = camera.to_opencv();
        let ImageSize { width, height } = camera.size();
        let [pupil_e0_mm, pupil_e1_mm] = camera.pupil().mm();
        let [tangential_p1, tangential_p2, prism_s0, prism_s1, prism_s2, prism_s3, tangential_p3, tangential_p4] =
            camera.asymmetry().to_array();
        let [radial_k5, radial_k6] = camera.further_terms();
        Self {
            size: [width, height],
            theta_max: Some(camera.measured_field()),
            line_time: None,
            fx,
            fy,
            cx,
            cy,
            opencv_k1,
            opencv_k2,
            opencv_k3,
            opencv_k4,
            pupil_e0_mm,
            pupil_e1_mm,
            tangential_p1,
            tangential_p2,
            prism_s0,
            prism_s1,
            prism_s2,
            prism_s3,
            radial_k5,
            radial_k6,
            tangential_p3,
            tangential_p4,
            model: camera.foreign_model().map(ModelTable::of),
        }
    }

    /// Replaces the shutter.
    #[must_use]
    pub fn with_shutter(self, shutter: Shutter) -> Self {
        let line_time = match shutter {
            Shutter::Global => None,
            Shutter::Rolling { line_us } => Some(Time::from_us(line_us)),
        };
        Self { line_time, ..self }
    }

    /// The shutter of the camera.
    #[must_use]
    pub fn shutter(&self) -> Shutter {
        self.line_time.map_or(Shutter::Global, |time| Shutter::Rolling { line_us: time.us() })
    }

    /// Makes the lens that the table describes.
    ///
    /// # Errors
    /// [`InvalidLens`] where no lens has these parameters.
    pub fn camera(&self) -> Result<KannalaBrandt, InvalidLens> {
        let [width, height] = self.size;
        let size = ImageSize { width, height };
        let k = [self.opencv_k1, self.opencv_k2, self.opencv_k3, self.opencv_k4];
        let lens = OpenCvFisheye { fx: self.fx, fy: self.fy, cx: self.cx, cy: self.cy, k };
        let further = [self.radial_k5, self.radial_k6];
        let theta_max = match self.theta_max {
            Some(stated) => stated,
            None => lens.largest_theta_with(further, size)?,
        };
        let lens = KannalaBrandt::from_opencv_with(lens, further, theta_max, size)?
            .with_pupil(Pupil::from_mm([self.pupil_e0_mm, self.pupil_e1_mm]))?
            .with_asymmetry(Asymmetry {
                tangential: [self.tangential_p1, self.tangential_p2],
                prism: [self.prism_s0, self.prism_s1, self.prism_s2, self.prism_s3],
                growth: [self.tangential_p3, self.tangential_p4],
            })?;
        let Some(ModelTable { name, scale, values }) = &self.model else { return Ok(lens) };
        if !scale.is_finite() || *scale <= 0.0 {
            return Err(InvalidLens::OutOfRange { name: "scale", value: *scale, rule: "be positive" });
        }
        Ok(lens.computed_by(model_of(name, values)?, *scale))
    }
}

/// A camera file: the camera, its calibration's figures, and its provenance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraDocument {
    /// The camera.
    pub camera: CameraTable,
    /// The calibration's figures; absent in files written by hand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<CalibrationTable>,
    /// The provenance; absent in files written by hand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub provenance: Option<Provenance>,
}

/// The figures of a camera's calibration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationTable {
    /// RMS of the corner residuals (distance in the image) in pixels, over the corners that the fit kept.
    pub rms_inlier_px: f64,
    /// Number of corners that the fit kept.
    pub corners: usize,
    /// Number of views of the target.
    pub views: usize,
    /// Covariance of the parameters in the order of [`LENS_PARAMETER_NAMES`](vergence_vision::LENS_PARAMETER_NAMES), row by row, zero of
    /// parameters that the lens does not have. Rows of zeros at the end may be absent: a central and symmetric lens has eight.
    #[serde(deserialize_with = "square", serialize_with = "rows")]
    pub covariance: SMatrix<f64, LENS_PARAMETERS, LENS_PARAMETERS>,
}

/// Reads a covariance of 8 to 20 rows.
fn square<'de, D: Deserializer<'de>>(file: D) -> Result<SMatrix<f64, LENS_PARAMETERS, LENS_PARAMETERS>, D::Error> {
    let rows = Vec::<Vec<f64>>::deserialize(file)?;
    let n = rows.len();
    if !(CENTRAL_PARAMETERS..=LENS_PARAMETERS).contains(&n) || rows.iter().any(|row| row.len() != n) {
        return Err(D::Error::custom(
            "the covariance of a lens has 8 rows of 8 values, and as many more of each as it has parameters beyond opencv_k4: up to 20",
        ));
    }
    if rows.iter().flatten().any(|value| !value.is_finite()) || (0..n).any(|i| rows[i][i] < 0.0) {
        return Err(D::Error::custom(
            "the covariance of a lens holds a value that is no number, or a negative variance",
        ));
    }
    let mut covariance = SMatrix::zeros();
    for (row, values) in rows.iter().enumerate() {
        for (column, value) in values.iter().enumerate() {
            covariance[(row, column)] = *value;
        }
    }
    Ok(covariance)
}

fn rows<S: Serializer>(
    covariance: &SMatrix<f64, LENS_PARAMETERS, LENS_PARAMETERS>,
    file: S,
) -> Result<S::Ok, S::Error> {
    let last = (CENTRAL_PARAMETERS..LENS_PARAMETERS).rev().find(|&i| covariance[(i, i)] > 0.0);
    let n = last.map_or(CENTRAL_PARAMETERS, |last| last + 1);
    let rows: Vec<Vec<f64>> = (0..n).map(|row| covariance.row(row).iter().take(n).copied().collect()).collect();
    rows.serialize(file)
}

/// Provenance of a calibration.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// The program and its version.
    pub program: String,
    /// SHA-256 over all inputs, in hexadecimal.
    pub inputs_sha256: String,
    /// The date that the caller stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub date: Option<String>,
}
