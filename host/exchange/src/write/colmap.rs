//! A model of COLMAP: `cameras.txt`, OPENCV_FISHEYE, where the centre of the first pixel is at 0.5; of a pair `images.txt` with the poses, and
//! `points3D.txt`, without which COLMAP reads no model.
//!
//! A pose is that of the world in the camera, its rotation a quaternion with w first. The world is the frame of the left camera, in metres.

use nalgebra::Isometry3;
use vergence_vision::{ImageSize, KannalaBrandt, OpenCvFisheye};

use super::{Cameras, FileName, WrittenFile};
use crate::pose::METRE;

pub fn write(cameras: &Cameras, remarks: &mut Vec<String>) -> Vec<WrittenFile> {
    let mut text =
        "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n".to_owned();
    text += &line(1, &cameras.left);
    let Some((right, left_from_right)) = &cameras.right else {
        return vec![WrittenFile { name: FileName::Named, text }];
    };
    text += &line(2, right);
    remarks.push(
        "COLMAP's poses have no unit: those in images.txt are in metres, of images that are named left.png and right.png."
            .to_owned(),
    );
    // The line of an image's points follows its pose: it is empty.
    let images = format!(
        "# Image list with two lines of data per image:\n\
         #   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n#   POINTS2D[] as (X, Y, POINT3D_ID)\n{}\n\n{}\n\n",
        image(1, &Isometry3::identity(), "left.png"),
        image(2, &left_from_right.isometry().inverse(), "right.png")
    );
    let points = "# 3D point list with one line of data per point: empty\n".to_owned();
    vec![
        WrittenFile { name: FileName::Named, text },
        WrittenFile { name: FileName::Beside("images.txt"), text: images },
        WrittenFile { name: FileName::Beside("points3D.txt"), text: points },
    ]
}

/// The line of image `id`, taken by the camera of the same number.
fn image(id: u32, camera_from_world: &Isometry3<f64>, name: &str) -> String {
    let (turn, metres) = (camera_from_world.rotation.quaternion(), camera_from_world.translation.vector / METRE);
    let [x, y, z] = metres.into();
    format!("{id} {:?} {:?} {:?} {:?} {x:?} {y:?} {z:?} {id} {name}", turn.w, turn.i, turn.j, turn.k)
}

fn line(id: u32, lens: &KannalaBrandt) -> String {
    let OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] } = lens.to_opencv();
    let ImageSize { width, height } = lens.size();
    let (cx, cy) = (cx + 0.5, cy + 0.5);
    format!("{id} OPENCV_FISHEYE {width} {height} {fx:?} {fy:?} {cx:?} {cy:?} {k1:?} {k2:?} {k3:?} {k4:?}\n")
}
