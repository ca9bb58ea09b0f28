//! The frame of a camera whose lens has no axis.
//!
//! Displaced elements leave a lens without an axis, and no image shows its barrel: a turn of the camera's frame by a thousandth of a radian
//! looks like another centre of the image with other decentring and thin prism, within some thousandths of a pixel. So views tell such a turn
//! badly, and what they tell of it is mostly what the model lacks. It changes no distance, and the pose of whatever is related to the camera
//! absorbs it. The frame of the camera is therefore defined by its rays as they were calibrated, all of them together, and covariances are
//! stated in that frame. This is an S-transformation (W. Baarda, "S-transformations and criterion matrices", Netherlands Geodetic
//! Commission, 1973).

use nalgebra::{DMatrix, Matrix3, SMatrix, Vector3};
use vergence_vision::{Camera, KannalaBrandt, LENS_PARAMETERS, Left, Right, Side, Transform, UnitRay};

use super::RigNumber;

/// The lens parameters that together look like a turn about x and y: the centre, decentring and thin prism.
const LIKE_A_TURN: [usize; 8] = [2, 3, 10, 11, 12, 13, 14, 15];
/// Those that only a lens without an axis has.
const NO_AXIS: std::ops::Range<usize> = 10..16;
/// The first parameter of the pose among the shared ones.
const POSE: usize = 2 * LENS_PARAMETERS;

/// Directions that fill the field in which a lens was measured evenly: a Fibonacci lattice (R. Swinbank and R. Purser, 2006).
pub fn even_directions(camera: &KannalaBrandt) -> impl Iterator<Item = UnitRay<Camera>> {
    const DIRECTIONS: u32 = 128;
    const GOLDEN: f64 = 2.399_963_229_728_653;
    let lowest = camera.measured_field().rad().min(std::f64::consts::PI).cos();
    (0..DIRECTIONS).filter_map(move |i| {
        let z = 1.0 - (1.0 - lowest) * (f64::from(i) + 0.5) / f64::from(DIRECTIONS);
        let (sin, cos) = (GOLDEN * f64::from(i)).sin_cos();
        let across = (1.0 - z * z).sqrt();
        UnitRay::new(Vector3::new(across * cos, across * sin, z))
    })
}

/// The derivative of a direction by the lens.
type RayByLens = SMatrix<f64, 3, LENS_PARAMETERS>;

/// Even directions as cross products, and the derivatives by the lens of the rays there, behind fixed pixels.
fn rays_by_lens(camera: &KannalaBrandt) -> Vec<(Matrix3<f64>, RayByLens)> {
    let by_lens =
        |ray: UnitRay<Camera>| (ray.vector().cross_matrix(), -(camera.ray_by_pixel(&ray) * camera.pixel_by_lens(&ray)));
    even_directions(camera).map(by_lens).collect()
}

/// How all rays of a camera together turn with the parameters of its lens: the ω (3, in radians about the axes of the camera) by each parameter
/// for which δd - d × ω is least, as a mean square over directions d that fill its measured field evenly.
#[must_use]
pub fn common_turn_by_lens(camera: &KannalaBrandt) -> SMatrix<f64, 3, LENS_PARAMETERS> {
    common_turn(&rays_by_lens(camera))
}

fn common_turn(rays: &[(Matrix3<f64>, RayByLens)]) -> SMatrix<f64, 3, LENS_PARAMETERS> {
    let (mut normal, mut right) = (Matrix3::<f64>::zeros(), RayByLens::zeros());
    for (cross, by_lens) in rays {
        normal += cross.transpose() * cross;
        right += cross.transpose() * by_lens;
    }
    normal.try_inverse().map_or_else(SMatrix::zeros, |inverse| inverse * right)
}

