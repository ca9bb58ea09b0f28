//! The two cameras of a built bench, with the lenses that they truly have.

use vergence_scene::{Target, TrueLens};
use vergence_vision::{Camera, Left, Right, Transform};

use crate::bench::Bench;
use crate::conditions::Conditions;
use crate::error::ReproduceError;
use crate::target_shot::{Photo, TargetShot};

/// What photographs targets.
pub struct Eyes<'a> {
    /// The left and the right lens.
    pub lenses: [TrueLens; 2],
    /// What the photographs suffer from.
    pub conditions: &'a Conditions,
}

impl<'a> Eyes<'a> {
    /// Those of a bench: of the kind that the conditions name, with the scale and the centre of the lenses that it was built with.
    ///
    /// # Errors
    /// Where a design cannot be traced.
    pub fn of(bench: &Bench, conditions: &'a Conditions) -> Result<Self, ReproduceError> {
        let built = |lens| {
            conditions
                .lens
                .in_place_of(lens)
                .map_err(|error| ReproduceError::Rig(format!("{}: {error}", conditions.lens)))
        };
        Ok(Self { lenses: [built(&bench.built.left_camera)?, built(&bench.built.right_camera)?], conditions })
    }

    /// What one of them photographs; `None` where no corner is in sight.
    pub fn photograph(&self, side: usize, camera_from_target: Transform<Camera, Target>, seed: u64) -> Option<Photo> {
        TargetShot { lens: &self.lenses[side], camera_from_target, bow: self.conditions.bow, seed }
            .photograph(self.conditions)
    }

    /// What both photograph of a target at `left_from_target`.
    pub fn photographs(
        &self,
        left_from_right: &Transform<Left, Right>,
        left_from_target: &Transform<Left, Target>,
        seed: u64,
    ) -> [Option<Photo>; 2] {
        let in_right = (left_from_right.inverse() * *left_from_target).renamed();
        [
            self.photograph(0, left_from_target.renamed(), seed.wrapping_mul(2)),
            self.photograph(1, in_right, seed.wrapping_mul(2).wrapping_add(1)),
        ]
    }
}
