//! What the search finds in an image. It is the slowest part of the detection and needs no camera, so that who looks twice, the second time with a camera,
//! keeps it.

use std::sync::OnceLock;

use image::GrayImage;

use super::intensity::Intensity;
use super::lattice::Lattice;
use super::search::{labelled_patches, labelled_patches_of_half};
use super::tags::{Quad, dark_quads};

/// What the search finds in one image. Each part is searched for when a target first asks for it, and kept: an image is searched once, however often it is
/// looked at. It belongs to that image alone.
#[derive(Clone, Debug, Default)]
pub struct SearchedImage {
    patches: OnceLock<Vec<Lattice>>,
    patches_of_half: OnceLock<Vec<Lattice>>,
    quads: OnceLock<Vec<Quad>>,
}

impl SearchedImage {
    /// The corners that the search labels, patch by patch, the largest first.
    pub(super) fn patches(&self, image: &GrayImage) -> &[Lattice] {
        self.patches.get_or_init(|| labelled_patches(image))
    }

    /// The same in an image of half the size.
    pub(super) fn patches_of_half(&self, image: &GrayImage) -> &[Lattice] {
        self.patches_of_half.get_or_init(|| labelled_patches_of_half(image))
    }

    /// All dark quads, which may be tags.
    pub(super) fn quads(&self, image: &GrayImage, intensity: &Intensity<'_>) -> &[Quad] {
        self.quads.get_or_init(|| dark_quads(image, intensity))
    }
}