/// The frame in which the rays of a camera, all together, do not turn.
pub(crate) struct OwnFrame {
    /// Turn of all rays about x and y by the lens. Rows of pixels fix the turn about z.
    turn_by_lens: SMatrix<f64, 3, LENS_PARAMETERS>,
    /// Change of the lens that looks like a turn of all rays, by the turn.
    lens_by_turn: SMatrix<f64, LENS_PARAMETERS, 3>,
}

impl OwnFrame {
    /// That of `camera`, if `is_unknown` says that each parameter of a lens without an axis is; a symmetric lens has the frame of its axis.
    pub(crate) fn of(camera: &KannalaBrandt, is_unknown: impl Fn(usize) -> bool) -> Option<Self> {
        if !NO_AXIS.into_iter().all(is_unknown) {
            return None;
        }
        let (mut normal, mut right) = (SMatrix::<f64, 8, 8>::zeros(), SMatrix::<f64, 8, 3>::zeros());
        let rays = rays_by_lens(camera);
        for (cross, by_lens) in &rays {
            let like_a_turn = SMatrix::<f64, 3, 8>::from_fn(|row, column| by_lens[(row, LIKE_A_TURN[column])]);
            normal += like_a_turn.transpose() * like_a_turn;
            right += like_a_turn.transpose() * cross;
        }
        let solved = normal.cholesky()?.solve(&right);
        let mut lens_by_turn = SMatrix::<f64, LENS_PARAMETERS, 3>::zeros();
        for (row, parameter) in LIKE_A_TURN.into_iter().enumerate() {
            lens_by_turn.row_mut(parameter).copy_from(&solved.row(row));
        }
        let mut turn_by_lens = common_turn(&rays);
        turn_by_lens.row_mut(2).fill(0.0);
        Some(Self { turn_by_lens, lens_by_turn })
    }

    /// A covariance of the lens in this frame.
    pub(crate) fn covariance(
        &self,
        covariance: &SMatrix<f64, LENS_PARAMETERS, LENS_PARAMETERS>,
    ) -> SMatrix<f64, LENS_PARAMETERS, LENS_PARAMETERS> {
        let change = SMatrix::identity() - self.lens_by_turn * self.turn_by_lens;
        change * covariance * change.transpose()
    }
}

/// Takes turns of the cameras' own frames out of `by_numbers`, the derivative of the shared parameters by `numbers`, at a relative pose.
///
/// With ψ the turns of left and right frame that the lenses' changes look like, rays turn back by ψ, and the relative pose is one between
/// frames that are turned by ψ: ω ← ω + ψ_left - R ψ_right, δ ← δ + ψ_left × t.
pub(super) fn in_own_frames(
    by_numbers: &mut DMatrix<f64>,
    numbers: &[RigNumber],
    cameras: [&KannalaBrandt; 2],
    left_from_right: &Transform<Left, Right>,
) {
    let turn = left_from_right.rotation().to_rotation_matrix().into_inner();
    let offset = left_from_right.origin().mm().cross_matrix();
    let mut pose_by_turns = [SMatrix::<f64, 6, 3>::zeros(); 2];
    pose_by_turns[0].fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
    pose_by_turns[0].fixed_view_mut::<3, 3>(3, 0).copy_from(&-offset);
    pose_by_turns[1].fixed_view_mut::<3, 3>(0, 0).copy_from(&-turn);
    for ((side, camera), pose_by_turn) in [Side::Left, Side::Right].into_iter().zip(cameras).zip(pose_by_turns) {
        let is_unknown = |parameter| numbers.contains(&RigNumber::Lens { side, parameter });
        let Some(frame) = OwnFrame::of(camera, is_unknown) else { continue };
        let mut lens = by_numbers.fixed_rows_mut::<LENS_PARAMETERS>(side.index() * LENS_PARAMETERS);
        let turns = frame.turn_by_lens * &lens;
        lens -= frame.lens_by_turn * &turns;
        let mut pose = by_numbers.fixed_rows_mut::<6>(POSE);
        pose += pose_by_turn * &turns;
    }
}
