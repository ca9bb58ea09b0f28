//! Reads the messages that rigs publish: the counterpart of `vergence_recording::messages`. Bytes come from anywhere; what is no message is `None`.

use nalgebra::{Quaternion, UnitQuaternion};
use serde_json::{Value, json};
use vergence_panel::{Outgoing, packed};

/// What comes before a message: CDR, little-endian.
const HEADER: [u8; 4] = [0, 1, 0, 0];
/// Millimetres in a metre.
const MM: f64 = 1e3;
/// More parts than this are no message of a rig.
const MOST_PARTS: u32 = 1024;

/// A message that is being read, field by field.
struct Fields<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Fields<'a> {
    fn new(message: &'a [u8]) -> Option<Self> {
        Some(Self { bytes: message.strip_prefix(&HEADER)?, at: 0 })
    }

    /// As many bytes, aligned to their count.
    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        let at = self.at.next_multiple_of(N);
        let number = *self.bytes.get(at..)?.first_chunk()?;
        self.at = at + N;
        Some(number)
    }

    fn u32(&mut self) -> Option<u32> {
        self.number().map(u32::from_le_bytes)
    }

    fn f64(&mut self) -> Option<f64> {
        self.number().map(f64::from_le_bytes)
    }

    fn counted(&mut self) -> Option<&'a [u8]> {
        let count = self.u32()? as usize;
        let bytes = self.bytes.get(self.at..)?.get(..count)?;
        self.at += count;
        Some(bytes)
    }

    fn text(&mut self) -> Option<String> {
        let (_, text) = self.counted()?.split_last()?;
        Some(String::from_utf8_lossy(text).into_owned())
    }

    /// A count, and as many parts.
    fn parts<T>(&mut self, mut part: impl FnMut(&mut Self) -> Option<T>) -> Option<Vec<T>> {
        let count = self.u32().filter(|count| *count <= MOST_PARTS)?;
        (0..count).map(|_| part(self)).collect()
    }

    /// The header of a message: the time is not needed.
    fn header(&mut self) -> Option<String> {
        let _ = [self.u32()?, self.u32()?];
        self.text()
    }
}

/// A part of a rig, and how it is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DecodedHealth {
    /// 0 works, 1 warning, 2 does not work, 3 was not heard for too long.
    pub grade: u8,
    /// What it is.
    pub name: String,
    /// A sentence.
    pub message: String,
    /// Its figures by name.
    pub values: Vec<(String, String)>,
}

/// The parts of a `diagnostic_msgs/DiagnosticArray`.
pub fn diagnostics(message: &[u8]) -> Option<Vec<DecodedHealth>> {
    let mut fields = Fields::new(message)?;
    fields.header()?;
    fields.parts(|fields| {
        let [grade] = fields.number()?;
        let (name, message) = (fields.text()?, fields.text()?);
        fields.text()?;
        let values = fields.parts(|fields| Some((fields.text()?, fields.text()?)))?;
        Some(DecodedHealth { grade, name, message, values })
    })
}

/// Names and positions of a `sensor_msgs/JointState`.
pub fn joints(message: &[u8]) -> Option<Vec<(String, f64)>> {
    let mut fields = Fields::new(message)?;
    fields.header()?;
    let names = fields.parts(Fields::text)?;
    let positions = fields.parts(Fields::f64)?;
    (names.len() == positions.len()).then(|| names.into_iter().zip(positions).collect())
}

/// The frames of a `tf2_msgs/TFMessage`, and where each is: row by row, three rows of four numbers, in millimetres.
pub fn transforms(message: &[u8]) -> Option<Vec<(String, Vec<f64>)>> {
    Fields::new(message)?.parts(|fields| {
        fields.header()?;
        let frame = fields.text()?;
        let at = [fields.f64()? * MM, fields.f64()? * MM, fields.f64()? * MM];
        let [x, y, z, w] = [fields.f64()?, fields.f64()?, fields.f64()?, fields.f64()?];
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)).to_rotation_matrix();
        let rows = (0..3).flat_map(|row| [turn[(row, 0)], turn[(row, 1)], turn[(row, 2)], at[row]]);
        Some((frame, rows.collect()))
    })
}

/// A cloud in figures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudFigures {
    /// Number of points.
    pub points: usize,
    /// Half of the points have a smaller standard deviation of their range, in millimetres; `None` without points.
    pub sigma_mm: Option<f64>,
}

