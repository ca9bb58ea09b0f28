//! Files for other programs: a camera, or a pair with its pose.

mod basalt;
mod colmap;
mod kalibr;
mod mrcal;
mod opencv;
mod ros;
mod sensor;
mod spline_fit;

use std::path::{Path, PathBuf};
use std::str::FromStr;

use vergence_vision::{KannalaBrandt, Left, Length, NoFit, Right, Transform};

pub use self::sensor::Sensor;
use crate::ExchangeError;

/// A format that is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WriteFormat {
    /// The FileStorage YAML of OpenCV: `cv::fisheye`.
    OpenCv,
    /// The camchain of Kalibr: pinhole-equidistant.
    Kalibr,
    /// The calibration JSON of Basalt: kb4.
    Basalt,
    /// A `camera_info` of ROS for each camera: equidistant.
    Ros,
    /// A model of COLMAP: `cameras.txt` with `OPENCV_FISHEYE`, and of a pair `images.txt` and an empty `points3D.txt`.
    Colmap,
    /// A `.cameramodel` of mrcal for each camera: splined stereographic.
    Mrcal,
    /// A `sensor.yaml` of TUM-VI for each camera: equidistant.
    TumVi,
}

/// A word that names no format.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is not written: opencv, kalibr, basalt, ros, colmap, mrcal or tum-vi")]
pub struct UnknownFormat(String);

impl FromStr for WriteFormat {
    type Err = UnknownFormat;

    fn from_str(text: &str) -> Result<Self, UnknownFormat> {
        Ok(match text {
            "opencv" => Self::OpenCv,
            "kalibr" => Self::Kalibr,
            "basalt" => Self::Basalt,
            "ros" => Self::Ros,
            "colmap" => Self::Colmap,
            "mrcal" => Self::Mrcal,
            "tum-vi" => Self::TumVi,
            _ => return Err(UnknownFormat(text.to_owned())),
        })
    }
}

/// The format of a camera file to write: `toml`, which is ours and no [`WriteFormat`], or another program's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OursOrTheirs(pub Option<WriteFormat>);

impl FromStr for OursOrTheirs {
    type Err = UnknownFormat;

    fn from_str(text: &str) -> Result<Self, UnknownFormat> {
        if text == "toml" { Ok(Self(None)) } else { text.parse().map(|format| Self(Some(format))) }
    }
}

/// What is written: one camera, or a pair.
#[derive(Clone, Copy, Debug)]
pub struct Cameras {
    /// The camera, or the left one.
    pub left: KannalaBrandt,
    /// The right camera and its pose.
    pub right: Option<(KannalaBrandt, Transform<Left, Right>)>,
}

/// The name of a file to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileName {
    /// As the user names it.
    Named,
    /// The file of one camera, `left` or `right`: `calib-left.yaml` where the user named `calib.yaml`.
    Side(&'static str),
    /// A name that the other program expects, beside the file that the user named.
    Beside(&'static str),
}

/// A file to write.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WrittenFile {
    /// Its name.
    pub name: FileName,
    /// Its text.
    pub text: String,
}

impl WrittenFile {
    /// The path of the file where the user named `out`.
    #[must_use]
    pub fn path(&self, out: &Path) -> PathBuf {
        let side = match self.name {
            FileName::Named => return out.to_owned(),
            FileName::Beside(name) => return out.with_file_name(name),
            FileName::Side(side) => side,
        };
        let stem = out.file_stem().unwrap_or_default().to_string_lossy();
        let ending = out.extension().map(|ending| format!(".{}", ending.to_string_lossy())).unwrap_or_default();
        out.with_file_name(format!("{stem}-{side}{ending}"))
    }
}

/// Files to write, and what they do not say.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Written {
    /// The files.
    pub files: Vec<WrittenFile>,
    /// Sentences on what the format cannot hold; they stand in the files too, where the format has comments.
    pub remarks: Vec<String>,
}

/// The distance at which points are imaged alike by a lens whose rays do not go through one point, and by the central one in its place.
const LIKE_AT: Length = Length::from_mm(500.0);

/// Prints cameras in another program's format.
///
/// # Errors
/// [`ExchangeError::Fit`] where the format cannot hold a lens, not even nearly.
pub fn write(format: WriteFormat, cameras: &Cameras) -> Result<Written, ExchangeError> {
    let mut remarks = Vec::new();
    let left = holdable(format, &cameras.left, "left", &mut remarks)?;
    let right =
        cameras.right.map(|(lens, pose)| Ok((holdable(format, &lens, "right", &mut remarks)?, pose))).transpose()?;
    let cameras = Cameras { left, right };
    let whole = |text: String| vec![WrittenFile { name: FileName::Named, text }];
    let mut files = match format {
        WriteFormat::OpenCv => whole(opencv::write(&cameras)),
        WriteFormat::Kalibr => whole(kalibr::write(&cameras)),
        WriteFormat::Basalt => whole(basalt::write(&cameras)),
        WriteFormat::Ros => ros::write(&cameras),
        WriteFormat::Colmap => colmap::write(&cameras, &mut remarks),
        WriteFormat::Mrcal => mrcal::write(&cameras, &mut remarks)?,
        WriteFormat::TumVi => sensor::write(&cameras),
    };
    if format != WriteFormat::Basalt {
        for file in &mut files {
            file.text.extend(remarks.iter().map(|remark| format!("# {remark}\n")));
        }
    }
    Ok(Written { files, remarks })
}

/// A central and symmetric lens in place of `lens`, if the format can hold no other. mrcal's splines hold one that is not symmetric.
fn holdable(
    format: WriteFormat,
    lens: &KannalaBrandt,
    side: &str,
    remarks: &mut Vec<String>,
) -> Result<KannalaBrandt, ExchangeError> {
    if lens.fits_opencv() || (format == WriteFormat::Mrcal && lens.is_central()) {
        return Ok(*lens);
    }
    let fail = |lens| ExchangeError::Fit { camera: side.to_owned(), fit: NoFit::Lens(lens) };
    let central = lens.central_at(LIKE_AT).map_err(fail)?;
    let off = |mm: f64| lens.largest_difference(&central, Length::from_mm(mm));
    if let Some(model) = lens.foreign_model() {
        remarks.push(format!(
            "The {side} lens has the {} model, which this format cannot say. The lens that is written is up to {:.3} px off it.",
            model.name(),
            off(LIKE_AT.mm())
        ));
        return Ok(central);
    }
    remarks.push(format!(
        "The pupil of the {side} lens moves (e0 = {:.3} mm), it is not symmetric about its axis, or its radius has terms \
         beyond θ⁹, which this format cannot say. The lens that is written images points {:.0} mm away as it does to {:.3} px; points 200 mm away are up to {:.2} px off, points 2 m away \
         {:.2} px.",
        lens.pupil().e0.mm(),
        LIKE_AT.mm(),
        off(LIKE_AT.mm()),
        off(200.0),
        off(2000.0)
    ));
    Ok(central)
}

/// The files of both cameras, each by `print` with its side.
fn each(cameras: &Cameras, mut print: impl FnMut(usize, &KannalaBrandt) -> String) -> Vec<WrittenFile> {
    let Some((right, _)) = &cameras.right else {
        return vec![WrittenFile { name: FileName::Named, text: print(0, &cameras.left) }];
    };
    let left = WrittenFile { name: FileName::Side("left"), text: print(0, &cameras.left) };
    vec![left, WrittenFile { name: FileName::Side("right"), text: print(1, right) }]
}
