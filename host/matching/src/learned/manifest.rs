//! Which tensors of which networks mean what: so that other exports of the LightGlue family plug in.
//!
//! Exports differ in names, in whether keypoints are normalised, in how matches are listed, and in whether extraction
//! and matching are one network. A [`Manifest`] says so in a few words; [`super::LearnedMatcher`] checks it against
//! the networks before it believes it.

use serde::{Deserialize, Serialize};

/// A pair of networks, or one that does both.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// What people call it.
    pub name: String,
    /// The licence of its weights, as an SPDX expression or in words.
    pub licence: String,
    /// How images go in.
    pub image: ImageInput,
    /// The networks.
    pub networks: Networks,
}

/// One network for each step, or one for all.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
#[allow(clippy::large_enum_variant, reason = "one in a program: a box would only be in the way")]
pub enum Networks {
    /// Keypoints first, then matches.
    Separate {
        /// Image to keypoints.
        extractor: Extractor,
        /// Keypoints to matches.
        matcher: Glue,
    },
    /// Two images to keypoints and matches.
    EndToEnd(Pipeline),
}

/// How an image becomes a tensor `[1, channels, height, width]`, or two of them one of `[2, ...]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImageInput {
    /// 1 for grey, 3 for grey repeated.
    pub channels: usize,
    /// Height and width must be multiples of this; images are continued with black.
    pub multiple_of: usize,
}

/// Image to keypoints.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Extractor {
    /// The file, beside the manifest.
    pub file: String,
    /// SHA-256 of the file in hexadecimal, where it is known.
    #[serde(default)]
    pub sha256: Option<String>,
    /// Input: the image.
    pub image: String,
    /// Output `[1, N, 2]` or `[N, 2]`: x, y in pixels.
    pub keypoints: String,
    /// Output `[1, N, D]` or `[N, D]`.
    pub descriptors: String,
    /// Output `[1, N]` or `[N]`: best first; scores of zero and less end the list.
    pub scores: String,
    /// D: how many numbers describe a keypoint.
    pub descriptor_width: usize,
}

/// Keypoints to matches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Glue {
    /// The file, beside the manifest.
    pub file: String,
    /// SHA-256 of the file in hexadecimal, where it is known.
    #[serde(default)]
    pub sha256: Option<String>,
    /// Inputs `[1, N, 2]`: keypoints, left and right.
    pub keypoints: [String; 2],
    /// Inputs `[1, N, D]`: descriptors, left and right.
    pub descriptors: [String; 2],
    /// What the keypoints are measured in.
    pub coordinates: Coordinates,
    /// How matches come out.
    pub result: MatchOutput,
}

/// Two images to keypoints and matches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pipeline {
    /// The file, beside the manifest.
    pub file: String,
    /// SHA-256 of the file in hexadecimal, where it is known.
    #[serde(default)]
    pub sha256: Option<String>,
    /// Inputs: two names for two images, one name for both in one batch.
    pub images: Vec<String>,
    /// Outputs in pixels: two names for `[N, 2]` each (or `[1, N, 2]`), one name for `[2, N, 2]`.
    pub keypoints: Vec<String>,
    /// How matches come out.
    pub result: MatchOutput,
}

/// What keypoints are measured in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Coordinates {
    /// Pixels.
    Pixels,
    /// (xy − size / 2) / (longer side / 2), as LightGlue's own normalisation.
    Centred,
}

/// How matches come out.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MatchOutput {
    /// The output with the indices.
    pub matches: String,
    /// The output with the scores, 0 to 1.
    pub scores: String,
    /// How the indices are listed.
    pub form: MatchForm,
    /// Matches below this score are not believed.
    pub threshold: f32,
}

/// How indices of matches are listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MatchForm {
    /// `[1, N]`: for every left keypoint the right one, −1 for none; scores likewise.
    PerKeypoint,
    /// `[M, 2]`: left and right; scores `[M]`.
    Pairs,
    /// `[M, 3]`: image pair (always 0 here), left, right; scores `[M]`.
    PairsInBatch,
}

impl Manifest {
    /// XFeat (Potje et al., CVPR 2024) with LighterGlue, as one extractor and one matcher with these file names.
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

    /// Every file it needs, with the digest where it is known.
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
