//! A simulated person who holds a chessboard in front of simulated cameras, at another place after every second frame.

use nalgebra::{UnitQuaternion, Vector3};
use vergence_scene::{Board, Optics, Scene, View, render};
use vergence_vision::{Camera as CameraFrame, KannalaBrandt, Left, Point, Right, Side, Transform, World};

use super::{Camera, Frame};
use crate::failure::Failure;
use crate::sim::Random;

/// The board is held between these distances from the left camera.
const RANGE_MM: [f64; 2] = [180.0, 420.0];
/// Each place is held for so many frames, so that it is seen to be still.
const HELD_FRAMES: u64 = 2;
/// A place that no camera sees is no place; after so many there is none.
const TRIES: u32 = 10_000;

/// What there is to see: the cameras where they stand, and the board that is held.
#[derive(Clone, Copy, Debug)]
pub struct BoardStage {
    /// The left lens; its frame is the world.
    pub left: KannalaBrandt,
    /// The right lens and where it stands.
    pub right: (KannalaBrandt, Transform<Left, Right>),
    /// Whether both cameras must see the board.
    pub both: bool,
    /// The board.
    pub board: Board,
    /// Drives where the board is held, and the noise.
    pub seed: u64,
}

/// One camera of the stage.
pub struct SimulatedBoardCamera {
    /// The stage.
    pub stage: BoardStage,
    /// Which camera.
    pub side: Side,
    /// Frames so far.
    pub frames: u64,
}

impl BoardStage {
    /// Where the board is held for the `index`th time; `None` where there is no such place.
    #[must_use]
    pub fn left_from_board(&self, index: u64) -> Option<Transform<Left, Board>> {
        let mut random = Random::new(self.seed ^ (index + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let mut uniform = move |low, high| random.between(low, high);
        (0..TRIES).find_map(|_| {
            // Evenly over the sphere as far as the lens sees.
            let (low, turn) = (self.left.theta_max().rad().cos(), uniform(0.0, std::f64::consts::TAU));
            let z = uniform(low, 1.0);
            let side = (1.0 - z * z).sqrt();
            let towards = Vector3::new(side * turn.cos(), side * turn.sin(), z);
            let facing = UnitQuaternion::rotation_between(&Vector3::z(), &towards)?;
            let tilt = UnitQuaternion::from_euler_angles(uniform(-0.7, 0.7), uniform(-0.7, 0.7), uniform(-0.5, 0.5));
            let rotation = facing * tilt;
            let centre = towards * uniform(RANGE_MM[0], RANGE_MM[1]);
            let place = self.board.placed(rotation, centre);
            self.sees(&place).then_some(place)
        })
    }

    fn sees(&self, left_from_board: &Transform<Left, Board>) -> bool {
        let right_from_board = self.right.1.inverse() * *left_from_board;
        let (columns, rows) = (self.board.columns.saturating_sub(1), self.board.rows.saturating_sub(1));
        let corners = [(0, 0), (columns, 0), (0, rows), (columns, rows)].map(|(x, y)| self.board.corner(x, y));
        corners.iter().all(|&corner| {
            let left = in_picture(&self.left, &(*left_from_board * corner));
            left && (!self.both || in_picture(&self.right.0, &(right_from_board * corner)))
        })
    }
}

fn in_picture<F: vergence_vision::Frame>(lens: &KannalaBrandt, point: &Point<F>) -> bool {
    lens.project_point(point).is_ok_and(|pixel| lens.on_sensor(pixel))
}

impl Camera for SimulatedBoardCamera {
    fn grab(&mut self) -> Result<Option<Frame>, Failure> {
        let place = self.stage.left_from_board(self.frames / HELD_FRAMES).ok_or_else(|| {
            Failure::usage("the cameras share no field in which a board can be held: choose another pose or board")
        })?;
        // The left camera's frame is the world of this picture.
        let scene = Scene::board_alone(self.stage.board, place.renamed::<World, Board>());
        let (camera, world_from_camera): (_, Transform<World, CameraFrame>) = match self.side {
            Side::Left => (&self.stage.left, Transform::new(UnitQuaternion::identity(), Vector3::zeros())),
            Side::Right => (&self.stage.right.0, self.stage.right.1.renamed()),
        };
        // Corners are edges: many rays there keep them where they are. The rest is plain.
        let optics = Optics { samples: 1, edge_samples: 100, ..Optics::default() };
        let seed = self.stage.seed.wrapping_mul(4).wrapping_add(self.frames * 2 + self.side.index() as u64);
        let photograph = render(&View { scene: &scene, camera, world_from_camera, optics: &optics }, seed);
        self.frames += 1;
        let name = format!("frame{:06}", self.frames);
        Ok(Some(Frame { image: photograph.image, name, seq: None, exposed_at: None }))
    }
}
