//! Photographs of a simulated scene, measured by `vergence depth`, and its results beside the truth.

use std::path::Path;
use std::sync::Arc;

use nalgebra::{Matrix3, Matrix3x2, Matrix6, UnitQuaternion, Vector3, Vector6};
use serde_json::Value;
use vergence_rig::{Provenance, Rig, RigPose};
use vergence_sim::{Room, RoomCamera};
use vergence_vision::{Left, Length, Pixel, Right, Side, Transform};

use super::run_json;

/// Cameras of a rig in a room, where they truly are.
pub struct Truth<'a> {
    pub rig: &'a Rig,
    pub room: Arc<Room>,
    pub pose: RigPose,
    /// Seed of the noise of the images.
    pub seed: u64,
}

/// What the command line measured, beside the truth.
pub struct Measurement {
    pub result: Value,
    /// The way from the pose stated to the true one, and the covariance stated.
    pub way: Vector6<f64>,
    pub covariance: Matrix6<f64>,
    pub points: Vec<PointError>,
}

/// A point: its error, its covariance, the direction in which the left camera sees it, the normal of its epipolar plane, and the stated
/// probability that its match is right.
pub struct PointError {
    pub off: Vector3<f64>,
    pub covariance: Matrix3<f64>,
    pub towards: Vector3<f64>,
    pub normal: Vector3<f64>,
    pub true_range: f64,
    pub score: f64,
}

impl Truth<'_> {
    /// Writes both photographs and the rig file into `folder`, and the options of the command line that name them and a cloud.
    pub fn write(&self, folder: &Path) -> Vec<String> {
        let path = |name: &str| folder.join(name).to_string_lossy().into_owned();
        let provenance = Provenance { program: "test".into(), inputs_sha256: String::new(), date: None };
        std::fs::write(path("rig.toml"), self.rig.to_toml(&provenance).expect("a rig file")).expect("it is written");
        let mut options = vec!["--rig".into(), path("rig.toml"), "depth".into(), "--json".into()];
        for (side, name) in [(Side::Left, "left"), (Side::Right, "right")] {
            let camera =
                RoomCamera { side, lens: *self.rig.camera(side), room: Arc::clone(&self.room), seed: self.seed };
            let file = path(&format!("{name}.png"));
            camera.photograph(&self.pose, 0).save(&file).expect("an image is written");
            options.extend([format!("--{name}"), file]);
        }
        options.extend(["--out".into(), path("cloud.ply"), "--also".into(), "csv".into()]);
        options
    }

    /// Photographs and measures, with these options beside the images.
    pub fn measure(&self, options: &[&str]) -> Measurement {
        let folder = tempfile::tempdir().expect("a folder");
        let images = self.write(folder.path());
        let images: Vec<&str> = images.iter().map(String::as_str).collect();
        let result = run_json(&[&images[..], options].concat());
        let (way, covariance) = pose_error(&result["pose"], &self.pose);
        let points = self.points(&folder.path().join("cloud.csv"));
        Measurement { result, way, covariance, points }
    }

    /// The points of a table, each beside the place that its left pixel truly shows.
    fn points(&self, table: &Path) -> Vec<PointError> {
        let text = std::fs::read_to_string(table).expect("a table");
        let world_from_left = self.room.world_from_left(self.pose.base_from_left);
        let row = |line: &str| {
            let n: Vec<f64> = line.split(',').map(|number| number.parse().expect("a number")).collect();
            let ray = self.rig.left_camera.unproject::<Left>(Pixel { u: n[6], v: n[7] }).ok()?;
            let range: Length = self.room.scene.cast(&world_from_left.origin(), &(world_from_left * ray))?.range;
            let (towards, at) = (ray.vector(), Vector3::new(n[0], n[1], n[2]));
            let covariance = Matrix3::new(n[12], n[13], n[14], n[13], n[15], n[16], n[14], n[16], n[17]);
            let normal = self.pose.left_from_right.origin().mm().cross(&towards).normalize();
            let (off, true_range) = (at - towards * range.mm(), range.mm());
            Some(PointError { off, covariance, towards, normal, true_range, score: n[11] })
        };
        text.lines().skip(1).filter_map(row).collect()
    }
}

impl Measurement {
    /// Squared error of the pose over its covariance: of six.
    pub fn of_pose(&self) -> f64 {
        self.way.dot(&self.covariance.cholesky().expect("a covariance").solve(&self.way))
    }
}

impl PointError {
    /// Squared error along the ray and across the epipolar plane over the covariance of these: of two. The truth is what the left pixel
    /// shows, so that there is no error at right angles to both.
    pub fn of_two(&self) -> f64 {
        let across = Matrix3x2::from_columns(&[self.towards, self.normal]).transpose();
        let (off, covariance) = (across * self.off, across * self.covariance * across.transpose());
        off.dot(&covariance.cholesky().expect("a covariance").solve(&off))
    }

    /// The same of the range alone: of one.
    pub fn of_range(&self) -> f64 {
        self.off.dot(&self.towards).powi(2) / self.towards.dot(&(self.covariance * self.towards))
    }

    /// Error of the range over the range.
    pub fn relative(&self) -> f64 {
        self.off.dot(&self.towards).abs() / self.true_range
    }
}

/// Number of seeds: `few`, or what the environment asks for.
pub fn seeds(few: u64) -> u64 {
    std::env::var("VERGENCE_SEEDS").ok().and_then(|text| text.parse().ok()).unwrap_or(few)
}

/// Bounds of the mean of `trials` sums of `freedom` squared normal errors, at this quantile of the normal distribution: 2.24 where two such
/// means shall all lie within them in 95 of 100 cases, 2.39 for three, 2.5 for four, 2.73 for eight (the approximation of E. Wilson and M. Hilferty, PNAS 17, 1931).
pub fn band(trials: u64, freedom: f64, quantile: f64) -> [f64; 2] {
    let share = 2.0 / (9.0 * freedom * trials as f64);
    [-quantile, quantile].map(|quantile| freedom * (1.0 - share + quantile * share.sqrt()).powi(3))
}

/// The middle of these values.
pub fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("numbers").iter().map(|number| number.as_f64().expect("a number")).collect()
}

fn pose_error(stated: &Value, truth: &RigPose) -> (Vector6<f64>, Matrix6<f64>) {
    let vector = |name: &str| Vector3::from_vec(numbers(&stated["left_from_right"][name]));
    let pose: Transform<Left, Right> =
        Transform::new(UnitQuaternion::from_scaled_axis(vector("rotation_vector")), vector("origin_mm"));
    let to = truth.left_from_right;
    let turn = (to.rotation() * pose.rotation().inverse()).scaled_axis();
    let shift = to.origin().mm() - pose.origin().mm();
    let rows: Vec<f64> = stated["covariance"].as_array().expect("rows").iter().flat_map(numbers).collect();
    (Vector6::from_iterator(turn.iter().chain(shift.iter()).copied()), Matrix6::from_row_slice(&rows))
}
