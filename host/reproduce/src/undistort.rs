//! Undistorted pictures: what a pinhole camera about the axis of a fisheye lens would show, as ordinary stereo needs it.

use image::{GrayImage, Luma};
use vergence_vision::{Angle, BatchLens, Camera, Instructions, KannalaBrandt, Pixel, UnitRay};

/// Width of the undistorted picture over that of the sensor. Twice as wide, its edge is 74° from the axis.
const WIDER: f64 = 2.0;

/// A virtual pinhole camera about a lens's own axis, as sharp in its middle as the fisheye picture is.
///
/// Places in its picture are in pixels from the point where the axis meets it.
pub struct Pinhole<'a> {
    lens: &'a KannalaBrandt,
    batch: BatchLens,
    /// Focal length in pixels.
    pub focal_px: f64,
    /// Half the width of the picture.
    half: f64,
}

/// A rectangle of the undistorted picture.
pub struct Patch {
    left: f64,
    top: f64,
    width: u32,
    height: u32,
}

impl<'a> Pinhole<'a> {
    /// By what is known of the lens.
    pub fn of(lens: &'a KannalaBrandt) -> Self {
        let focal_px = lens.pixels_per_radian(Angle::default());
        let half = 0.5 * WIDER * f64::from(lens.size().width);
        Self { lens, batch: BatchLens::new(lens).with_instructions(Instructions::Baseline), focal_px, half }
    }

    /// Where a pixel of the fisheye picture lies; `None` outside the undistorted picture.
    pub fn place(&self, pixel: Pixel) -> Option<Pixel> {
        let ray: UnitRay<Camera> = self.lens.unproject(pixel).ok()?;
        let ray = ray.vector();
        let place = Pixel { u: self.focal_px * ray.x / ray.z, v: self.focal_px * ray.y / ray.z };
        (ray.z > 0.0 && place.u.abs() < self.half && place.v.abs() < self.half).then_some(place)
    }

    /// How many times larger the picture is at a place than in its middle, away from the middle: 1 / cos² of the angle to the
    /// axis.
    pub fn stretch(&self, place: Pixel) -> f64 {
        1.0 + (place.u * place.u + place.v * place.v) / (self.focal_px * self.focal_px)
    }

    /// The part of the picture about `places` that shows a target whose corners they are.
    pub fn patch(&self, places: &[Pixel]) -> Option<Patch> {
        /// The outer squares and the border are 1.5 squares wide, of at least 5 between the corners.
        const AROUND: f64 = 0.35;
        const MARGIN_PX: f64 = 16.0;
        let extent = |of: fn(&Pixel) -> f64| {
            let (low, high) = places
                .iter()
                .map(of)
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
            let around = AROUND * (high - low) + MARGIN_PX;
            let (low, high) = ((low - around).max(-self.half).floor(), (high + around).min(self.half));
            (high > low).then_some((low, (high - low) as u32))
        };
        let ((left, width), (top, height)) = (extent(|p| p.u)?, extent(|p| p.v)?);
        Some(Patch { left, top, width, height })
    }

    /// The undistorted picture in a patch, linear between the pixels of the fisheye picture as usual. `origin` is the pixel of
    /// the sensor where `photo` begins; beyond its edges it goes on as it ends.
    pub fn picture(&self, patch: &Patch, photo: &GrayImage, origin: [u32; 2]) -> GrayImage {
        let mut picture = GrayImage::new(patch.width, patch.height);
        for (y, row) in picture.enumerate_rows_mut() {
            let rays: Vec<[f64; 3]> =
                (0..patch.width).map(|x| patch.at(x, y)).map(|at| [at.u, at.v, self.focal_px]).collect();
            for ((_, _, Luma([level])), [u, v]) in row.zip(self.batch.project(&rays)) {
                *level = between(photo, u - f64::from(origin[0]), v - f64::from(origin[1]));
            }
        }
        picture
    }
}

