//! All forms of exports of the LightGlue family, on tiny networks with the same tensors (`tests/tiny/make.py`), and the
//! messages for networks that do not fit.
#![allow(clippy::expect_used, clippy::panic, clippy::disallowed_methods, reason = "a test fails loudly")]

use std::path::Path;

use vergence_matching::learned::{
    Coordinates, Extractor, Glue, GreyImage, ImageInput, KeypointMatches, Manifest, MatchForm, MatchOutput, Model,
    NetworkError, Networks, Pipeline,
};
use vergence_networks::load_rten;

fn output(matches: &str, scores: &str, form: MatchForm) -> MatchOutput {
    MatchOutput { matches: matches.into(), scores: scores.into(), form, threshold: 0.1 }
}

fn separate(channels: usize, width: usize, matcher: &str, form: MatchForm) -> Manifest {
    let pair = |name: &str| [format!("{name}0"), format!("{name}1")];
    Manifest {
        name: "tiny".into(),
        licence: "MIT".into(),
        image: ImageInput { channels, multiple_of: 32 },
        networks: Networks::Separate {
            extractor: Extractor {
                file: format!("extractor{width}.onnx"),
                sha256: None,
                image: "image".into(),
                keypoints: "keypoints".into(),
                descriptors: "descriptors".into(),
                scores: "scores".into(),
                descriptor_width: width,
            },
            matcher: Glue {
                file: format!("{matcher}{width}.onnx"),
                sha256: None,
                keypoints: pair("kpts"),
                descriptors: pair("desc"),
                coordinates: Coordinates::Pixels,
                result: output("matches0", "mscores0", form),
            },
        },
    }
}

fn whole(file: &str, channels: usize, images: &[&str], keypoints: &[&str], result: MatchOutput) -> Manifest {
    let names = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
    Manifest {
        name: "tiny".into(),
        licence: "MIT".into(),
        image: ImageInput { channels, multiple_of: 16 },
        networks: Networks::EndToEnd(Pipeline {
            file: file.into(),
            sha256: None,
            images: names(images),
            keypoints: names(keypoints),
            result,
        }),
    }
}

fn load(manifest: Manifest) -> Result<Model, NetworkError> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/tiny");
    let networks: Result<Vec<_>, _> = manifest
        .files()
        .map(|(file, _)| load_rten(file, &std::fs::read(folder.join(file)).expect("a tiny network")))
        .collect();
    Model::new(manifest, networks?)
}

fn compare(model: &Model, grey: f32) -> KeypointMatches {
    let values = vec![grey; 40 * 30];
    let picture = GreyImage { values: &values, width: 40, height: 30 };
    model.compare([picture, picture], 3, [&|_| true, &|[x, _]| x > 10.0]).expect("it runs")
}

/// Of the four keypoints the first three fit the budget on the left; the two with x > 10 pass the test on the right.
fn expect_matches_by_descriptor(found: &KeypointMatches) {
    assert_eq!(found.keypoints[0], [[8.0, 8.0], [24.0, 8.0], [8.0, 24.0]]);
    assert_eq!(found.keypoints[1], [[24.0, 8.0], [24.0, 24.0]]);
    let alike: Vec<_> = found.matches.iter().map(|&(i, j, _)| (i, j)).collect();
    assert_eq!(alike, [(1, 0)], "only the keypoint at (24, 8) is in both sets");
}

#[test]
fn separate_networks_of_every_descriptor_width_and_form() {
    for (width, channels) in [(64, 1), (128, 3), (256, 1)] {
        for (matcher, form) in [("per_keypoint", MatchForm::PerKeypoint), ("pairs", MatchForm::Pairs)] {
            let model = load(separate(channels, width, matcher, form)).expect("the contract holds");
            expect_matches_by_descriptor(&compare(&model, 0.5));
        }
    }
}

#[test]
fn a_black_image_has_no_keypoints_and_no_matches() {
    let model = load(separate(1, 64, "per_keypoint", MatchForm::PerKeypoint)).expect("the contract holds");
    let found = compare(&model, 0.0);
    assert_eq!(found, KeypointMatches::default());
}

#[test]
fn two_images_in_one_batch() {
    let result = output("matches", "mscores", MatchForm::PairsInBatch);
    let model = load(whole("pipeline.onnx", 3, &["images"], &["keypoints"], result)).expect("the contract holds");
    let found = compare(&model, 1.0);
    // Keypoints that fail the test are dropped afterwards: such networks choose their keypoints themselves.
    assert_eq!(found.matches.iter().map(|&(i, j, _)| (i, j)).collect::<Vec<_>>(), [(1, 1), (3, 3)]);
}

#[test]
fn two_images_by_name() {
    let result = output("matches0", "mscores0", MatchForm::Pairs);
    let manifest = whole("end_to_end.onnx", 1, &["image0", "image1"], &["kpts0", "kpts1"], result);
    let found = compare(&load(manifest).expect("the contract holds"), 1.0);
    assert_eq!(found.matches.len(), 2);
}

#[test]
fn networks_that_do_not_fit_are_refused_in_a_sentence() {
    let mut wide = separate(1, 64, "per_keypoint", MatchForm::PerKeypoint);
    if let Networks::Separate { extractor, .. } = &mut wide.networks {
        extractor.descriptor_width = 128;
    }
    let colour = separate(3, 64, "per_keypoint", MatchForm::PerKeypoint);
    let mut named = separate(1, 64, "per_keypoint", MatchForm::PerKeypoint);
    if let Networks::Separate { matcher, .. } = &mut named.networks {
        matcher.result.matches = "matches".into();
    }
    let form = separate(1, 64, "pairs", MatchForm::PairsInBatch);
    for (manifest, says) in [
        (wide, "its output 'descriptors' is [1, 4, 64], expected [.., any, 128]"),
        (colour, "its input 'image' is [1, 1, any, any], expected [.., 3, any, any]"),
        (named, "it has no output 'matches', only matches0, mscores0"),
        (form, "its output 'matches0' is [any, 2], expected [.., any, 3]"),
    ] {
        let error = load(manifest).err().expect("refused").to_string();
        assert!(error.ends_with(says), "{error}");
    }
}

#[test]
fn bytes_of_no_network_are_an_error() {
    let error = load_rten("noise.onnx", &[7; 100]).err().expect("refused");
    assert!(matches!(error, NetworkError::Load { .. }), "{error}");
}
