//! COLMAP's `cameras.txt`, OPENCV_FISHEYE. There the centre of the first pixel is at 0.5.

use vergence_vision::{ImageSize, KannalaBrandt, OpenCvFisheye};

use super::Cameras;

pub fn write(cameras: &Cameras, remarks: &mut Vec<String>) -> String {
    let mut text =
        "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n".to_owned();
    text += &line(1, &cameras.left);
    if let Some((right, _)) = &cameras.right {
        text += &line(2, right);
        remarks.push("The file says nothing of where the cameras are: COLMAP's poses have no unit.".to_owned());
    }
    text
}

fn line(id: u32, lens: &KannalaBrandt) -> String {
    let OpenCvFisheye { fx, fy, cx, cy, k: [k1, k2, k3, k4] } = lens.to_opencv();
    let ImageSize { width, height } = lens.size();
    let (cx, cy) = (cx + 0.5, cy + 0.5);
    format!("{id} OPENCV_FISHEYE {width} {height} {fx:?} {fy:?} {cx:?} {cy:?} {k1:?} {k2:?} {k3:?} {k4:?}\n")
}
