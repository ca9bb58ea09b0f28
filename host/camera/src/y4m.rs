//! Uncompressed videos in YUV4MPEG2 files, which ffmpeg and mjpegtools write (the format: mjpegtools' manual page yuv4mpeg(5)).

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use image::{Rgb, RgbImage};
use vergence_vision::ImageSize;

use crate::CameraError;

/// Longest header of a file or an image; a file of another kind has no line end in it.
const LONGEST_HEADER: u64 = 1_024;
/// Largest width and height, in pixels.
const LARGEST: u32 = 16_384;

/// How colours are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Chroma {
    None,
    /// Columns and rows of pixels that share a colour.
    Every(u32, u32),
}

/// A video that is read image after image.
#[derive(Debug)]
pub struct Y4m {
    path: PathBuf,
    file: BufReader<File>,
    size: ImageSize,
    /// Images per second.
    rate: f64,
    chroma: Chroma,
    full_range: bool,
    read: u32,
}

impl Y4m {
    /// Whether the file at `path` is named as such a video.
    #[must_use]
    pub fn is_named(path: &Path) -> bool {
        path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("y4m"))
    }

    /// Opens the video at `path`.
    ///
    /// # Errors
    /// [`CameraError::Unreadable`]; [`CameraError::NotAnImage`] where the header is none, or its colours are not of 8 bits.
    pub fn open(path: &Path) -> Result<Self, CameraError> {
        let unreadable = |error: std::io::Error| CameraError::Unreadable { path: path.into(), why: error.to_string() };
        let wrong = |why: &str| CameraError::NotAnImage { path: path.into(), why: why.into() };
        let mut file = BufReader::new(File::open(path).map_err(unreadable)?);
        let header = line(&mut file).map_err(unreadable)?;
        let mut words = header.split(' ');
        if words.next() != Some("YUV4MPEG2") {
            return Err(wrong("no video in the format YUV4MPEG2: 'ffmpeg -i VIDEO left.y4m' makes one of any video"));
        }
        let words: Vec<&str> = words.collect();
        let value = |key: char| words.iter().find_map(|word| word.strip_prefix(key));
        let number = |key| value(key)?.parse::<u32>().ok().filter(|number| (1..=LARGEST).contains(number));
        let (Some(width), Some(height)) = (number('W'), number('H')) else {
            return Err(wrong("its header states no size of its images"));
        };
        let rate = value('F').and_then(ratio).ok_or_else(|| wrong("its header states no images per second (F)"))?;
        let chroma = match value('C').unwrap_or("420") {
            "mono" => Chroma::None,
            "420" | "420jpeg" | "420mpeg2" | "420paldv" => Chroma::Every(2, 2),
            "422" => Chroma::Every(2, 1),
            "444" => Chroma::Every(1, 1),
            other => {
                return Err(wrong(&format!(
                    "its colours are sampled as {other}: 'ffmpeg -i VIDEO -pix_fmt yuv420p left.y4m' makes one that is understood"
                )));
            }
        };
        if value('I').is_some_and(|order| !matches!(order, "p" | "?")) {
            return Err(wrong("its images are interlaced: each holds two exposures; 'ffmpeg -vf yadif' parts them"));
        }
        let full_range = words.contains(&"XCOLORRANGE=FULL");
        Ok(Self { path: path.into(), file, size: ImageSize { width, height }, rate, chroma, full_range, read: 0 })
    }

    /// Images per second.
    #[must_use]
    pub const fn rate(&self) -> f64 {
        self.rate
    }

    /// The next image; `None` after the last one.
    ///
    /// # Errors
    /// [`CameraError::NotAnImage`] where the file ends inside an image.
    pub fn next(&mut self) -> Result<Option<RgbImage>, CameraError> {
        let unreadable =
            |error: std::io::Error| CameraError::Unreadable { path: self.path.clone(), why: error.to_string() };
        let header = line(&mut self.file).map_err(unreadable)?;
        if header.is_empty() {
            return Ok(None);
        }
        let broken = || CameraError::NotAnImage {
            path: self.path.clone(),
            why: format!("the video is damaged or ends inside image {}; copy it again", self.read),
        };
        if header.split(' ').next() != Some("FRAME") {
            return Err(broken());
        }
        let ImageSize { width, height } = self.size;
        let (columns, rows) = match self.chroma {
            Chroma::None => (0, 0),
            Chroma::Every(across, down) => (width.div_ceil(across), height.div_ceil(down)),
        };
        let (bright, colour) = (width as usize * height as usize, columns as usize * rows as usize);
        let mut bytes = vec![0; bright + 2 * colour];
        self.file.read_exact(&mut bytes).map_err(|_| broken())?;
        self.read += 1;
        let (luma, chroma) = bytes.split_at(bright);
        let (blue, red) = chroma.split_at(colour);
        let full = self.full_range;
        let at = |plane: &[u8], index: usize| plane.get(index).copied().unwrap_or_default();
        Ok(Some(RgbImage::from_fn(width, height, |x, y| {
            let y_ = at(luma, y as usize * width as usize + x as usize);
            let Chroma::Every(across, down) = self.chroma else { return rgb([y_, 128, 128], full) };
            let index = (y / down) as usize * columns as usize + (x / across) as usize;
            rgb([y_, at(blue, index), at(red, index)], full)
        })))
    }
}