/// A `sensor_msgs/PointCloud2` as a rig writes it.
pub struct Cloud<'a> {
    /// Number of points.
    pub count: usize,
    step: usize,
    data: &'a [u8],
    /// Where the fields lie in a point.
    offsets: Vec<(String, usize)>,
}

impl<'a> Cloud<'a> {
    /// The cloud of a message.
    pub fn read(message: &'a [u8]) -> Option<Self> {
        let mut fields = Fields::new(message)?;
        fields.header()?;
        let [_height, width] = [fields.u32()?, fields.u32()?];
        let offsets = fields.parts(|fields| {
            let (name, offset) = (fields.text()?, fields.u32()?);
            let [_kind] = fields.number()?;
            fields.u32()?;
            Some((name, offset as usize))
        })?;
        let [_big_endian] = fields.number()?;
        let (step, _row) = (fields.u32()? as usize, fields.u32()?);
        let data = fields.counted()?;
        let (count, within) = (width as usize, |(_, offset): &(String, usize)| offset + 4 <= step);
        let is_whole = count.checked_mul(step) == Some(data.len()) && offsets.iter().all(within);
        is_whole.then_some(Self { count, step, data, offsets })
    }

    /// The four bytes of the field `name`, of each point; nothing where it has no such field.
    fn field(&self, name: &str) -> impl Iterator<Item = [u8; 4]> {
        let offset = self.offsets.iter().find(|(known, _)| known == name).map(|(_, offset)| *offset);
        let points = self.data.chunks_exact(self.step.max(1));
        offset
            .into_iter()
            .flat_map(move |offset| points.clone().filter_map(move |point| point.get(offset..)?.first_chunk().copied()))
    }

    fn floats(&self, name: &str, scale: f64) -> Vec<f32> {
        self.field(name).map(|bytes| (f64::from(f32::from_le_bytes(bytes)) * scale) as f32).collect()
    }

    /// The figures of the cloud.
    pub fn figures(&self) -> CloudFigures {
        let mut sigmas = self.floats("sigma_range", MM);
        sigmas.sort_by(f32::total_cmp);
        CloudFigures { points: self.count, sigma_mm: sigmas.get(sigmas.len() / 2).map(|sigma| f64::from(*sigma)) }
    }

    /// The message of the panel's page: see `cloud_message` there. Pixels and residuals, which are not published, are not a number.
    pub fn page_message(&self, base_from_left: Option<&[f64]>, base_from_right: Option<&[f64]>) -> Outgoing {
        const COVARIANCE: [&str; 6] = ["cov_xx", "cov_xy", "cov_xz", "cov_yy", "cov_yz", "cov_zz"];
        let places = ["x", "y", "z"].map(|name| self.floats(name, MM));
        let colours: Vec<_> = self.field("rgba").map(u32::from_le_bytes).collect();
        let covariance = COVARIANCE.map(|name| self.floats(name, MM * MM));
        let (sigma, score) = (self.floats("sigma_range", MM), self.floats("score", 1.0));
        let number = |all: &[f32], point: usize| all.get(point).copied().unwrap_or(f32::NAN).to_le_bytes();
        let mut bytes = Vec::with_capacity(self.count * (16 + 13 * 4));
        for point in 0..self.count {
            places.iter().for_each(|axis| bytes.extend(number(axis, point)));
            let [_, red, green, blue] = colours.get(point).copied().unwrap_or_default().to_be_bytes();
            bytes.extend([red, green, blue, 255]);
        }
        for point in 0..self.count {
            covariance.iter().for_each(|part| bytes.extend(number(part, point)));
            bytes.extend([f32::NAN.to_le_bytes(); 4].as_flattened());
            bytes.extend([number(&sigma, point), f32::NAN.to_le_bytes(), number(&score, point)].as_flattened());
        }
        let header: Value = json!({
            "kind": "cloud", "count": self.count, "base_from_left": base_from_left, "base_from_right": base_from_right,
        });
        packed(&header, &bytes)
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Matrix3, Vector3};
    use vergence_pipeline::{ColouredPoint, PairCloud};
    use vergence_recording::messages::{self, Grade, Health};
    use vergence_rig::{BENCH_TOML, Rig};
    use vergence_vision::{Angle, CloudPoint, Length, Pixel, PixelPair, Point};

    use super::*;

