//! The model: the networks of a manifest, run on two grey images.

use super::contract::{check_extractor, check_glue, check_pipeline};
use super::manifest::{Coordinates, Extractor, Glue, Manifest, MatchForm, MatchOutput, Networks, Pipeline};
use super::network::{Network, NetworkError, Tensor};

/// A grey image as the networks take it.
#[derive(Clone, Copy, Debug)]
pub struct GreyImage<'a> {
    /// Brightness of the pixels by rows, 0 to 1.
    pub values: &'a [f32],
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

/// A position in an image in pixels: x to the right, y down, (0, 0) the centre of the first pixel.
pub type Position = [f32; 2];

/// The keypoints and matches that the networks found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct KeypointMatches {
    /// The left and the right keypoints that were compared.
    pub keypoints: [Vec<Position>; 2],
    /// The matches: index of the left keypoint, index of the right keypoint, score.
    pub matches: Vec<(usize, usize, f32)>,
}

/// The tests whether a keypoint of the left and of the right image is compared.
pub type KeypointFilters<'a> = [&'a dyn Fn(Position) -> bool; 2];

/// The networks of a manifest, loaded and checked.
pub struct Model {
    manifest: Manifest,
    networks: Vec<Box<dyn Network>>,
}

impl Model {
    /// Makes a model of loaded networks, in the order of [`Manifest::files`], and checks them against the manifest.
    ///
    /// # Errors
    /// [`NetworkError::Contract`] where a tensor is missing or does not have the shape that the manifest states.
    pub fn new(manifest: Manifest, networks: Vec<Box<dyn Network>>) -> Result<Self, NetworkError> {
        match (&manifest.networks, networks.as_slice()) {
            (Networks::Separate { extractor, matcher }, [first, second]) => {
                check_extractor(extractor, &manifest.image, first.as_ref())?;
                check_glue(matcher, extractor.descriptor_width, second.as_ref())?;
            }
            (Networks::EndToEnd(pipeline), [only]) => check_pipeline(pipeline, &manifest.image, only.as_ref())?,
            _ => {
                let reason = "another number of networks than the manifest names".into();
                return Err(NetworkError::Contract { network: manifest.name, reason });
            }
        }
        Ok(Self { manifest, networks })
    }

    /// Replaces every network by the result of `wrap`, which must have the same inputs and outputs.
    #[must_use]
    pub fn wrapped(self, wrap: impl FnMut(Box<dyn Network>) -> Box<dyn Network>) -> Self {
        Self { networks: self.networks.into_iter().map(wrap).collect(), ..self }
    }

