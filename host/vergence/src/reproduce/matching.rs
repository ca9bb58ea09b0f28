//! What matchers find in the simulated room, as in the paper's Fig. 4: ours on the unrectified pair, beside semi-global
//! matching on a rectified one.

use std::path::Path;

use image::{RgbImage, imageops};
use nalgebra::UnitQuaternion;
use vergence_matching::learned::LearnedMatcher;
use vergence_matching::{GuidedMatcher, Matcher};
use vergence_rig::{Rig, RigPose};
use vergence_scene::{Optics, Scene, View, render};
use vergence_vision::{Base, KannalaBrandt, Left, Length, Pixel, Transform, World};

use super::bench::MODES;
use super::sgbm::sgbm;
use crate::failure::Failure;
use crate::look::{Eyes, look};
use crate::output::{match_picture, write_png};
use crate::rig_file::bench_with_sensors;
use crate::score::{Score, score};

/// Pixels on a side of the images.
const SIDE: u32 = 960;
/// Pictures in the page are so wide.
const PICTURE_WIDTH: u32 = 1200;

/// One matcher in one mode.
#[derive(Clone, Debug)]
pub struct Matching {
    /// The mode.
    pub mode: &'static str,
    /// The matcher.
    pub matcher: String,
    /// What came of it; why nothing did otherwise.
    pub outcome: Result<Outcome, String>,
}

/// Points of a matcher.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Points; of a dense matcher pixels.
    pub points: usize,
    /// Ranges against the truth.
    pub score: Score,
    /// Matches, or disparities beside the left image.
    pub picture: RgbImage,
    /// More in words.
    pub note: String,
}

/// The room as the rig sees it in one mode.
struct Sight {
    mode: &'static str,
    pose: RigPose,
    left: RgbImage,
    right: RgbImage,
    world_from_left: Transform<World, Left>,
}

/// Matches the room in every mode by the classical matcher, by `learned` (or why there is none) and by OpenCV in `python`.
/// `folder` takes the images for the latter.
///
/// # Errors
/// Where an image cannot be written.
pub fn matchings(
    learned: &Result<LearnedMatcher, String>,
    python: &str,
    folder: &Path,
    seed: u64,
) -> Result<Vec<Matching>, Failure> {
    let rig = bench_with_sensors(SIDE)?;
    let scene = Scene::room();
    let mut matchings = Vec::new();
    for sight in MODES.iter().filter_map(|mode| Sight::new(mode, &rig, &scene, seed)) {
        let mode = sight.mode;
        let guided: &dyn Matcher = &GuidedMatcher::default();
        matchings.push(Matching { mode, matcher: "classical".into(), outcome: sight.matched(guided, &rig, &scene) });
        matchings.push(match learned {
            Ok(learned) => {
                Matching { mode, matcher: learned.name().to_owned(), outcome: sight.matched(learned, &rig, &scene) }
            }
            Err(why) => Matching { mode, matcher: "learned".into(), outcome: Err(why.clone()) },
        });
        let outcome = sight.rectified(python, folder, &rig, &scene)?;
        matchings.push(Matching { mode, matcher: "OpenCV SGBM, rectified".into(), outcome });
    }
    Ok(matchings)
}

impl Sight {
    /// `None` for a mode that the rig does not have.
    fn new(mode: &'static str, rig: &Rig, scene: &Scene, seed: u64) -> Option<Self> {
        let values: Vec<f64> = rig.mode(mode)?.targets.iter().map(|target| target.value()).collect();
        let pose = rig.pose_at_values(&values);
        // The middle of the bench stands in the middle of the room.
        let middle = pose.base_from_left * (pose.left_from_right.origin());
        let middle = (pose.base_from_left.origin().mm() + middle.mm()) / 2.0;
        let world_from_base = Transform::<World, Base>::new(UnitQuaternion::identity(), -middle);
        let world_from_left = world_from_base * pose.base_from_left;
        let photograph = |lens: &KannalaBrandt, world_from_camera, seed| {
            let optics = Optics::default();
            render(&View { scene, camera: lens, world_from_camera, optics: &optics }, seed).image
        };
        let left = photograph(&rig.left_camera, world_from_left.renamed(), seed.wrapping_mul(2));
        let right =
            photograph(&rig.right_camera, (world_from_left * pose.left_from_right).renamed(), seed.wrapping_mul(2) + 1);
        Some(Self { mode, pose, left, right, world_from_left })
    }

    fn eyes(&self) -> Eyes<'_> {
        Eyes { left: &self.left, right: &self.right }
    }

    fn matched(&self, matcher: &dyn Matcher, rig: &Rig, scene: &Scene) -> Result<Outcome, String> {
        let look = look(self.eyes(), rig, &self.pose, matcher).map_err(|error| error.to_string())?;
        let points = look.points.iter().map(|point| (point.point.pixels.left, point.point.point));
        let ranges = points.map(|(left, point)| (left, Length::from_mm(point.mm().norm())));
        Ok(Outcome {
            points: look.points.len(),
            score: self.scored(ranges, rig, scene),
            picture: shrunk(&match_picture(self.eyes(), &look.points)),
            note: format!("{} matches before the gates", look.matches),
        })
    }

    fn rectified(
        &self,
        python: &str,
        folder: &Path,
        rig: &Rig,
        scene: &Scene,
    ) -> Result<Result<Outcome, String>, Failure> {
        let file = |what: &str| folder.join(format!("{}-{what}.png", self.mode));
        let (left, right, picture) = (file("left"), file("right"), file("sgbm"));
        write_png(&left, &self.left)?;
        write_png(&right, &self.right)?;
        let outcome = || {
            let found = sgbm(python, [&left, &right, &picture], rig, &self.pose)?;
            let drawn = image::open(&picture).map_err(|error| error.to_string())?;
            Ok(Outcome {
                points: found.pixels,
                score: self.scored(found.points(), rig, scene),
                picture: shrunk(&drawn.to_rgb8()),
                note: format!(
                    "OpenCV {}, {:.0} % of a rectified view of 90°; the view holds nothing else",
                    found.version,
                    100.0 * found.covered
                ),
            })
        };
        Ok(outcome())
    }

    fn scored(&self, points: impl Iterator<Item = (Pixel, Length)>, rig: &Rig, scene: &Scene) -> Score {
        let truth = |pixel| {
            let ray = self.world_from_left * rig.left_camera.unproject::<Left>(pixel).ok()?;
            scene.cast(&self.world_from_left.origin(), &ray).map(|hit| hit.range)
        };
        score(&points.map(|(pixel, range)| (range, truth(pixel))).collect::<Vec<_>>())
    }
}

fn shrunk(picture: &RgbImage) -> RgbImage {
    let (width, height) = picture.dimensions();
    let wanted = PICTURE_WIDTH.min(width);
    imageops::resize(picture, wanted, (height * wanted / width).max(1), imageops::FilterType::Triangle)
}
