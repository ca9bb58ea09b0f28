//! The formats of camera files, and how a text is recognised as one.

use std::fmt;

/// A format that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// The FileStorage YAML of OpenCV.
    OpenCv,
    /// The camchain YAML of Kalibr.
    Kalibr,
    /// The calibration JSON of Basalt.
    Basalt,
    /// The `sensor.yaml` of the EuRoC and TUM-VI data sets.
    Euroc,
    /// A `camera_info` of ROS as YAML.
    Ros,
    /// A `.cameramodel` of mrcal.
    Mrcal,
    /// The `cameras.txt` of COLMAP.
    Colmap,
    /// The settings YAML of ORB-SLAM.
    OrbSlam,
    /// The `calib_results.txt` of OCamCalib.
    OCam,
    /// What `rs-enumerate-devices -c` of librealsense prints.
    RealSense,
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::OpenCv => "an OpenCV camera file",
            Self::Kalibr => "a Kalibr camchain",
            Self::Basalt => "a Basalt calibration",
            Self::Euroc => "a sensor.yaml of EuRoC or TUM-VI",
            Self::Ros => "a ROS camera_info",
            Self::Mrcal => "an mrcal cameramodel",
            Self::Colmap => "a cameras.txt of COLMAP",
            Self::OrbSlam => "a settings file of ORB-SLAM",
            Self::OCam => "a calib_results.txt of OCamCalib",
            Self::RealSense => "the print of librealsense's rs-enumerate-devices",
        })
    }
}

/// What a text is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Recognised {
    /// The TOML of this program, or what is meant as such.
    Ours,
    /// A format that is read.
    Foreign(Format),
    /// A format that is known and not read.
    Unread {
        /// Its name.
        what: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// None of these.
    Unknown,
}

const UNREAD: [(&[&str], &str, &str); 8] = [
    (&["\n[LEFT_CAM_"], "a calibration of a ZED camera", "write its parameters as an OpenCV camera file"),
    (&["<opencv_storage"], "OpenCV's FileStorage as XML", "write it as YAML: name the file .yaml"),
    (&["type_id\": \"opencv-matrix"], "OpenCV's FileStorage as JSON", "write it as YAML: name the file .yaml"),
    (&["<calibration", "<projection>"], "a camera file of Agisoft Metashape", "export it as OpenCV YAML"),
    (&["\nmodel_type:"], "a camera file of camodocal or VINS", "write its parameters as an OpenCV camera file"),
    (&["\"fl_x\""], "a transforms.json of a radiance field", "use the COLMAP cameras.txt that it was made of"),
    (&["# Image list with two lines"], "the images.txt of COLMAP", "name the cameras.txt beside it"),
    (&["\ntarget_type:"], "a calibration target of Kalibr", "name the camchain"),
];

impl Recognised {
    /// Names the format of the file content `text`.
    #[must_use]
    pub fn of(text: &str) -> Self {
        if let Some(format) = Self::format(text) {
            return Self::Foreign(format);
        }
        let padded = format!("\n{text}");
        if let Some((_, what, advice)) =
            UNREAD.iter().find(|(signs, ..)| signs.iter().all(|sign| padded.contains(sign)))
        {
            return Self::Unread { what, advice };
        }
        let is_toml = |line: &str| {
            let line = line.trim();
            let is_table = line.starts_with('[') && line.ends_with(']');
            let is_key = |key: &str| key.trim().chars().all(|c| c.is_alphanumeric() || "_-.".contains(c));
            is_table || line.split_once('=').is_some_and(|(key, _)| is_key(key))
        };
        if text.lines().any(is_toml) { Self::Ours } else { Self::Unknown }
    }

    fn format(text: &str) -> Option<Format> {
        let has = |key: &str| {
            text.lines().any(|line| line.strip_prefix(key).is_some_and(|rest| rest.trim_start().starts_with(':')))
        };
        let says = |sign: &str| text.contains(sign);
        // The files of camodocal are OpenCV's YAML with other contents.
        let is_opencv = (text.starts_with("%YAML") || says("!!opencv-matrix")) && !has("model_type");
        let formats = [
            (says("'lensmodel'") || says("\"lensmodel\""), Format::Mrcal),
            (says("\"value0\"") && says("\"intrinsics\""), Format::Basalt),
            (has("cam0"), Format::Kalibr),
            (has("Camera.type") || has("Camera.fx") || has("Camera1.fx"), Format::OrbSlam),
            (has("sensor_type") || has("T_BS"), Format::Euroc),
            (is_opencv, Format::OpenCv),
            (has("distortion_model") && (has("image_width") || has("width")), Format::Ros),
            (says("#polynomial coefficients"), Format::OCam),
            (says("Intrinsic of \""), Format::RealSense),
            (text.lines().any(crate::colmap::is_camera), Format::Colmap),
        ];
        formats.iter().find(|(is_it, _)| *is_it).map(|(_, format)| *format)
    }
}