impl Patch {
    /// The place of a pixel of the patch.
    fn at(&self, x: u32, y: u32) -> Pixel {
        Pixel { u: self.left + f64::from(x), v: self.top + f64::from(y) }
    }

    /// The place of a point of the patch.
    pub fn place(&self, point: Pixel) -> Pixel {
        Pixel { u: self.left + point.u, v: self.top + point.v }
    }
}

fn between(photo: &GrayImage, u: f64, v: f64) -> u8 {
    let inside = |x: f64, size: u32| x.clamp(0.0, f64::from(size.saturating_sub(1)));
    // Not a number counts as 0.
    let (u, v) = (inside(u, photo.width()), inside(v, photo.height()));
    let (x, y) = (u as u32, v as u32);
    let (right, below) = (u - f64::from(x), v - f64::from(y));
    let at = |x: u32, y: u32| {
        let [level] = photo.get_pixel(x.min(photo.width() - 1), y.min(photo.height() - 1)).0;
        f64::from(level)
    };
    let upper = at(x, y) * (1.0 - right) + at(x + 1, y) * right;
    let lower = at(x, y + 1) * (1.0 - right) + at(x + 1, y + 1) * right;
    (upper * (1.0 - below) + lower * below).round() as u8
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may fail")]

    use nalgebra::Vector3;
    use vergence_vision::ImageSize;

    use super::*;

    /// A straight line of space is bent in the fisheye picture and straight in the undistorted one.
    #[test]
    fn straight_lines_become_straight() {
        let size = ImageSize { width: 600, height: 600 };
        let k = [170.0, 2.0, -0.5, 0.0, 0.0];
        let lens = KannalaBrandt::new(k, 1.0, Pixel { u: 300.0, v: 299.0 }, Angle::from_deg(98.0), size).unwrap();
        let pinhole = Pinhole::of(&lens);
        for x in [-200.0, 0.0, 300.0] {
            let pixel = |y: f64| lens.project(&UnitRay::<Camera>::new(Vector3::new(x, y, 250.0)).unwrap()).unwrap();
            let [a, b, c] = [-200.0, 10.0, 260.0].map(pixel);
            assert!(x == 0.0 || (a.u - b.u).abs() > 5.0, "{a:?} {b:?}");
            for pixel in [a, b, c] {
                let place = pinhole.place(pixel).unwrap();
                assert!((place.u - 170.0 * x / 250.0).abs() < 1e-6, "{place:?}");
            }
        }
        let beyond = lens.project(&UnitRay::<Camera>::new(Vector3::new(1.0, 0.0, 0.2)).unwrap()).unwrap();
        assert!(pinhole.place(beyond).is_none());
    }

    /// A picture whose grey level is u keeps the level of every place.
    #[test]
    fn every_place_keeps_its_grey_level() {
        let size = ImageSize { width: 250, height: 250 };
        let lens = KannalaBrandt::new(
            [70.0, 0.5, 0.0, 0.0, 0.0],
            1.0,
            Pixel { u: 125.0, v: 125.0 },
            Angle::from_deg(98.0),
            size,
        );
        let lens = lens.unwrap();
        let photo = GrayImage::from_fn(250, 250, |x, _| Luma([x as u8]));
        let pinhole = Pinhole::of(&lens);
        let patch = pinhole.patch(&[Pixel { u: -60.0, v: -50.0 }, Pixel { u: 90.0, v: 80.0 }]).unwrap();
        let picture = pinhole.picture(&patch, &photo, [0, 0]);
        for (x, y) in [(0, 0), (100, 30), (picture.width() - 1, picture.height() - 1)] {
            let at = patch.at(x, y);
            let pixel =
                lens.project(&UnitRay::<Camera>::new(Vector3::new(at.u, at.v, pinhole.focal_px)).unwrap()).unwrap();
            assert!((f64::from(picture.get_pixel(x, y).0[0]) - pixel.u).abs() <= 0.51, "{pixel:?}");
        }
    }
}
