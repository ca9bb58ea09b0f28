//! Clouds as PLY (G. Turk, Stanford, 1994), in ASCII: a cloud has thousands of points and any tool reads it.

use std::fmt::Write;

use vergence_pipeline::ColouredPoint;

/// The line of every header that explains unit and frame.
pub const COLUMNS_COMMENT: &str = "comment millimetres in the left camera's frame: x right, y down, z forward\n";

/// The points in the left camera's frame, in millimetres, with colour, pixels in both images, sigma of the range, and the
/// matcher's score.
#[must_use]
pub fn ply(points: &[ColouredPoint]) -> String {
    let mut text = format!(
        "ply\nformat ascii 1.0\n{COLUMNS_COMMENT}\
         element vertex {}\n\
         property double x\nproperty double y\nproperty double z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\n\
         property double u_left\nproperty double v_left\nproperty double u_right\nproperty double v_right\n\
         property double sigma_range\nproperty float score\nend_header\n",
        points.len()
    );
    for ColouredPoint { point, colour: [red, green, blue], score } in points {
        let p = point.point.mm();
        let (left, right) = (point.pixels.left, point.pixels.right);
        // Writing to a String does not fail.
        let _ = writeln!(
            text,
            "{:.4} {:.4} {:.4} {red} {green} {blue} {:.4} {:.4} {:.4} {:.4} {:.4} {score:.4}",
            p.x,
            p.y,
            p.z,
            left.u,
            left.v,
            right.u,
            right.v,
            point.sigma_range.mm()
        );
    }
    text
}
