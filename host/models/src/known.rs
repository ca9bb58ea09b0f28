//! Models with publicly known tensors: what their publishers export, and where they publish it.

use vergence_matching::learned::{
    Coordinates, Extractor, Glue, ImageInput, Manifest, MatchForm, MatchOutput, Networks, Pipeline,
};

use crate::runtime::Runtime;

/// A model with publicly known tensors.
#[derive(Debug)]
pub struct Known {
    /// Name of the model in `vergence models`.
    pub name: &'static str,
    /// Origin and kind of the model.
    pub about: &'static str,
    /// The licence of its weights.
    pub licence: &'static str,
    /// Whether the licence forbids commercial use.
    pub non_commercial: bool,
    /// Address of the whole model as one ONNX file; `None` where nobody publishes one.
    pub address: Option<&'static str>,
    manifest: fn(&[&str]) -> Option<Manifest>,
}

/// All known models. The downloads are untested: the addresses could not be reached when this was written.
pub const KNOWN: &[Known] = &[
    Known {
        name: "xfeat-lighterglue",
        about: "XFeat with LighterGlue, of verlab/accelerated_features; published as PyTorch weights only: export them, then add",
        licence: "Apache-2.0",
        non_commercial: false,
        address: None,
        manifest: |files| match files {
            [extractor, matcher] => Some(Manifest::xfeat_lighterglue(extractor, matcher)),
            _ => None,
        },
    },
    Known {
        name: "disk-lightglue",
        about: "DISK with LightGlue in one network, of fabio-sim/LightGlue-ONNX v2.0; needs ONNX Runtime",
        licence: "Apache-2.0",
        non_commercial: false,
        address: Some(
            "https://github.com/fabio-sim/LightGlue-ONNX/releases/download/v2.0/disk_lightglue_pipeline.ort.onnx",
        ),
        manifest: |files| pipeline("disk-lightglue", "Apache-2.0", 3, files),
    },
    Known {
        name: "superpoint-lightglue",
        about: "SuperPoint with LightGlue in one network, of fabio-sim/LightGlue-ONNX v2.0; needs ONNX Runtime",
        licence: "SuperPoint: Magic Leap, for non-commercial research only; LightGlue: Apache-2.0",
        non_commercial: true,
        address: Some(
            "https://github.com/fabio-sim/LightGlue-ONNX/releases/download/v2.0/superpoint_lightglue_pipeline.ort.onnx",
        ),
        manifest: |files| pipeline("superpoint-lightglue", "non-commercial research only", 1, files),
    },
    Known {
        name: "disk-lightglue-fused",
        about: "DISK and LightGlue as two networks, of fabio-sim/LightGlue-ONNX v0.1",
        licence: "Apache-2.0",
        non_commercial: false,
        address: None,
        manifest: |files| match files {
            [extractor, matcher] => Some(separate_lightglue(extractor, matcher)),
            _ => None,
        },
    },
];

impl Known {
    /// The manifest of this model in these files; `None` where the count of files is wrong.
    #[must_use]
    pub fn manifest(&self, files: &[&str]) -> Option<Manifest> {
        (self.manifest)(files)
    }
}

/// `images` [2, C, H, W] to `keypoints` [2, N, 2], `matches` [M, 3], `mscores` [M].
fn pipeline(name: &str, licence: &str, channels: usize, files: &[&str]) -> Option<Manifest> {
    let [file] = files else { return None };
    Some(Manifest {
        name: name.into(),
        licence: licence.into(),
        image: ImageInput { channels, multiple_of: 16 },
        networks: Networks::EndToEnd(Pipeline {
            file: (*file).into(),
            sha256: None,
            images: vec!["images".into()],
            keypoints: vec!["keypoints".into()],
            result: MatchOutput {
                matches: "matches".into(),
                scores: "mscores".into(),
                form: MatchForm::PairsInBatch,
                threshold: 0.1,
            },
        }),
    })
}

fn separate_lightglue(extractor: &str, matcher: &str) -> Manifest {
    Manifest {
        name: "disk-lightglue-fused".into(),
        licence: "Apache-2.0".into(),
        image: ImageInput { channels: 3, multiple_of: 16 },
        networks: Networks::Separate {
            extractor: Extractor {
                file: extractor.into(),
                sha256: None,
                image: "image".into(),
                keypoints: "keypoints".into(),
                descriptors: "descriptors".into(),
                scores: "scores".into(),
                descriptor_width: 128,
            },
            matcher: Glue {
                file: matcher.into(),
                sha256: None,
                keypoints: ["kpts0".into(), "kpts1".into()],
                descriptors: ["desc0".into(), "desc1".into()],
                coordinates: Coordinates::Centred,
                result: MatchOutput {
                    matches: "matches0".into(),
                    scores: "mscores0".into(),
                    form: MatchForm::Pairs,
                    threshold: 0.1,
                },
            },
        },
    }
}

/// The known manifest that fits the networks in these files, each with its bytes, on one of the runtimes.
///
/// # Errors
/// A sentence: none fits, or more than one does.
pub fn manifest_for(files: &[(String, Vec<u8>)], runtimes: &[Runtime]) -> Result<Manifest, String> {
    let fits = |manifest: &Manifest| {
        let named = |wanted: &str| files.iter().find(|(file, _)| file == wanted).cloned();
        let named: Option<Vec<_>> = manifest.files().map(|(wanted, _)| named(wanted)).collect();
        named.is_some_and(|files| Runtime::check(runtimes, manifest, &files).is_ok())
    };
    let singles = files.iter().map(|(file, _)| vec![file.as_str()]);
    let couples = files.iter().flat_map(|(first, _)| {
        files.iter().filter(move |(second, _)| second != first).map(move |(second, _)| vec![first.as_str(), second])
    });
    let choices: Vec<Vec<&str>> = singles.chain(couples).collect();
    let fitting: Vec<Manifest> =
        KNOWN.iter().flat_map(|known| choices.iter().filter_map(|files| known.manifest(files))).filter(fits).collect();
    match fitting.as_slice() {
        [only] => Ok(only.clone()),
        [] => {
            Err("the tensors of these networks fit no model that is known: describe them in a model.toml beside them"
                .into())
        }
        several => {
            let names: Vec<String> = several
                .iter()
                .map(|manifest| {
                    let files: Vec<&str> = manifest.files().map(|(file, _)| file).collect();
                    format!("{} ({})", manifest.name, files.join(", "))
                })
                .collect();
            Err(format!("more than one model fits: {}; say which in a model.toml beside them", names.join("; ")))
        }
    }
}
