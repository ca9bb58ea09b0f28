//! A dense measurement as the image of a depth camera: a pinhole with z for every pixel, as Open3D, OpenCV and ROS take it.

use image::{ImageBuffer, Luma, RgbImage};
use nalgebra::Vector3;
use vergence_matching::{DenseDepth, DenseRange, DenseSample, SharedFrame};
use vergence_pipeline::limits::MAX_RELATIVE_SIGMA;
use vergence_vision::{Angle, Camera, InvalidView, KannalaBrandt, Left, Point, Right, Transform, VirtualView};

use super::dense::Grey16;
use super::virtual_view::{ViewMap, view_yaml};

/// The field across the view.
const FIELD: Angle = Angle::from_rad(std::f64::consts::FRAC_PI_2);

/// What a depth camera of 90° would see at the place of the left camera, turned to where both cameras look.
pub struct DepthView {
    view: VirtualView,
    /// Millimetres along z of the view; 0 where there is none.
    pub depth: Grey16,
    /// The left image, pixel for pixel.
    pub image: RgbImage,
}

/// Whether a range is known to a twentieth by its own pixels, as in the sparse cloud: others make no point.
pub fn makes_a_point(range: &DenseRange) -> bool {
    range.own_sigma().mm() <= MAX_RELATIVE_SIGMA * range.range().mm()
}

impl DepthView {
    /// The view of `depth`, which was measured in `left` by a camera with this lens.
    ///
    /// # Errors
    /// [`InvalidView`] where the lens has too few or too many pixels.
    pub fn new(
        depth: &DenseDepth,
        (left, lens): (&RgbImage, &KannalaBrandt),
        left_from_right: &Transform<Left, Right>,
    ) -> Result<Self, InvalidView> {
        let turn = SharedFrame::new(left_from_right).map(|frame| frame.shared_from_left().inverse());
        let turn = turn.map_or_else(|| Transform::new(Default::default(), Vector3::zeros()), |turn| turn.renamed());
        let pixels = VirtualView::natural_pixels(FIELD, lens.pixels_per_radian(Angle::from_rad(0.0)));
        let view = VirtualView::new(turn, FIELD, pixels)?;
        let map = ViewMap::new(&view, lens);
        let along = |x, y| along_axis(depth, lens, &view, &map, (x, y)).unwrap_or(0);
        let depth = ImageBuffer::from_fn(pixels, pixels, |x, y| Luma([along(x, y)]));
        Ok(Self { view, depth, image: map.image(left) })
    }

    /// The file that says what the images are, for OpenCV's FileStorage.
    #[must_use]
    pub fn yaml(&self) -> String {
        "%YAML:1.0\n---\n# Depth along z in millimetres, 0 for none, of a pinhole without distortion. A point X in the frame of the left camera (x right, y down,\n\
         # z forward) is imaged at K R X.\nmillimetres_per_unit: 1.\n"
            .to_owned()
            + &view_yaml(&self.view, "")
    }
}

/// Whole millimetres along z of the view at a pixel of it: the range of the nearest pixel of the left image, taken along the ray of the view.
fn along_axis(
    depth: &DenseDepth,
    lens: &KannalaBrandt,
    view: &VirtualView,
    map: &ViewMap,
    (x, y): (u32, u32),
) -> Option<u16> {
    let pixel = map.original(x, y)?;
    // The map has no position outside the image.
    let index = pixel.v.round() as usize * depth.size().width as usize + pixel.u.round() as usize;
    let Some(DenseSample::Measured(range)) = depth.samples().get(index) else { return None };
    let ray = lens.unproject::<Camera>(pixel).ok().filter(|_| makes_a_point(range))?;
    let point = Point::from_mm(lens.origin_of(&ray).mm() + ray.vector() * range.range().mm());
    let (_, z) = view.project(&point)?;
    (z < f64::from(u16::MAX)).then(|| z.round().max(1.0) as u16)
}
