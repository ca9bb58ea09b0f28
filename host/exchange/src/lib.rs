//! Camera and rig files of other programs: text in, cameras out, and back.
//!
//! [`Recognised::of`] names the format of a text, [`read`] makes a [`ForeignRig`] of it: cameras with their models, and where they are if the
//! file says so. [`ForeignCamera::lens`] gives the lens that this program computes with; [`ForeignRig::pair`] two
//! cameras with `left_from_right`. [`write()`] prints a camera or a pair in another program's format.
//!
//! What is understood only in part is refused with the reason. A model is taken from what the file states, never from what would fit.

mod basalt;
mod colmap;
mod error;
mod euroc;
mod format;
mod kalibr;
mod mrcal;
mod node;
mod ocam;
mod opencv;
mod orb_slam;
mod pose;
mod real_sense;
mod rig;
mod ros;
mod write;

pub use self::error::ExchangeError;
pub use self::format::{Format, Recognised};
pub use self::rig::{ForeignCamera, ForeignPair, ForeignRig};
pub use self::write::{
    Cameras, FileName, OursOrTheirs, Sensor, UnknownFormat, WriteFormat, Written, WrittenFile, write,
};

/// Reads the cameras of a file of another program.
///
/// # Errors
/// [`ExchangeError`] says what the file is, and what is wrong with it or not understood.
pub fn read(text: &str) -> Result<ForeignRig, ExchangeError> {
    match Recognised::of(text) {
        Recognised::Foreign(format) => read_as(format, text),
        Recognised::Unread { what, advice } => Err(ExchangeError::Unread { what, advice }),
        Recognised::Ours | Recognised::Unknown => Err(ExchangeError::Unknown),
    }
}

fn read_as(format: Format, text: &str) -> Result<ForeignRig, ExchangeError> {
    let cameras = match format {
        Format::OpenCv => opencv::read(text),
        Format::Kalibr => kalibr::read(text),
        Format::Basalt => basalt::read(text),
        Format::Euroc => euroc::read(text),
        Format::Ros => ros::read(text),
        Format::Mrcal => mrcal::read(text),
        Format::Colmap => colmap::read(text),
        Format::OrbSlam => orb_slam::read(text),
        Format::OCam => ocam::read(text),
        Format::RealSense => real_sense::read(text),
    }?;
    Ok(ForeignRig { format, cameras })
}
