//! `vergence image info`.

use std::path::{Path, PathBuf};

use vergence_image::is_signed_by;

use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::{DEVELOPMENT, OwnedImage, PublicKey, hardware_name, header_json, hex, version_text};

#[derive(Debug, clap::Args)]
pub struct Args {
    /// The image.
    file: PathBuf,
    /// The public key that should have signed it; without one, the development key, whose secret everybody knows.
    #[arg(long, value_name = "FILE", default_value = DEVELOPMENT)]
    key: PathBuf,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let PublicKey(key) = PublicKey::named(&args.key)?;
    let image = OwnedImage::read(&args.file)?;
    let header = image.header();
    let is_valid = is_signed_by(&key, &header.signed_bytes(), &image.seal.signature);
    console.say(format!("hardware   {}", hardware_name(header.hardware)))?;
    console.say(format!("version    {}", version_text(header.version)))?;
    console.say(format!("length     {} bytes", header.length))?;
    console.say(format!("build      {:016x}", header.build))?;
    console.say(format!("sha256     {}", hex(&header.sha256)))?;
    console.say(format!("signature  {}", judgement(is_valid, &args.key)))?;
    let mut said = header_json(header);
    said["key"] = hex(&key).into();
    said["signature_valid"] = is_valid.into();
    console.result(&said)?;
    if is_valid {
        return Ok(());
    }
    Err(Failure::check(format!("{}: not signed by the key {}", args.file.display(), args.key.display())))
}

fn judgement(is_valid: bool, key: &Path) -> String {
    match (is_valid, key.as_os_str() == DEVELOPMENT) {
        (true, true) => "valid, by the development key: anybody can sign so".into(),
        (true, false) => format!("valid, by {}", key.display()),
        (false, _) => "not valid; another key is named with --key FILE.pub".into(),
    }
}
