//! Matches in the simulated room, as in the paper's Fig. 4: this program's matchers on the unrectified pair, beside
//! semi-global matching on a rectified one.

use image::{RgbImage, imageops};
use nalgebra::UnitQuaternion;
use vergence_matching::learned::LearnedMatcher;
use vergence_matching::{GuidedMatcher, Matcher};
use vergence_output::match_svg;
use vergence_pipeline::{Method, PairImages, PairPose, Score, pair_cloud, score};
use vergence_rig::{Rig, RigPose};
use vergence_scene::{Optics, Scene, View, render};
use vergence_vision::{Base, KannalaBrandt, Left, Length, Pixel, Transform, World};

use crate::bench::{MODES, bench_with_sensors};
use crate::error::ReproduceError;
use crate::sgbm::{Sgbm, SgbmAnswer, SgbmTask};

/// Pixels on a side of the images.
const SIDE: u32 = 960;
/// Width of a picture on the page, in pixels.
const PICTURE_WIDTH: u32 = 1200;

/// One matcher in one mode.
#[derive(Clone, Debug)]
pub struct Matching {
    /// The mode of the rig.
    pub mode: &'static str,
    /// Name of the matcher.
    pub matcher: String,
    /// The result, or a sentence that says why there is none.
    pub outcome: Result<Outcome, String>,
}

/// What a matcher found.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Points; for a dense matcher, pixels.
    pub points: usize,
    /// Errors of the ranges against the truth.
    pub score: Score,
    /// The matches over both images, or the disparities beside the left image.
    pub picture: Picture,
    /// A remark for the page.
    pub note: String,
}

/// A picture of an outcome.
#[derive(Clone, Debug)]
pub enum Picture {
    /// The text of an SVG file.
    Svg(String),
    /// Pixels.
    Raster(RgbImage),
}

/// The room as the rig sees it in one mode.
struct RoomInMode {
    mode: &'static str,
    pose: RigPose,
    left: RgbImage,
    right: RgbImage,
    world_from_left: Transform<World, Left>,
}

/// What the matchings need from outside.
pub struct MatchingTools<'a> {
    /// The learned matcher, or a sentence that says why there is none.
    pub learned: Result<&'a LearnedMatcher, String>,
    /// Runs OpenCV's semi-global matching in Python.
    pub opencv: &'a dyn Fn(&SgbmTask<'_>) -> Result<SgbmAnswer, String>,
}

/// Matches the room in every mode by the classical matcher, by the learned one and by OpenCV. `seed` decides the noise of
/// the images.
///
/// # Errors
/// Where the built-in bench is refused.
pub fn matchings(tools: &MatchingTools<'_>, seed: u64) -> Result<Vec<Matching>, ReproduceError> {
    let rig = bench_with_sensors(SIDE)?;
    let scene = Scene::room();
    let mut matchings = Vec::new();
    for room in MODES.iter().filter_map(|mode| RoomInMode::new(mode, &rig, &scene, seed)) {
        let mode = room.mode;
        let matched = |matcher: &dyn Matcher| room.matched(matcher, &rig, &scene);
        matchings.push(Matching { mode, matcher: "classical".into(), outcome: matched(&GuidedMatcher::default()) });
        matchings.push(match &tools.learned {
            Ok(learned) => Matching { mode, matcher: learned.name().to_owned(), outcome: matched(*learned) },
            Err(why) => Matching { mode, matcher: "learned".into(), outcome: Err(why.clone()) },
        });
        let outcome = room.rectified(tools.opencv, &rig, &scene);
        matchings.push(Matching { mode, matcher: "OpenCV SGBM, rectified".into(), outcome });
    }
    Ok(matchings)
}

impl RoomInMode {
    /// Renders the room for both cameras; `None` for a mode that the rig does not have.
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

    fn images(&self) -> PairImages<'_> {
        PairImages { left: &self.left, right: &self.right }
    }

    fn matched(&self, matcher: &dyn Matcher, rig: &Rig, scene: &Scene) -> Result<Outcome, String> {
        let pose = PairPose::standing(self.pose.clone());
        let cloud = pair_cloud(self.images(), rig, &pose, Method::from(matcher), &mut |_| ())
            .map_err(|error| error.to_string())?;
        let points = cloud.points.iter().map(|point| (point.point.pixels.left, point.point.point));
        let ranges = points.map(|(left, point)| (left, Length::from_mm(point.mm().norm())));
        Ok(Outcome {
            points: cloud.points.len(),
            score: self.scored(ranges, rig, scene),
            picture: Picture::Svg(match_svg(self.images(), &cloud).map_err(|error| error.to_string())?),
            note: format!("{} matches before the gates", cloud.matches),
        })
    }

    fn rectified(
        &self,
        opencv: &dyn Fn(&SgbmTask<'_>) -> Result<SgbmAnswer, String>,
        rig: &Rig,
        scene: &Scene,
    ) -> Result<Outcome, String> {
        let answer = opencv(&SgbmTask::new(self.mode, [&self.left, &self.right], rig, &self.pose))?;
        let found = Sgbm::read(answer.figures)?;
        Ok(Outcome {
            points: found.pixels,
            score: self.scored(found.points(), rig, scene),
            picture: Picture::Raster(shrunk(&answer.picture)),
            note: format!(
                "OpenCV {}, {:.0} % of a rectified view of 90°; the view holds nothing else",
                found.version,
                100.0 * found.covered
            ),
        })
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
