//! What a virtual pinhole camera sees in the images of a fisheye camera.

use image::{GrayImage, Luma, Rgb, RgbImage};
use rayon::prelude::*;
use vergence_vision::{Angle, BatchLens, Camera, ImageSize, KannalaBrandt, Length, Pixel, UnitRay, VirtualView};

/// The rays of a lens whose pupil moves go through no single point: a view of it shows points at this distance where they belong.
pub const EXACT_AT: Length = Length::from_mm(500.0);
/// Most samples of an image across a pixel of a view.
const MOST_SAMPLES: u32 = 8;

/// Where each pixel of a view lies in the images of its camera.
#[derive(Clone, Debug)]
pub struct ViewMap {
    size: ImageSize,
    /// Samples across a pixel of the view: more than one where the view is coarser than the image.
    samples: u32,
    /// Positions of all samples by rows; NaN where the camera does not see.
    positions: Vec<[f64; 2]>,
}

impl ViewMap {
    /// The map of `view` at the place of a camera with this lens.
    #[must_use]
    pub fn new(view: &VirtualView, lens: &KannalaBrandt) -> Self {
        let size = view.size();
        let finer = lens.pixels_per_radian(Angle::from_rad(0.0)) / view.focal();
        let samples = (finer.round().max(1.0) as u32).min(MOST_SAMPLES);
        let (columns, step) = (size.width * samples, 1.0 / f64::from(samples));
        let place = |index: u32| (f64::from(index) + 0.5) * step - 0.5;
        let batch = lens.is_central().then(|| BatchLens::new(lens));
        let rows = (0..size.height * samples).into_par_iter().flat_map_iter(|row| {
            let rays = (0..columns).filter_map(|column| view.ray(Pixel { u: place(column), v: place(row) }));
            project(rays, lens, batch.as_ref())
        });
        let seen = |[u, v]: &[f64; 2]| {
            let inside = |at: f64, count: u32| (0.0..=f64::from(count) - 1.0).contains(&at);
            inside(*u, lens.size().width) && inside(*v, lens.size().height)
        };
        let positions = rows.map(|at| if seen(&at) { at } else { [f64::NAN; 2] }).collect();
        Self { size, samples, positions }
    }

    /// The share of the view that the camera sees, from 0 to 1.
    #[must_use]
    pub fn seen_share(&self) -> f64 {
        let seen = self.positions.iter().filter(|at| !at[0].is_nan()).count();
        seen as f64 / self.positions.len().max(1) as f64
    }

    /// Where the middle of a pixel of the view is in the camera's image, the mean of its samples; `None` where the camera does not see all of it.
    #[must_use]
    pub fn original(&self, x: u32, y: u32) -> Option<Pixel> {
        let count = f64::from(self.samples * self.samples);
        let mean = |axis: usize| self.samples_of(x, y).map(|at| at[axis]).sum::<f64>() / count;
        let at = Pixel { u: mean(0), v: mean(1) };
        (!at.u.is_nan()).then_some(at)
    }

    /// White where the camera sees all of a pixel, black elsewhere.
    #[must_use]
    pub fn mask(&self) -> GrayImage {
        GrayImage::from_fn(self.size.width, self.size.height, |x, y| {
            Luma([if self.samples_of(x, y).any(|at| at[0].is_nan()) { 0 } else { 255 }])
        })
    }

    /// The view of `image`, by cubic convolution (R. Keys, ASSP 29(6), 1981); black where the camera does not see.
    #[must_use]
    pub fn image(&self, image: &RgbImage) -> RgbImage {
        let width = self.size.width;
        let colour = |index: u32| {
            let (mut sum, mut count) = ([0.0_f32; 3], 0.0);
            for at in self.samples_of(index % width, index / width) {
                if at[0].is_nan() {
                    return [0; 3];
                }
                let sample = sampled(image, *at);
                (0..3).for_each(|channel| sum[channel] += sample[channel]);
                count += 1.0;
            }
            sum.map(|sum| (sum / count).round().clamp(0.0, 255.0) as u8)
        };
        let colours: Vec<[u8; 3]> = (0..width * self.size.height).into_par_iter().map(colour).collect();
        RgbImage::from_fn(width, self.size.height, |x, y| Rgb(colours[(y * width + x) as usize]))
    }

    fn samples_of(&self, x: u32, y: u32) -> impl Iterator<Item = &[f64; 2]> {
        let (n, stride) = (self.samples as usize, (self.size.width * self.samples) as usize);
        let first = y as usize * n * stride + x as usize * n;
        (0..n).flat_map(move |row| &self.positions[first + row * stride..][..n])
    }
}

/// Size, K and R (a point X in the camera's frame is imaged at K R X) of a view for OpenCV's FileStorage, each line after `indent`.
#[must_use]
pub fn view_yaml(view: &VirtualView, indent: &str) -> String {
    let ImageSize { width, height } = view.size();
    let mut lines = vec![format!("image_width: {width}"), format!("image_height: {height}")];
    for (key, rows) in [("K", view.camera_matrix()), ("R", view.view_from_camera())] {
        lines.push(format!("{key}: !!opencv-matrix"));
        lines.extend(["   rows: 3", "   cols: 3", "   dt: d"].map(str::to_owned));
        lines.push(format!("   data: {rows:?}"));
    }
    lines.iter().map(|line| format!("{indent}{line}\n")).collect()
}

