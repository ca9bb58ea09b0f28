//! Manifests: descriptions of the tensors of pre-trained networks, so that other exports of the LightGlue family can be
//! used.
//!
//! Exports differ in names, in the normalisation of keypoints, in the form of the list of matches, and in whether
//! extraction and matching are one network. A [`Manifest`] states these; [`super::Model::new`] checks it against the
//! networks.

use serde::{Deserialize, Serialize};

/// The description of a model: its image input and its networks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// Name of the model.
    pub name: String,
    /// The licence of its weights, as an SPDX expression or in words.
    pub licence: String,
    /// Form of the image input.
    pub image: ImageInput,
    /// The networks with their tensors.
    pub networks: Networks,
}

/// The networks of a model: one for each step, or one for all.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
#[allow(clippy::large_enum_variant, reason = "one in a program: a box would only be in the way")]
pub enum Networks {
    /// Two networks: one extracts keypoints, one matches them.
    Separate {
        /// The network from an image to keypoints.
        extractor: Extractor,
        /// The network from keypoints to matches.
        matcher: Glue,
    },
    /// One network from two images to keypoints and matches.
    EndToEnd(Pipeline),
}

/// The form of the image tensor, `[1, channels, height, width]`, or `[2, ...]` for two images in one batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImageInput {
    /// Number of channels: 1 for grey, 3 for grey repeated.
    pub channels: usize,
    /// Height and width must be multiples of this; images are padded with black.
    pub multiple_of: usize,
}

/// A network from an image to keypoints and descriptors.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Extractor {
    /// Name of the file, in the folder of the manifest.
    pub file: String,
    /// SHA-256 of the file in hexadecimal, if known.
    #[serde(default)]
    pub sha256: Option<String>,
    /// Name of the input with the image.
    pub image: String,
    /// Name of the output with the keypoints, `[1, N, 2]` or `[N, 2]`: x, y in pixels.
    pub keypoints: String,
    /// Name of the output with the descriptors, `[1, N, D]` or `[N, D]`.
    pub descriptors: String,
    /// Name of the output with the scores, `[1, N]` or `[N]`, best first; the first score of zero or less ends the
    /// list.
    pub scores: String,
    /// Length D of a descriptor.
    pub descriptor_width: usize,
}

/// A network from keypoints and descriptors of both images to matches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Glue {
    /// Name of the file, in the folder of the manifest.
    pub file: String,
    /// SHA-256 of the file in hexadecimal, if known.
    #[serde(default)]
    pub sha256: Option<String>,
    /// Names of the inputs with the left and right keypoints, `[1, N, 2]` each.
    pub keypoints: [String; 2],
    /// Names of the inputs with the left and right descriptors, `[1, N, D]` each.
    pub descriptors: [String; 2],
    /// The coordinates of the keypoints.
    pub coordinates: Coordinates,
    /// The outputs with the matches.
    pub result: MatchOutput,
}

/// A network from two images to keypoints and matches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pipeline {
    /// Name of the file, in the folder of the manifest.
    pub file: String,
    /// SHA-256 of the file in hexadecimal, if known.
    #[serde(default)]
    pub sha256: Option<String>,
    /// Names of the inputs: two for two images, one for both in one batch.
    pub images: Vec<String>,
    /// Names of the outputs with the keypoints in pixels: two for `[N, 2]` each (or `[1, N, 2]`), one for `[2, N, 2]`.
    pub keypoints: Vec<String>,
    /// The outputs with the matches.
    pub result: MatchOutput,
}

/// The coordinates of keypoints in a network's input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Coordinates {
    /// Pixels.
    Pixels,
    /// Normalised as by LightGlue itself: (xy − size / 2) / (longer side / 2).
    Centred,
}

/// The outputs of a network with the matches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MatchOutput {
    /// Name of the output with the indices.
    pub matches: String,
    /// Name of the output with the scores, 0 to 1.
    pub scores: String,
    /// Form of the list of indices.
    pub form: MatchForm,
    /// Matches up to this score are dropped.
    pub threshold: f32,
}

/// The form of a list of matched indices.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MatchForm {
    /// `[1, N]`: the index of the right keypoint for every left one, −1 for none; scores `[1, N]`.
    PerKeypoint,
    /// `[M, 2]`: left and right index; scores `[M]`.
    Pairs,
    /// `[M, 3]`: index of the image pair (always 0 here), left and right index; scores `[M]`.
    PairsInBatch,
}

impl Manifest {
    /// The manifest of XFeat (Potje et al., CVPR 2024) with LighterGlue, as an extractor and a matcher with these file
    /// names.
    #[must_use]
    pub fn xfeat_lighterglue(extractor: &str, matcher: &str) -> Self {
        let two = |name: &str| [format!("{name}0"), format!("{name}1")];
        Self {
            name: "xfeat-lighterglue".into(),
            licence: "Apache-2.0".into(),
            image: ImageInput { channels: 1, multiple_of: 32 },
            networks: Networks::Separate {
                extractor: Extractor {
                    file: extractor.into(),
                    sha256: None,
                    image: "image".into(),
                    keypoints: "keypoints".into(),
                    descriptors: "descriptors".into(),
                    scores: "scores".into(),
                    descriptor_width: 64,
                },
                matcher: Glue {
                    file: matcher.into(),
                    sha256: None,
                    keypoints: two("kpts"),
                    descriptors: two("desc"),
                    coordinates: Coordinates::Centred,
                    result: MatchOutput {
                        matches: "matches0".into(),
                        scores: "mscores0".into(),
                        form: MatchForm::PerKeypoint,
                        threshold: 0.1,
                    },
                },
            },
        }
    }

    /// The files of the networks, each with its SHA-256 if known.
    pub fn files(&self) -> impl Iterator<Item = (&str, Option<&str>)> {
        let (first, second) = match &self.networks {
            Networks::Separate { extractor, matcher } => {
                ((&extractor.file, &extractor.sha256), Some((&matcher.file, &matcher.sha256)))
            }
            Networks::EndToEnd(pipeline) => ((&pipeline.file, &pipeline.sha256), None),
        };
        std::iter::once(first).chain(second).map(|(file, digest)| (file.as_str(), digest.as_deref()))
    }
}
