//! `vergence plan`: a move before it is made, and the pose that measures as asked.

mod goal;
mod trunk;

use serde_json::json;
use vergence_board::{Board, MovePlan, MoveStart, check_range};
use vergence_pipeline::{ZONE_RADIUS, rig_zones};
use vergence_rig::{AxisPosition, Rig, axes_json, rounded, zones_json};

use super::connect::connect;
use super::search_options::FieldOption;
use super::stage_pose::{StagePose, named_mode};
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file;

/// Plans a move with the board's own planner and limits, and moves nothing. It begins where the stages stand, or at the
/// low ends of their ranges, where homing leaves them. Without --port it plans for the stages of 'vergence sim'. For a rig
/// with a trunk it finds a path on which the loop of links closes and nothing touches, from the mode of --from.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The mode to go to, such as herbivore.
    #[arg(required_unless_present_any = ["baseline", "separation", "goal"], conflicts_with_all = ["baseline", "separation"])]
    mode: Option<String>,
    #[command(flatten)]
    stage: StagePose,
    /// The mode to begin at.
    #[arg(long, value_name = "MODE")]
    from: Option<String>,
    /// Prints every segment: time, position, velocity, acceleration, jerk. Of a trunk, the shapes along the path.
    #[arg(long)]
    dump: bool,
    #[command(flatten)]
    field: FieldOption,
    #[command(flatten)]
    trunk: trunk::TrunkOptions,
    #[command(flatten)]
    goal: goal::GoalOptions,
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    if args.goal.is_given() {
        return goal::run(&args.goal, args.field, common, console);
    }
    let rig = args.field.seeing(rig_file::load(common.rig.as_deref())?);
    if let Some(trunk) = &rig.trunk {
        return trunk::run(args, &rig, trunk, console);
    }
    let common = CommonOptions { port: common.port.clone().or_else(|| Some("sim".into())), ..common.clone() };
    let board = connect(&common, console, "planning").await?;
    let from = match &args.from {
        Some(name) => named_mode(&rig, name)?.targets.clone(),
        None => standing(&board),
    };
    let to = target(args, &rig, &from)?;
    check_range(&rig, &to)?;
    // The verbs that move arm the board anew.
    let start = MoveStart { positions: &from, from_below: false };
    let plan = MovePlan::new(&rig, &board.limits().await?, start, &to);
    let values: Vec<f64> = to.iter().map(|position| position.value()).collect();
    let zones = rig_zones(&rig, &rig.pose_at_values(&values))
        .map_err(|error| Failure::check(format!("the zones of this pose: {error}")))?;
    let wide = rig.axes.iter().map(|axis| axis.name.len()).max().unwrap_or(0);
    for (axis, planned) in rig.axes.iter().zip(&plan.axes) {
        let peak = AxisPosition::from_value(axis.kind, planned.peak_speed());
        let way = match planned.knots.is_empty() {
            true => format!("stays at {}", planned.to),
            false => format!("{} -> {}, at most {peak}/s", planned.from, planned.to),
        };
        console.say(format!("{:wide$}  {way}", axis.name))?;
    }
    console.say(format!("takes {:.3} s within the limits of {}", plan.duration, board.info().board))?;
    console.say(format!(
        "then sees stereo {:.1}, mono {:.1}, blind {:.1} on a circle of {ZONE_RADIUS:.0}",
        zones.stereo, zones.mono, zones.blind
    ))?;
    if args.dump {
        for (axis, planned) in rig.axes.iter().zip(&plan.axes) {
            console.say(planned.table(axis))?;
        }
    }
    console.result(&json!({
        "duration_s": rounded(plan.duration),
        "from": axes_json(&rig, &from),
        "to": axes_json(&rig, &to),
        "zones_deg": zones_json(&zones),
        "axes": rig.axes.iter().zip(&plan.axes).map(|(axis, planned)| planned.json(axis)).collect::<Vec<_>>(),
    }))
}

fn standing(board: &Board) -> Vec<AxisPosition> {
    let rig = board.rig();
    if board.is_referenced() {
        return board.standing();
    }
    rig.axes.iter().map(|axis| axis.range[0]).collect()
}

fn target(args: &Args, rig: &Rig, from: &[AxisPosition]) -> Result<Vec<AxisPosition>, Failure> {
    if let Some(name) = &args.mode {
        return Ok(named_mode(rig, name)?.targets.clone());
    }
    let named = args.stage.of_axes(rig)?;
    Ok(named.iter().zip(from).map(|(named, &from)| named.unwrap_or(from)).collect())
}
