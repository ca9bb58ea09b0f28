//! Photographs of the simulated room by a small bench, and corners of targets before it, as a user has them: in files.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use vergence_rig::{BENCH_TOML, Provenance, Rig, RigPose};
use vergence_scene::{Optics, Scene, View, render};
use vergence_vision::{Camera, KannalaBrandt, Left, Point, Transform, World};

/// Options of `depth` for the pose of [`human`].
const HUMAN: [&str; 2] = ["--mode", "human"];
/// Squares of the targets, in millimetres.
const SQUARE_MM: f64 = 30.0;

/// A folder with the rig file `rig.toml` of the small bench.
pub struct Work(pub tempfile::TempDir);

impl Work {
    pub fn new() -> Self {
        let work = Self(tempfile::tempdir().expect("a temporary folder"));
        write_rig(&small_bench(), work.0.path().join("rig.toml").as_path());
        work
    }

    pub fn file(&self, name: &str) -> String {
        self.0.path().join(name).to_string_lossy().into_owned()
    }

    /// Photographs a pair of the room.
    pub fn photograph(&self, turn_deg: f64, seed: u64, names: [&str; 2]) {
        let [left, right] = names.map(|name| self.0.path().join(name));
        for folder in [&left, &right] {
            std::fs::create_dir_all(folder.parent().expect("a folder")).expect("it is made");
        }
        photograph(&small_bench(), turn_deg, seed, [&left, &right]);
    }

    pub fn depth<'a>(&self, left: &'a str, right: &'a str, more: &[&'a str]) -> Vec<String> {
        let (rig, out) = (self.file("rig.toml"), self.file("out.ply"));
        let pair = ["--left", &self.file(left), "--right", &self.file(right)];
        let all = [&["depth", "--rig", &rig, "--out", &out][..], &HUMAN, &pair, more].concat();
        all.into_iter().map(str::to_owned).collect()
    }
}

/// Arguments as [`super::run`] takes them.
pub fn refs(words: &[String]) -> Vec<&str> {
    words.iter().map(String::as_str).collect()
}

/// The built-in bench with images of 640 x 640 pixels.
pub fn small_bench() -> Rig {
    Rig::from_toml(BENCH_TOML).expect("the bench").with_sensors(640).expect("a size")
}

/// Writes `rig` to a file.
pub fn write_rig(rig: &Rig, path: &Path) {
    let provenance = Provenance { program: "a test".into(), inputs_sha256: String::new(), date: None };
    std::fs::write(path, rig.to_toml(&provenance).expect("TOML")).expect("a rig file is written");
}

/// The pose of the mode `human`.
pub fn human(rig: &Rig) -> RigPose {
    rig.pose_at_values(&[145.0, 0.0])
}

/// Photographs the room from a place in it, with the bench turned by `turn_deg`, as `left` and `right`.
fn photograph(rig: &Rig, turn_deg: f64, seed: u64, [left, right]: [&Path; 2]) {
    let (scene, pose) = (Scene::room(), human(rig));
    let turn = UnitQuaternion::from_euler_angles(0.0, turn_deg.to_radians(), 0.0);
    let world_from_left = Isometry3::from_parts(Translation3::new(100.0 * turn_deg.signum(), 0.0, 0.0), turn);
    let right_in_left = pose.left_from_right;
    let left_from_right = Isometry3::from_parts(right_in_left.origin().mm().into(), right_in_left.rotation());
    let cameras = [(world_from_left, &rig.left_camera), (world_from_left * left_from_right, &rig.right_camera)];
    for (index, ((at, camera), path)) in cameras.into_iter().zip([left, right]).enumerate() {
        let world_from_camera: Transform<World, Camera> = Transform::from_isometry(at);
        let view = View { scene: &scene, camera, world_from_camera, optics: &Optics::default() };
        render(&view, seed + index as u64).image.save(path).expect("a photograph is written");
    }
}

/// Rows of a corner file: 8 views of a 7 x 5 target by both cameras of `rig`, with a tenth of a pixel of error.
pub fn corner_rows(rig: &Rig) -> String {
    let right_from_left = human(rig).right_from_left();
    let mut rows = String::from("camera,file,frame,idx,x,y,bx_mm,by_mm\n");
    for frame in 0..8_u32 {
        let angle = f64::from(frame) * 0.9;
        let turn = UnitQuaternion::from_euler_angles(0.5 * angle.sin(), 0.5 * angle.cos(), 0.2 * f64::from(frame));
        let middle =
            Vector3::new(120.0 * (2.0 * angle).cos() + 70.0, 110.0 * (2.3 * angle).sin(), 300.0 + 15.0 * angle);
        for index in 0..35_u32 {
            let [x, y] = [f64::from(index % 7), f64::from(index / 7)].map(|n| n * SQUARE_MM);
            let in_left = Point::<Left>::from_mm(middle + turn * Vector3::new(x - 90.0, y - 60.0, 0.0));
            let mut row = |camera: &str, lens: &KannalaBrandt, at: Vector3<f64>| {
                let pixel = lens.project_point(&Point::<Camera>::from_mm(at)).expect("in the field");
                let error = |salt: u32| f64::from((frame * 97 + index * 31 + salt) % 21) * 0.01 - 0.1;
                let (u, v) = (pixel.u + error(3), pixel.v + error(11));
                writeln!(rows, "{camera},{camera}{frame:03}.png,{frame},{index},{u},{v},{x},{y}").expect("text");
            };
            row("left", &rig.left_camera, in_left.mm());
            row("right", &rig.right_camera, (right_from_left * in_left).mm());
        }
    }
    rows
}