    fn point(x: f64, sigma: f64) -> ColouredPoint {
        let pixel = Pixel { u: 600.0, v: 500.0 };
        let point = CloudPoint {
            pair_index: 0,
            pixels: PixelPair { left: pixel, right: pixel },
            point: Point::from_mm(Vector3::new(x, 20.0, 600.0)),
            sigma_range: Length::from_mm(sigma),
            covariance: Matrix3::from_diagonal_element(4.0),
            own_covariance: Matrix3::identity(),
            residual: Angle::from_rad(0.0),
            residual_sigma: Angle::from_rad(1e-4),
            extrapolated: false,
        };
        ColouredPoint { point, colour: [1, 2, 3], score: 0.5, track: None }
    }

    fn near(a: f32, b: f32) -> bool {
        (a - b).abs() < 1e-3
    }

    /// The four bytes at `at` of a page's message after its header.
    fn float(bytes: &[u8], at: usize) -> f32 {
        let header = u32::from_le_bytes(bytes[..4].try_into().expect("four bytes")) as usize;
        let from = 4 + header + at;
        f32::from_le_bytes(bytes[from..from + 4].try_into().expect("four bytes"))
    }

    #[test]
    fn a_cloud_reads_back_as_it_was_written_and_a_damaged_one_is_none() {
        let points = vec![point(10.0, 1.5), point(-30.0, 2.5), point(50.0, 9.0)];
        let message = messages::cloud(1_000_000_001, &PairCloud { points, ..PairCloud::default() });
        let cloud = Cloud::read(&message).expect("a cloud");
        let CloudFigures { points, sigma_mm } = cloud.figures();
        assert_eq!(points, 3);
        assert!(near(sigma_mm.expect("points") as f32, 2.5), "{sigma_mm:?}");
        let Outgoing::Binary(page) = cloud.page_message(None, None) else { panic!("binary") };
        assert!(near(float(&page, 0), 10.0) && near(float(&page, 4), 20.0) && near(float(&page, 16), -30.0));
        // Behind three points of 16 bytes: covariance, pixels, sigma, residual, score.
        let detail = |point: usize, at: usize| float(&page, 48 + 4 * (13 * point + at));
        assert!(
            near(detail(0, 0), 4.0) && near(detail(0, 1), 0.0) && near(detail(1, 10), 2.5) && near(detail(2, 12), 0.5)
        );
        assert!(detail(0, 6).is_nan() && detail(0, 11).is_nan());
        let colour: [u8; 4] = float(&page, 12).to_le_bytes();
        assert_eq!(colour, [1, 2, 3, 255]);
        for length in 0..message.len() - 1 {
            assert!(Cloud::read(&message[..length]).is_none(), "{length} bytes");
        }
    }

    #[test]
    fn poses_and_health_read_back_and_damaged_ones_are_none() {
        let rig = Arc::new(Rig::from_toml(BENCH_TOML).expect("the bench"));
        let pose = rig.pose_read_at(&[145.0, 0.5]);
        let message = messages::transforms(7, &pose);
        let frames = transforms(&message).expect("frames");
        assert_eq!(frames.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), ["left", "right"]);
        let at = pose.base_from_left.origin().mm();
        assert!([3, 7, 11].into_iter().zip(at.iter()).all(|(place, mm)| (frames[0].1[place] - mm).abs() < 1e-9));
        let turn = pose.base_from_left.rotation().to_rotation_matrix();
        assert!((frames[0].1[2] - turn[(0, 2)]).abs() < 1e-9);

        let part = Health {
            grade: Grade::Error,
            name: "board",
            message: "stalled".into(),
            values: vec![("mode", "human".into())],
        };
        let health = messages::diagnostics(7, &[part]);
        let read = diagnostics(&health).expect("health");
        assert_eq!((read[0].grade, read[0].message.as_str()), (2, "stalled"));
        assert_eq!(read[0].values, [("mode".to_owned(), "human".to_owned())]);
        assert!((0..message.len()).all(|length| transforms(&message[..length]).is_none()));
        assert!((0..health.len()).all(|length| diagnostics(&health[..length]).is_none()));
    }

    #[test]
    fn a_count_that_cannot_be_is_none() {
        let huge = [&HEADER[..], &[0; 8], &1_u32.to_le_bytes(), &[0, 0, 0, 0], &u32::MAX.to_le_bytes()].concat();
        assert!(joints(&huge).is_none() && diagnostics(&huge).is_none() && Cloud::read(&huge).is_none());
    }
}
