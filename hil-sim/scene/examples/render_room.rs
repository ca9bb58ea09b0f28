//! Renders the furnished room again and again, for the processor time that an image takes: `render_room SIDE exact|quick|still IMAGES`. The camera of
//! quick images turns a little from one to the next; that of still ones, which are quick too, does not.

use std::hint::black_box;
use std::process::ExitCode;

use nalgebra::{UnitQuaternion, Vector3};
use vergence_scene::{Optics, RayTable, Scene, View, render, render_quick};
use vergence_vision::{Angle, Camera, ImageSize, KannalaBrandt, Pixel, Transform, World};

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match rendered(&arguments) {
        Some(()) => ExitCode::SUCCESS,
        None => ExitCode::from(2),
    }
}

/// `None` where the arguments are not understood.
fn rendered(arguments: &[String]) -> Option<()> {
    let [side, way, images] = arguments else { return None };
    let (side, images): (u32, u64) = (side.parse().ok()?, images.parse().ok()?);
    let scale = f64::from(side) / 640.0;
    let centre = Pixel { u: 320.3 * scale, v: 318.9 * scale };
    let k = [187.0, -3.0, 0.4, 0.0, 0.0].map(|k| k * scale);
    let size = ImageSize { width: side, height: side };
    let camera = KannalaBrandt::new(k, 1.001, centre, Angle::from_deg(98.0), size).ok()?;
    let (scene, optics) = (Scene::room(), Optics::default());
    let table = RayTable::new(&camera, &optics);
    for seed in 0..images {
        let turn =
            UnitQuaternion::from_euler_angles(0.0, 0.6 + if way == "quick" { 1e-4 * seed as f64 } else { 0.0 }, 0.0);
        let pose = |row: u32| {
            let middle = Vector3::new(1e-3 * f64::from(row) - 72.5, 0.0, 0.0);
            Transform::<World, Camera>::new(turn, middle)
        };
        let view = View { scene: &scene, camera: &camera, world_from_camera: pose(0), optics: &optics };
        match way.as_str() {
            "exact" => drop(black_box(render(&view, seed))),
            "quick" | "still" => drop(black_box(render_quick(&view, &table, seed, &pose))),
            _ => return None,
        }
    }
    Some(())
}
