//! `vergence plan --goal`: the pose that measures depth as well as asked and sees the most.

use std::path::PathBuf;

use vergence_files::write_whole;
use vergence_output::{check_ending, depth_field_svg};
use vergence_rig::{DepthField, DepthGoal};

use crate::cli::CommonOptions;
use crate::cmd::search_options::FieldOption;
use crate::console::Console;
use crate::failure::Failure;
use crate::rig_file;

/// The required accuracy of depth.
#[derive(Debug, clap::Args)]
pub struct GoalOptions {
    /// The largest standard deviation of the forward coordinate (sigma_z) or the distance (sigma_range), at a distance from
    /// the middle of the cameras, over the horizontal directions to both sides of forward:
    /// "sigma_z <= 1mm at 350mm over +-40deg".
    #[arg(long, value_name = "GOAL", conflicts_with_all = ["mode", "baseline", "separation", "from", "dump"])]
    goal: Option<DepthGoal>,
    /// Standard deviation of matched positions, in pixels.
    #[arg(long, value_name = "PIXELS", default_value_t = 0.1, requires = "goal", value_parser = positive)]
    pixel_sigma: f64,
    /// Draws the predicted standard deviation over directions and distances to this file, as SVG.
    #[arg(long, value_name = "FILE", requires = "goal")]
    depth_field: Option<PathBuf>,
}

impl GoalOptions {
    /// Whether a goal was named.
    pub fn is_given(&self) -> bool {
        self.goal.is_some()
    }
}

fn positive(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("'{text}' is not a number"))?;
    if value > 0.0 && value.is_finite() { Ok(value) } else { Err(format!("{text} is not positive")) }
}

/// Finds the pose for the goal and prints it.
///
/// # Errors
/// Exit code 1 where no pose meets the goal; the nearest pose is printed.
pub fn run(options: &GoalOptions, field: FieldOption, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let goal = options.goal.ok_or_else(|| Failure::usage("say a --goal"))?;
    let rig = field.seeing(rig_file::load(common.rig.as_deref())?);
    let best = rig.best_pose(&goal, options.pixel_sigma);
    let positions = best.positions(&rig);
    let place: Vec<_> =
        rig.axes.iter().zip(&positions).map(|(axis, position)| format!("{} {position}", axis.name)).collect();
    if let Some(path) = &options.depth_field {
        check_ending(path, &["svg"])?;
        let field = DepthField::new(&rig, &best.values, options.pixel_sigma);
        let title = format!("Predicted depth error at {}", place.join(", "));
        write_whole(path, depth_field_svg(&title, &field, goal.range * 3.0).as_bytes())?;
    }
    let sigma = match best.worst {
        Some(worst) => format!("at most {worst:.4} over the asked directions"),
        None => "but not every asked direction is seen by both cameras".to_owned(),
    };
    console.say(format!("{goal}, for matches good to {} px:", options.pixel_sigma))?;
    console.say(format!("{}: {sigma}", place.join(", ")))?;
    console
        .say(format!("sees {:.1} of the circle of {:.0}, {:.1} of it with both", best.seen, goal.range, best.stereo))?;
    console.result(&best.json(&rig))?;
    if best.meets_goal() {
        return Ok(());
    }
    Err(Failure::check(format!("no pose of rig '{}' meets {goal}: this one comes nearest", rig.name)))
}
