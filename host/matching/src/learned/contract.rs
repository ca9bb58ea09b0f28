//! The check of a network against its manifest: the names and shapes of its tensors.

use super::manifest::{Extractor, Glue, ImageInput, MatchForm, MatchOutput, Pipeline};
use super::network::{Network, NetworkError, Outlet};

/// A network's tensors, to be checked against its manifest.
struct Contract<'a> {
    network: &'a str,
    inputs: &'a [Outlet],
    outputs: &'a [Outlet],
}

/// The required last dimensions of a tensor; `None` accepts any extent.
type Tail<'a> = &'a [Option<usize>];

pub(super) fn check_extractor(
    extractor: &Extractor,
    image: &ImageInput,
    network: &dyn Network,
) -> Result<(), NetworkError> {
    let contract = Contract::of(&extractor.file, network);
    contract.input(&extractor.image, &[Some(image.channels), None, None])?;
    contract.output(&extractor.keypoints, &[None, Some(2)])?;
    contract.output(&extractor.descriptors, &[None, Some(extractor.descriptor_width)])?;
    contract.output(&extractor.scores, &[None])
}

pub(super) fn check_glue(glue: &Glue, width: usize, network: &dyn Network) -> Result<(), NetworkError> {
    let contract = Contract::of(&glue.file, network);
    for name in &glue.keypoints {
        contract.input(name, &[None, Some(2)])?;
    }
    for name in &glue.descriptors {
        contract.input(name, &[None, Some(width)])?;
    }
    contract.matches(&glue.result)
}

pub(super) fn check_pipeline(
    pipeline: &Pipeline,
    image: &ImageInput,
    network: &dyn Network,
) -> Result<(), NetworkError> {
    let contract = Contract::of(&pipeline.file, network);
    for names in [&pipeline.images, &pipeline.keypoints] {
        if names.is_empty() || names.len() > 2 {
            return contract.refuse("it needs one name for both images, or two".into());
        }
    }
    for name in &pipeline.images {
        contract.input(name, &[Some(image.channels), None, None])?;
    }
    for name in &pipeline.keypoints {
        contract.output(name, &[None, Some(2)])?;
    }
    contract.matches(&pipeline.result)
}

impl<'a> Contract<'a> {
    fn of(network: &'a str, loaded: &'a dyn Network) -> Self {
        let signature = loaded.signature();
        Self { network, inputs: &signature.inputs, outputs: &signature.outputs }
    }

    fn input(&self, name: &str, tail: Tail<'_>) -> Result<(), NetworkError> {
        self.fits("input", self.inputs, name, tail)
    }

    fn output(&self, name: &str, tail: Tail<'_>) -> Result<(), NetworkError> {
        self.fits("output", self.outputs, name, tail)
    }

    fn matches(&self, result: &MatchOutput) -> Result<(), NetworkError> {
        self.output(&result.scores, &[None])?;
        match result.form {
            MatchForm::PerKeypoint => self.output(&result.matches, &[None]),
            MatchForm::Pairs => self.output(&result.matches, &[None, Some(2)]),
            MatchForm::PairsInBatch => self.output(&result.matches, &[None, Some(3)]),
        }
    }

    fn fits(&self, side: &str, outlets: &[Outlet], name: &str, tail: Tail<'_>) -> Result<(), NetworkError> {
        let Some(outlet) = outlets.iter().find(|outlet| outlet.name == name) else {
            let names: Vec<&str> = outlets.iter().map(|outlet| outlet.name.as_str()).collect();
            return self.refuse(format!("it has no {side} '{name}', only {}", names.join(", ")));
        };
        // A file need not state its shapes; the tensors are then checked when the network runs.
        let Some(shape) = &outlet.shape else { return Ok(()) };
        let fits = shape.len() >= tail.len()
            && shape.iter().rev().zip(tail.iter().rev()).all(|(has, wants)| match (has, wants) {
                (Some(has), Some(wants)) => has == wants,
                _ => true,
            });
        if fits {
            return Ok(());
        }
        self.refuse(format!("its {side} '{name}' is {}, expected [.., {}]", dimensions(shape), inner(tail)))
    }

    fn refuse(&self, reason: String) -> Result<(), NetworkError> {
        Err(NetworkError::Contract { network: self.network.into(), reason })
    }
}

fn dimensions(shape: &[Option<usize>]) -> String {
    format!("[{}]", inner(shape))
}

fn inner(shape: &[Option<usize>]) -> String {
    let text: Vec<String> = shape.iter().map(|extent| extent.map_or("any".into(), |n| n.to_string())).collect();
    text.join(", ")
}
