//! `vergence calibrate diff`: two calibrations of one camera.

use std::path::PathBuf;

use serde_json::json;
use vergence_calibration::LensDifference;
use vergence_vision::Angle;

use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file::read_lens;

/// Compares the rays of two camera files over the image. The rotation that fits them best is removed first: it is a
/// difference of pose, not of the lens.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// One camera file.
    a: PathBuf,
    /// The other.
    b: PathBuf,
    /// Compare up to this angle from the optical axis; without it, wherever both cameras are valid.
    #[arg(long)]
    field: Option<Angle>,
    /// Fail if any ray differs by more than this angle.
    #[arg(long)]
    limit: Option<Angle>,
}

pub fn run(args: &Args, console: Console) -> Result<(), Failure> {
    let (a, b) = (read_lens(&args.a, console)?, read_lens(&args.b, console)?);
    let LensDifference { median, p95, worst, turn, places } = LensDifference::between(&a, &b, args.field)?;
    let [median, p95, worst, turned] = [median, p95, worst, turn].map(Angle::deg);
    console.say(format!(
        "rays differ by {median:.4}° (median), {p95:.4}° (95 %), {worst:.4}° (worst) at {places} places, after a turn of \
         {turned:.4}°"
    ))?;
    console.result(&json!({
        "median_deg": median, "p95_deg": p95, "worst_deg": worst, "rotation_deg": turned, "rays": places,
    }))?;
    match args.limit {
        Some(limit) if worst > limit.deg() => Err(Failure::check(format!("the rays differ by more than {limit:.4}"))),
        _ => Ok(()),
    }
}
