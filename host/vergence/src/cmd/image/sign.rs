//! `vergence image sign`.

use std::path::PathBuf;

use vergence_image::notes::version_of;
use vergence_image::sha256;
use vergence_protocol::management::ImageHeader;

use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::{
    Hardware, SecretKey, build_of, flatten, hardware_name, header_json, parse_version, version_text,
};
use crate::output::write_whole;

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The application: an ELF file, or the raw bytes for flash.
    file: PathBuf,
    /// The secret key: a file of 'image keygen', or 'development' for the one that everybody knows.
    #[arg(long, value_name = "FILE")]
    key: PathBuf,
    /// Its version, such as 1.2.3, where the application does not say which it is; where it does, it must be this one.
    #[arg(long, value_parser = parse_version)]
    version: Option<[u8; 3]>,
    /// The board it is for.
    #[arg(long)]
    hardware: Hardware,
    /// Where the image goes.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let key = SecretKey::named(&args.key)?;
    let file = std::fs::read(&args.file).map_err(|error| Failure::input(&args.file, error))?;
    let image = flatten(&file, args.hardware).map_err(|problem| Failure::input(&args.file, problem))?;
    let header = ImageHeader {
        hardware: args.hardware.id(),
        version: version(args, version_of(&image))?,
        length: image.len() as u32,
        build: build_of(&image),
        sha256: sha256(&image),
    };
    write_whole(&args.out, &[&key.seal(header).to_bytes()[..], &image].concat())?;
    console.say(format!(
        "{}: version {} for {}, {} bytes, build {:016x}",
        args.out.display(),
        version_text(header.version),
        hardware_name(header.hardware),
        header.length,
        header.build
    ))?;
    console.result(&header_json(&header))
}

/// A header that named another version than the application itself would let the board take what it must refuse.
fn version(args: &Args, said: Option<[u8; 3]>) -> Result<[u8; 3], Failure> {
    match (args.version, said) {
        (Some(named), Some(said)) if named != said => Err(Failure::input(
            &args.file,
            format!("the application says that it is version {}, not {}", version_text(said), version_text(named)),
        )),
        (named, said) => said.or(named).ok_or_else(|| {
            Failure::input(&args.file, "the application does not say which version it is: name it with --version")
        }),
    }
}