    /// The manifest of the model.
    #[must_use]
    pub const fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Matches two images, with at most `budget` keypoints of each that pass the tests `filters`.
    ///
    /// # Errors
    /// [`NetworkError::Run`] where the networks fail or their outputs have impossible shapes or values.
    pub fn compare(
        &self,
        images: [GreyImage<'_>; 2],
        budget: usize,
        filters: KeypointFilters<'_>,
    ) -> Result<KeypointMatches, NetworkError> {
        match (&self.manifest.networks, self.networks.as_slice()) {
            (Networks::Separate { extractor, matcher }, [first, second]) => {
                let [left, right] = images;
                let left_features = self.extract(extractor, first.as_ref(), left, budget, filters[0])?;
                let right_features = self.extract(extractor, first.as_ref(), right, budget, filters[1])?;
                glue(matcher, second.as_ref(), images, [left_features, right_features])
            }
            (Networks::EndToEnd(pipeline), [only]) => self.end_to_end(pipeline, only.as_ref(), images, filters),
            _ => Ok(KeypointMatches::default()),
        }
    }

    fn extract(
        &self,
        extractor: &Extractor,
        network: &dyn Network,
        image: GreyImage<'_>,
        budget: usize,
        is_compared: &dyn Fn(Position) -> bool,
    ) -> Result<Features, NetworkError> {
        let names = [&*extractor.keypoints, &*extractor.descriptors, &*extractor.scores];
        let given = network.run(vec![(&extractor.image, self.image_tensor(&[image]))], &names)?;
        let [keypoints, descriptors, scores] = take(given)?;
        let (positions, scores) = (positions(&keypoints)?, scores.to_floats());
        let width = extractor.descriptor_width;
        let described = descriptors.to_floats();
        if described.len() != positions.len() * width || scores.len() != positions.len() {
            return Err(NetworkError::Run("keypoints, descriptors and scores differ in number".into()));
        }
        let mut features = Features::default();
        let found = positions.iter().zip(&scores).zip(described.chunks_exact(width));
        for ((&at, _), descriptor) in found.take_while(|((_, score), _)| **score > 0.0) {
            if features.positions.len() < budget && is_compared(at) {
                features.positions.push(at);
                features.descriptors.extend_from_slice(descriptor);
            }
        }
        Ok(features)
    }

    fn end_to_end(
        &self,
        pipeline: &Pipeline,
        network: &dyn Network,
        [left, right]: [GreyImage<'_>; 2],
        filters: KeypointFilters<'_>,
    ) -> Result<KeypointMatches, NetworkError> {
        let inputs = match pipeline.images.as_slice() {
            [both] => vec![(both.as_str(), self.image_tensor(&[left, right]))],
            [one, other] => {
                vec![(one.as_str(), self.image_tensor(&[left])), (other.as_str(), self.image_tensor(&[right]))]
            }
            _ => return Ok(KeypointMatches::default()),
        };
        let mut names: Vec<&str> = pipeline.keypoints.iter().map(String::as_str).collect();
        names.extend([&*pipeline.result.matches, &*pipeline.result.scores]);
        let mut given = network.run(inputs, &names)?;
        let [matches, scores] = take(given.split_off(given.len().saturating_sub(2)))?;
        let keypoints = match given.as_slice() {
            [both] => {
                let all = positions(both)?;
                let (left, right) = all.split_at(all.len() / 2);
                [left.to_vec(), right.to_vec()]
            }
            [one, other] => [positions(one)?, positions(other)?],
            _ => return Err(NetworkError::Run("it gave another number of tensors than asked".into())),
        };
        let mut matches = listed(&pipeline.result, &matches, &scores, [keypoints[0].len(), keypoints[1].len()])?;
        matches.retain(|&(i, j, _)| filters[0](keypoints[0][i]) && filters[1](keypoints[1][j]));
        Ok(KeypointMatches { keypoints, matches })
    }

    /// Makes one tensor of images, padded with black to their largest sides and to the multiple that the network takes.
    fn image_tensor(&self, images: &[GreyImage<'_>]) -> Tensor {
        let input = self.manifest.image;
        let round = |n: usize| n.next_multiple_of(input.multiple_of.max(1));
        let width = round(images.iter().map(|image| image.width).max().unwrap_or(0));
        let height = round(images.iter().map(|image| image.height).max().unwrap_or(0));
        let mut values = Vec::with_capacity(images.len() * input.channels * width * height);
        for image in images {
            for _ in 0..input.channels {
                for row in image.values.chunks_exact(image.width.max(1)) {
                    values.extend_from_slice(row);
                    values.resize(values.len() + width - image.width, 0.0);
                }
                values.resize(values.len() + (height - image.height) * width, 0.0);
            }
        }
        Tensor::floats(&[images.len(), input.channels, height, width], values)
    }
}

/// Keypoints and their concatenated descriptors.
#[derive(Default)]
struct Features {
    positions: Vec<Position>,
    descriptors: Vec<f32>,
}

fn glue(
    glue: &Glue,
    network: &dyn Network,
    images: [GreyImage<'_>; 2],
    features: [Features; 2],
) -> Result<KeypointMatches, NetworkError> {
    let counts = [features[0].positions.len(), features[1].positions.len()];
    // The networks do not accept empty inputs.
    if counts.contains(&0) {
        return Ok(KeypointMatches { keypoints: features.map(|side| side.positions), matches: Vec::new() });
    }
    let mut inputs = Vec::new();
    for side in 0..2 {
        let count = counts[side];
        let at = coordinates(glue.coordinates, images[side], &features[side].positions);
        let described = &features[side].descriptors;
        inputs.push((glue.keypoints[side].as_str(), Tensor::floats(&[1, count, 2], at)));
        let width = described.len() / count;
        inputs.push((glue.descriptors[side].as_str(), Tensor::floats(&[1, count, width], described.clone())));
    }
    let [matches, scores] = take(network.run(inputs, &[&*glue.result.matches, &*glue.result.scores])?)?;
    let matches = listed(&glue.result, &matches, &scores, counts)?;
    Ok(KeypointMatches { keypoints: features.map(|side| side.positions), matches })
}

fn coordinates(kind: Coordinates, image: GreyImage<'_>, positions: &[Position]) -> Vec<f32> {
    let (width, height) = (image.width as f32, image.height as f32);
    let half = width.max(height) / 2.0;
    let convert = |&[x, y]: &Position| match kind {
        Coordinates::Pixels => [x, y],
        Coordinates::Centred => [(x - width / 2.0) / half, (y - height / 2.0) / half],
    };
    positions.iter().flat_map(convert).collect()
}

/// Converts a network's list of matches, in any form, to index pairs with their scores.
fn listed(
    output: &MatchOutput,
    matches: &Tensor,
    scores: &Tensor,
    counts: [usize; 2],
) -> Result<Vec<(usize, usize, f32)>, NetworkError> {
    let indices = matches.integers().ok_or_else(|| NetworkError::Run("the matches are not integers".into()))?;
    let scores = scores.to_floats();
    let columns = match output.form {
        MatchForm::PerKeypoint => 1,
        MatchForm::Pairs => 2,
        MatchForm::PairsInBatch => 3,
    };
    if indices.len() != scores.len() * columns {
        return Err(NetworkError::Run("matches and scores differ in number".into()));
    }
    let mut list = Vec::new();
    for (row, (entry, &score)) in indices.chunks_exact(columns).zip(&scores).enumerate() {
        let (left, right) = match *entry {
            [right] => (i64::try_from(row).unwrap_or(i64::MAX), right),
            [left, right] | [_, left, right] => (left, right),
            _ => continue,
        };
        if right < 0 || score.is_nan() || score <= output.threshold {
            continue;
        }
        match (usize::try_from(left), usize::try_from(right)) {
            (Ok(i), Ok(j)) if i < counts[0] && j < counts[1] => list.push((i, j, score)),
            _ => return Err(NetworkError::Run(format!("it matches keypoint {left} to {right}, which do not exist"))),
        }
    }
    Ok(list)
}

fn positions(tensor: &Tensor) -> Result<Vec<Position>, NetworkError> {
    if tensor.shape.last() != Some(&2) {
        return Err(NetworkError::Run(format!("keypoints come as {:?}, not as x, y", tensor.shape)));
    }
    Ok(tensor.to_floats().chunks_exact(2).map(|xy| [xy[0], xy[1]]).collect())
}

fn take<const N: usize>(given: Vec<Tensor>) -> Result<[Tensor; N], NetworkError> {
    given.try_into().map_err(|_| NetworkError::Run("it gave another number of tensors than asked".into()))
}
