//! What a camera of the live loop tells.

use image::RgbImage;
use vergence_rig::HostInstant;
use vergence_vision::Side;

use crate::camera::FrameTiming;
use crate::failure::Failure;

/// A picture that is made when somebody wants to see it: decoding or rendering one that is dropped would be in vain.
pub type Picture = Box<dyn FnOnce() -> Result<RgbImage, Failure> + Send>;

/// A frame whose picture may still be made.
pub struct LiveFrame {
    /// The camera's own number of it, lost ones counted.
    pub seq: u32,
    /// The middle of the exposure of the middle row.
    pub middle: HostInstant,
    /// The picture.
    pub picture: Picture,
}

/// What happens to a camera.
pub enum News {
    /// It is there, or there again, and takes its frames like this.
    There(FrameTiming),
    /// It gave a frame.
    Frame(LiveFrame),
    /// It is dead, and why.
    Dead(String),
}

/// Of which camera.
pub struct Heard {
    /// Which.
    pub side: Side,
    /// What.
    pub news: News,
}
