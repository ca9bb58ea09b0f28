//! `vergence image keygen`.

use std::path::PathBuf;

use serde_json::json;

use crate::console::Console;
use crate::failure::Failure;
use crate::firmware::{fresh_secret, hex};

#[derive(Debug, clap::Args)]
pub struct Args {
    /// Where the secret key goes; a file that exists is never written over.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let secret = fresh_secret()?;
    let mut name = args.out.clone().into_os_string();
    name.push(".pub");
    let public_file = PathBuf::from(name);
    secret.write_new(&args.out)?;
    secret.public().write(&public_file)?;
    console.say(format!(
        "secret key {}: keep it to yourself\npublic key {}: what boards trust",
        args.out.display(),
        public_file.display()
    ))?;
    console.result(&json!({
        "secret": args.out, "public": public_file, "public_key": hex(&secret.public().0),
    }))
}
