//! The light of many rays through one pixel of a chessboard's picture, side by side in vector instructions.

use multiversion::multiversion;
use nalgebra::Vector3;

use crate::Target;
use crate::packet::LANES;
use crate::real::Real;

/// A chessboard as rays in its own frame meet it.
pub struct Board {
    /// The board itself.
    pub target: Target,
    /// Half of its width and height, mm.
    pub half: [f64; 2],
    /// Its middle, mm.
    pub middle: [f64; 2],
    /// Where rays start for a pupil at the camera's origin, and by how much per mm of its shift.
    pub from: [Vector3<f64>; 2],
    /// The light beside the board, of its back, of black and of white.
    pub lights: [f32; 4],
}

/// How ray and pupil change over a square of pixels: ray and shift of the pupil at its middle, and their derivatives per pixel u, v, uu, uv, vv.
pub type Series = [[f64; 4]; 6];

/// The lights of the rays at these places, in pixels from the middle of the series: those of places beyond the last mean nothing.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl+avx2", "x86_64+avx2"))]
pub fn lights(board: &Board, series: &Series, [u, v]: &[[f64; LANES]; 2]) -> [f32; LANES] {
    let [value, du, dv, duu, duv, dvv] = series;
    let mut node = [[0.0; LANES]; 4];
    for (k, node) in node.iter_mut().enumerate() {
        for i in 0..LANES {
            let (u, v) = (u[i], v[i]);
            let first = value[k] + du[k] * u + dv[k] * v;
            node[i] = first + duu[k] * (0.5 * u * u) + duv[k] * (u * v) + dvv[k] * (0.5 * v * v);
        }
    }
    let ([start, by_shift], [x, y, z, shift]) = (board.from, node);
    let (square, [columns, rows]) =
        (board.target.square.mm(), [board.target.columns, board.target.rows].map(|corners| f64::from(corners) + 1.0));
    let mut lights = [0.0; LANES];
    for i in 0..LANES {
        let range = -(start.z + by_shift.z * shift[i]) / z[i];
        let across = start.x + by_shift.x * shift[i] + range * x[i] - board.middle[0];
        let down = start.y + by_shift.y * shift[i] + range * y[i] - board.middle[1];
        // A ray within the plane divides by zero; it fails this test, infinite or not a number.
        let met = (range > 0.0) & (across.abs() <= board.half[0]) & (down.abs() <= board.half[1]);
        let (column, row) = (across / square + 0.5 * columns, down / square + 0.5 * rows);
        let printed = (column >= 0.0) & (column < columns) & (row >= 0.0) & (row < rows);
        let is_black = printed & ((column.split().0 + row.split().0) & 1 == 0);
        let [beside, back, black, white] = board.lights;
        let printed = if is_black { black } else { white };
        let seen = if z[i] < 0.0 { back } else { printed };
        lights[i] = if met { seen } else { beside };
    }
    lights
}
