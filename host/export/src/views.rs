//! The virtual views of both cameras, and the file that says where they look.

use std::path::Path;

use image::RgbImage;
use vergence_files::{write_png, write_whole};
use vergence_output::{EXACT_AT, ViewMap, view_yaml};
use vergence_rig::Rig;
use vergence_vision::{Angle, Face, KannalaBrandt, Side, VirtualView};

use crate::{ExportError, Options};

/// The field across a view unless the options say otherwise.
const FIELD: Angle = Angle::from_rad(std::f64::consts::FRAC_PI_2);

/// A virtual view of one of the cameras.
pub struct CameraView {
    /// The camera.
    pub side: Side,
    /// Where the view looks.
    pub face: Face,
    /// The view.
    pub view: VirtualView,
    map: ViewMap,
}

impl CameraView {
    /// What the view shows of an image of its camera.
    pub fn of(&self, image: &RgbImage) -> RgbImage {
        self.map.image(image)
    }

    /// The field from edge to edge in degrees.
    pub fn field_deg(&self) -> f64 {
        2.0 * (0.5 * f64::from(self.view.size().width) / self.view.focal()).atan().to_degrees()
    }

    /// `left-front`.
    fn name(&self) -> String {
        format!("{}-{}", self.side, self.face.name())
    }
}

/// The views `faces` of both cameras of `rig`, those of the left one first.
pub fn views(rig: &Rig, faces: &[Face], options: &Options) -> Result<Vec<CameraView>, ExportError> {
    let field = options.field.unwrap_or(FIELD);
    let sides = [(Side::Left, &rig.left_camera), (Side::Right, &rig.right_camera)];
    let mut views = Vec::new();
    for (side, lens) in sides {
        let natural = VirtualView::natural_pixels(field, lens.pixels_per_radian(Angle::from_rad(0.0)));
        for &face in faces {
            let view = VirtualView::new(face.camera_from_view(), field, options.size.unwrap_or(natural))?;
            views.push(CameraView { side, face, view, map: ViewMap::new(&view, lens) });
        }
    }
    Ok(views)
}

/// Writes `views.yaml`, which OpenCV's FileStorage reads, and for each view a mask, white where its camera sees.
pub fn describe(views: &[CameraView], folder: &Path) -> Result<(), ExportError> {
    let mut text = "%YAML:1.0\n---\n# Pinhole views without distortion. A point X in the frame of the camera (x right, y down, z forward) is imaged at K R X.\n"
        .to_owned();
    for view in views {
        let name = view.name();
        write_png(&folder.join(format!("{name}-mask.png")), &view.map.mask())?;
        let share = view.map.seen_share();
        text += &format!("{}:\n   seen_share: {share:.4}\n{}", name.replace('-', "_"), view_yaml(&view.view, "   "));
    }
    Ok(write_whole(&folder.join("views.yaml"), text.as_bytes())?)
}

/// How far views of a lens are off whose rays go through no single point; nothing of a central lens.
pub fn remarks(rig: &Rig) -> Vec<String> {
    let remark = |(side, lens): (&str, &KannalaBrandt)| {
        (!lens.is_central()).then(|| {
            let beside = Angle::from_rad((lens.pupil().shift(lens.theta_max()).mm() / EXACT_AT.mm()).abs());
            format!(
                "the pupil of the {side} lens moves, and a pinhole has one centre: views show points {:.0} mm away where they belong, and far points \
                 up to {:.2}° beside",
                EXACT_AT.mm(),
                beside.deg()
            )
        })
    };
    [("left", &rig.left_camera), ("right", &rig.right_camera)].into_iter().filter_map(remark).collect()
}
