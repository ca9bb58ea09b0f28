//! The cameras of a rig that drives itself, attached or simulated.

use vergence_board::Shared;
use vergence_camera::Camera;
use vergence_rig::Rig;
use vergence_scene::{LensChoice, MarkerBoard, Sheet, TagGrid, TagPrint, Target};
use vergence_sim::{HeldTarget, SimulatedRig, TargetCamera};
use vergence_targets::{AprilGridSpec, MARKER_BORDER, TAG_BORDER, TagFamily, TargetKind, TargetSpec};
use vergence_vision::Side;

/// The cameras of a rig.
pub enum RigCameras {
    /// Attached cameras, left before right.
    Attached(Vec<Box<dyn Camera>>),
    /// Simulated cameras.
    Simulated(Box<SimulatedTarget>),
}

/// Cameras on simulated mechanics, and a person who holds a target before them.
pub struct SimulatedTarget {
    /// The mechanics.
    pub rig: Shared<SimulatedRig>,
    /// The rig as it was really built.
    pub built: Rig,
    /// The target that is held.
    pub target: TargetKind,
    /// The lenses of the cameras, in the place of those that the rig was built with.
    pub lens: LensChoice,
    /// Seed of the places of the target, and of the noise.
    pub seed: u64,
}

/// The target as the simulated cameras see it.
#[must_use]
pub fn printed(target: &TargetKind) -> Sheet {
    match *target {
        TargetKind::AprilGrid(grid) => {
            let code = code(&AprilGridSpec::FAMILY, TAG_BORDER);
            let gap = grid.tag * grid.spacing;
            Sheet::Tags(TagGrid { columns: grid.columns, rows: grid.rows, tag: grid.tag, gap, code })
        }
        TargetKind::Chessboard(TargetSpec { columns, rows, square }) => Target { columns, rows, square }.into(),
        TargetKind::Charuco(board) => Sheet::Markers(MarkerBoard {
            columns: board.columns,
            rows: board.rows,
            square: board.square,
            marker: board.marker,
            white_first: board.is_white_first(),
            code: code(&board.dictionary, MARKER_BORDER),
        }),
    }
}

/// What is printed in tags, as the simulated cameras see it.
const fn code(family: &TagFamily, border: u32) -> TagPrint {
    TagPrint { side: family.side, border, codes: family.codes }
}

impl RigCameras {
    /// The cameras at the present stage pose, the `index`th.
    pub(super) fn here(&mut self, index: usize) -> Vec<Box<dyn Camera>> {
        match self {
            Self::Attached(cameras) => std::mem::take(cameras),
            Self::Simulated(simulated) => simulated.cameras(index),
        }
    }

    /// Keeps the attached cameras for the next stage pose.
    pub(super) fn give_back(&mut self, cameras: Vec<Box<dyn Camera>>) {
        if let Self::Attached(own) = self {
            *own = cameras;
        }
    }
}

impl SimulatedTarget {
    fn cameras(&self, index: usize) -> Vec<Box<dyn Camera>> {
        let held = HeldTarget {
            left: self.built.left_camera,
            right: (self.built.right_camera, self.rig.lock().true_pose().left_from_right),
            both: true,
            target: printed(&self.target),
            // Another seed for each stage pose, so that the target is held elsewhere.
            seed: self.seed.wrapping_mul(1009).wrapping_add(index as u64),
        };
        let camera = |side| Box::new(TargetCamera::new(held, side).with_lens(self.lens)) as Box<dyn Camera>;
        vec![camera(Side::Left), camera(Side::Right)]
    }
}
