//! `vergence calibrate stage` of a rig with a folding trunk.

use vergence_calibration::{StageOptions, StagePose, calibrate_trunk, check_fit, validate_trunk};
use vergence_calibration_input::InputHash;
use vergence_calibration_report::{
    LeftOut, ReportAbout, left_out_json, trunk_json, trunk_lines, trunk_report, trunk_verdict,
};
use vergence_rig::Rig;

use super::{Args, no_calibration};
use crate::console::Console;
use crate::failure::Failure;
use crate::stopwatch::Stopwatch;

/// What a trunk is calibrated from.
pub struct Input<'a> {
    /// The rig as designed, with the lenses known.
    pub drawn: &'a Rig,
    /// The views at several shapes.
    pub poses: &'a [StagePose],
    /// The views left out.
    pub left_out: Vec<LeftOut>,
    /// What is known of the lenses, and whether outliers are left out.
    pub options: &'a StageOptions,
}

/// Calibrates the trunk, writes the rig file and the report, and prints the result.
///
/// # Errors
/// No calibration, one that fits badly, or a file that cannot be written.
pub fn run(args: &Args, input: Input<'_>, hash: InputHash, console: Console) -> Result<(), Failure> {
    let Input { drawn, poses, left_out, options } = input;
    let solving = Stopwatch::start();
    let trunk = calibrate_trunk(drawn, poses, options).map_err(|error| no_calibration(&error))?;
    let seconds = solving.seconds();
    check_fit(trunk.rms_inlier_px, trunk.corners_inlier, trunk.corners_total)?;
    let held_out = match args.holdout {
        true => validate_trunk(drawn, poses, options)
            .map_err(|error| Failure::check(format!("without one stage pose there is no calibration: {error}")))?,
        false => Vec::new(),
    };
    let rig = Rig { name: args.result.name(&drawn.name), masks: args.masks.kept(drawn), ..trunk.rig(drawn) };
    let verdict = trunk_verdict(&rig, &args.verdict);
    let provenance = args.result.provenance(hash);
    args.result.write(&rig.to_toml(&provenance).map_err(Failure::check)?, || {
        let about = ReportAbout::new(rig.name.clone(), args.target.spec().ok().as_ref(), &provenance, None);
        trunk_report(&trunk, &rig, &held_out, &about.of_rig(&args.verdict, &left_out))
    })?;
    console.say_lines(trunk_lines(&trunk, &held_out))?;
    console.say_lines(verdict.lines())?;
    let mut result = trunk_json(&rig, &trunk, &held_out);
    result["seconds"] = seconds.into();
    result["verdict"] = verdict.json();
    result["left_out"] = left_out_json(&left_out);
    console.result(&result)
}
