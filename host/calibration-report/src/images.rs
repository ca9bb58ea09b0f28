//! The images of a calibration, small: each with the corners found in it, and together with what the sensor sees.

use image::codecs::jpeg::JpegEncoder;
use image::{ExtendedColorType, GrayImage, imageops};
use vergence_page::{Drawing, Path, counted, data_url, gallery};
use vergence_targets::TargetView;
use vergence_vision::{ImageSize, Pixel};

use crate::residuals::Observation;

/// Longer side of a reduced image, in pixels.
const LONGEST: u32 = 220;
/// Quality of the JPEG, in percent: some 4 kB for an image.
const QUALITY: u8 = 55;
/// A place is in view of the lens where at least one image is brighter than this share of the bright parts.
const LIT: f64 = 0.06;

/// An image of a calibration, reduced for a report.
#[derive(Clone, Debug, PartialEq)]
pub struct ReportImage {
    /// The name of its [`TargetView`], whether or not the target was found.
    name: String,
    size: ImageSize,
    reduced: GrayImage,
}

impl ReportImage {
    /// Reduces `image`, called `name` as its view is.
    #[must_use]
    pub fn new(name: &str, image: &GrayImage) -> Self {
        let (width, height) = image.dimensions();
        let share = f64::from(LONGEST) / f64::from(width.max(height).max(1));
        let [wide, high] = [width, height].map(|side| (f64::from(side) * share.min(1.0)).round().max(1.0) as u32);
        let reduced = imageops::thumbnail(image, wide, high);
        Self { name: name.to_owned(), size: ImageSize { width, height }, reduced }
    }

    /// The image with the corners used as dots and those left out as crosses.
    fn draw(&self, corners: &[(Pixel, bool)]) -> Drawing {
        let (wide, high) = (f64::from(self.reduced.width()), f64::from(self.reduced.height()));
        let mut drawing = Drawing::new(wide, high);
        let mut bytes = Vec::new();
        let written = JpegEncoder::new_with_quality(&mut bytes, QUALITY).encode(
            self.reduced.as_raw(),
            self.reduced.width(),
            self.reduced.height(),
            ExtendedColorType::L8,
        );
        if written.is_ok() {
            drawing.image([0.0, 0.0], [wide, high], &data_url("image/jpeg", &bytes));
        }
        let scale = wide / f64::from(self.size.width.max(1));
        let (mut used, mut left_out) = (Path::default(), Path::default());
        for (pixel, is_used) in corners {
            let at = [pixel.u, pixel.v].map(|x| (x + 0.5) * scale);
            if *is_used { used.dot(at) } else { left_out.cross(at, 2.5) }
        }
        drawing.path(&used, "found", "");
        drawing.path(&left_out, "cross out", "");
        drawing
    }
}

/// Every image with its corners. `views` are those of the calibration, `observations` the corners that it placed.
pub(crate) fn thumbnails<'a>(
    images: &[ReportImage],
    views: impl Iterator<Item = &'a TargetView>,
    observations: &[Observation],
) -> String {
    let views: Vec<&TargetView> = views.collect();
    let item = |image: &ReportImage| {
        let found = views.iter().position(|view| view.name == image.name);
        let placed = observations.iter().filter(|observation| Some(observation.view) == found);
        let corners: Vec<(Pixel, bool)> = placed.map(|corner| (corner.observed, corner.used)).collect();
        let used = corners.iter().filter(|(_, used)| *used).count();
        let remark = match (found, corners.len() - used) {
            (None, _) => "no target found".to_owned(),
            (Some(_), 0) => counted(used, "corner"),
            (Some(_), out) => format!("{}, {out} left out", counted(used, "corner")),
        };
        (format!("{}: {remark}", image.name), image.draw(&corners))
    };
    gallery(&images.iter().map(item).collect::<Vec<_>>())
}

/// Where the sensor sees anything: a lens whose image is a circle leaves the corners of its sensor dark.
pub(crate) struct LitArea {
    brightest: GrayImage,
    size: ImageSize,
    threshold: u8,
}

impl LitArea {
    /// `None` without images of one size.
    pub fn of(images: &[ReportImage]) -> Option<Self> {
        let first = images.first()?;
        let mut brightest = first.reduced.clone();
        for image in images {
            if image.reduced.dimensions() != brightest.dimensions() || image.size != first.size {
                return None;
            }
            brightest.iter_mut().zip(image.reduced.iter()).for_each(|(most, grey)| *most = (*most).max(*grey));
        }
        let mut greys = brightest.as_raw().clone();
        greys.sort_unstable();
        let bright = greys.get(greys.len() * 9 / 10).copied().unwrap_or(0);
        Some(Self { brightest, size: first.size, threshold: (LIT * f64::from(bright)).ceil() as u8 })
    }

    /// Whether any image shows anything at `pixel` of a sensor of `size`; everywhere if the images have another size.
    pub fn shows(&self, pixel: Pixel, size: ImageSize) -> bool {
        let at = |x: f64, from: u32, to: u32| ((x + 0.5) / f64::from(from.max(1)) * f64::from(to)).max(0.0) as u32;
        let (wide, high) = self.brightest.dimensions();
        let (x, y) = (at(pixel.u, size.width, wide), at(pixel.v, size.height, high));
        let grey = self.brightest.get_pixel_checked(x.min(wide.saturating_sub(1)), y.min(high.saturating_sub(1)));
        size != self.size || grey.is_none_or(|grey| grey.0[0] > self.threshold)
    }
}