/// The pixels of these rays in the camera's image; NaN beyond its field.
fn project(
    rays: impl Iterator<Item = UnitRay<Camera>>,
    lens: &KannalaBrandt,
    batch: Option<&BatchLens>,
) -> Vec<[f64; 2]> {
    match batch {
        Some(batch) => batch.project(&rays.map(|ray| ray.vector().into()).collect::<Vec<_>>()),
        None => {
            let pixel = |ray: UnitRay<Camera>| lens.project_point(&ray.at(EXACT_AT.mm()));
            rays.map(|ray| pixel(ray).map_or([f64::NAN; 2], |at| [at.u, at.v])).collect()
        }
    }
}

/// Interpolates a position inside the image; at its border the outermost pixels go on.
fn sampled(image: &RgbImage, [u, v]: [f64; 2]) -> [f32; 3] {
    let (across, down) = (weights(u.fract() as f32), weights(v.fract() as f32));
    let (width, height) = image.dimensions();
    let mut sum = [0.0; 3];
    for (row, down) in (0_u32..).zip(down) {
        let y = (v as u32 + row).saturating_sub(1).min(height.saturating_sub(1));
        for (column, across) in (0_u32..).zip(across) {
            let x = (u as u32 + column).saturating_sub(1).min(width.saturating_sub(1));
            let Rgb(colour) = image.get_pixel(x, y);
            (0..3).for_each(|channel| sum[channel] += down * across * f32::from(colour[channel]));
        }
    }
    sum
}

/// Keys' weights of four neighbours, of which the second is `t` before the position.
fn weights(t: f32) -> [f32; 4] {
    let near = |d: f32| (1.5 * d - 2.5) * d * d + 1.0;
    let far = |d: f32| ((-0.5 * d + 2.5) * d - 4.0) * d + 2.0;
    [far(1.0 + t), near(t), near(1.0 - t), far(2.0 - t)]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::expect_used, reason = "a test may fail")]

    use vergence_vision::{Face, Pupil};

    use super::*;

    fn lens() -> KannalaBrandt {
        let size = ImageSize { width: 320, height: 320 };
        let centre = Pixel { u: 159.5, v: 159.5 };
        KannalaBrandt::new([91.5, 0.0, 0.0, 0.0, 0.0], 1.0, centre, Angle::from_deg(98.0), size).expect("a lens")
    }

    fn map(face: Face, pixels: u32) -> ViewMap {
        let view = VirtualView::new(face.camera_from_view(), Angle::from_deg(90.0), pixels).expect("a view");
        ViewMap::new(&view, &lens())
    }

    /// An image whose brightness is a linear function of its position comes out as that function of the position, at any fineness of the view.
    #[test]
    fn a_view_shows_what_the_map_says() {
        let image = RgbImage::from_fn(320, 320, |x, y| Rgb([(x / 2) as u8, (y / 2) as u8, ((x + y) / 4) as u8]));
        for pixels in [200, 61] {
            let map = map(Face::Front, pixels);
            let seen = map.image(&image);
            for (x, y) in [(3, 5), (pixels / 2, pixels / 3), (pixels - 1, 0)] {
                let at = map.original(x, y).expect("the camera sees it");
                let Rgb([red, green, _]) = *seen.get_pixel(x, y);
                // A coarse view shows the mean over its pixel.
                let off = (f64::from(red) - at.u / 2.0).abs().max((f64::from(green) - at.v / 2.0).abs());
                assert!(off < 1.5, "{pixels} ({x}, {y}): {off}");
            }
        }
    }

    #[test]
    fn what_the_camera_does_not_see_is_black_and_masked() {
        assert!((map(Face::Front, 100).seen_share() - 1.0).abs() < 1e-9);
        let side = map(Face::Left, 100);
        assert!((0.5..0.65).contains(&side.seen_share()), "{}", side.seen_share());
        let (mask, image) = (side.mask(), side.image(&RgbImage::from_pixel(320, 320, Rgb([200; 3]))));
        assert!(mask.pixels().zip(image.pixels()).all(|(mask, colour)| (mask.0[0] > 0) == (colour.0 == [200; 3])));
        // The half towards the optical axis is the one that is seen.
        assert!(mask.get_pixel(99, 50).0[0] > 0 && mask.get_pixel(0, 50).0[0] == 0);
    }

    /// Seen from 500 mm, a point is in the view of a lens whose pupil moves where it is in that of a pinhole.
    #[test]
    fn a_moving_pupil_is_heeded() {
        let lens = lens().with_pupil(Pupil::from_mm([3.0, 0.0])).expect("a lens");
        let view = VirtualView::new(Face::Left.camera_from_view(), Angle::from_deg(90.0), 183).expect("a view");
        let at = Pixel { u: 140.0, v: 80.0 };
        let seen = ViewMap::new(&view, &lens).original(140, 80).expect("the camera sees it");
        let ray = view.ray(at).expect("a ray");
        let expected = lens.project_point(&ray.at(500.0)).expect("in the field");
        assert!((seen.u - expected.u).hypot(seen.v - expected.v) < 1e-9);
        let far = lens.project(&ray).expect("in the field");
        assert!((seen.u - far.u).hypot(seen.v - far.v) > 0.05, "the pupil moves");
    }

    #[test]
    fn weights_of_a_position_add_up_to_one() {
        for t in [0.0, 0.25, 0.5, 0.99] {
            assert!((weights(t).iter().sum::<f32>() - 1.0).abs() < 1e-6);
        }
        assert!((weights(0.0)[1] - 1.0).abs() < 1e-6);
    }
}
