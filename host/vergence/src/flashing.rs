//! What `vergence flash --serial` does, for a board at any wire.

pub use crate::cmd::flash::update;
pub use crate::console::Console;
pub use crate::firmware::OwnedImage;