/// ITU-R BT.601 in its limited range, which videos have, or in the full one.
fn rgb([y, u, v]: [u8; 3], full: bool) -> Rgb<u8> {
    let (scale, lowest, colours) = if full { (1.0, 0.0, 1.0) } else { (255.0 / 219.0, 16.0, 255.0 / 224.0) };
    let y = (f32::from(y) - lowest) * scale;
    let [u, v] = [u, v].map(|c| (f32::from(c) - 128.0) * colours);
    Rgb([y + 1.402 * v, y - 0.344_136 * u - 0.714_136 * v, y + 1.772 * u].map(|c| c.round().clamp(0.0, 255.0) as u8))
}

/// A ratio such as `30000:1001`.
fn ratio(text: &str) -> Option<f64> {
    let (over, under) = text.split_once(':')?;
    let rate = over.parse::<f64>().ok()? / under.parse::<f64>().ok()?;
    (rate.is_finite() && rate > 0.0).then_some(rate)
}

/// The next line without its end, which is empty at the end of the file.
fn line(file: &mut BufReader<File>) -> std::io::Result<String> {
    let mut bytes = Vec::new();
    file.by_ref().take(LONGEST_HEADER).read_until(b'\n', &mut bytes)?;
    Ok(String::from_utf8_lossy(&bytes).trim_end_matches('\n').to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn video(name: &str, bytes: &[u8]) -> Result<Y4m, CameraError> {
        let path = std::env::temp_dir().join(format!("vergence-{}-{name}.y4m", std::process::id()));
        std::fs::write(&path, bytes).expect("written");
        let opened = Y4m::open(&path);
        std::fs::remove_file(&path).expect("removed");
        opened
    }

    /// Pure red of BT.601 in limited range is Y 81, U 90, V 240; black is 16, white 235.
    #[test]
    fn colours_and_sizes_are_those_of_the_standard() {
        let mut bytes = b"YUV4MPEG2 W3 H2 F30000:1001 Ip A1:1 C420jpeg\nFRAME\n".to_vec();
        bytes.extend([81, 81, 16, 81, 81, 235, 90, 128, 240, 128]);
        let mut opened = video("red", &bytes).expect("a video");
        assert!((opened.rate() - 29.97).abs() < 1e-3);
        let image = opened.next().expect("whole").expect("an image");
        let [r, g, b] = image.get_pixel(1, 1).0;
        assert!(r > 250 && g < 5 && b < 5, "{r} {g} {b}");
        assert_eq!((image.get_pixel(2, 0).0, image.get_pixel(2, 1).0), ([0; 3], [255; 3]));
        assert_eq!(opened.next(), Ok(None));
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        let said = |name: &str, bytes: &[u8]| video(name, bytes).expect_err("refused").to_string();
        assert!(said("text", b"hello\n").contains("ffmpeg"));
        assert!(said("deep", b"YUV4MPEG2 W2 H2 F25:1 C420p10\n").contains("420p10"));
        assert!(said("still", b"YUV4MPEG2 W2 H2 Cmono\n").contains("images per second"));
        assert!(said("fields", b"YUV4MPEG2 W2 H2 F25:1 It Cmono\n").contains("interlaced"));
        let mut cut =
            video("cut", b"YUV4MPEG2 W2 H2 F25:1 Cmono\nFRAME\n\x01\x02\x03\x04FRAME\n\x01").expect("a video");
        assert_eq!(cut.next().expect("whole").expect("an image").get_pixel(1, 1).0, [0; 3]);
        assert!(cut.next().expect_err("cut off").to_string().contains("inside image 1"));
    }
}
