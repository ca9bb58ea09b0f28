//! `vergence link-test`: how good the link is.

use std::time::Duration;

use vergence_board::{LinkFigures, clock_json, describe_clock};
use vergence_protocol::Request;

use super::connect::{connect, is_wire};
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;

/// Sends two hundred requests each second while poses stream, and prints how long answers took beside what the wire allows,
/// and what was lost or sent again. Moves nothing. Exit code 1 where requests stayed unanswered or poses were lost.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Ask for this long, 1s to 1h.
    #[arg(long = "for", default_value = "5s", value_name = "TIME", value_parser = parse_time, alias = "seconds")]
    duration: Duration,
    /// Period of the pose stream during the test, from 1ms.
    #[arg(long, default_value = "2ms", value_parser = humantime::parse_duration, value_name = "TIME")]
    stream: Duration,
}

/// A time from 1s to 1h; a bare number is seconds.
fn parse_time(text: &str) -> Result<Duration, String> {
    let whole = text.parse().ok().map(Duration::from_secs);
    let time = whole.map_or_else(|| humantime::parse_duration(text).map_err(|error| error.to_string()), Ok)?;
    let allowed = Duration::from_secs(1)..=Duration::from_secs(3600);
    if allowed.contains(&time) { Ok(time) } else { Err("choose 1s to 1h".into()) }
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let period_us = u32::try_from(args.stream.as_micros()).unwrap_or(u32::MAX);
    let mut board = connect(common, console, "measuring the link").await?;
    board.ask(Request::SetStream { period_us }).await?;
    let figures = LinkFigures::measure(&mut board, args.duration).await?;
    let is_wire = is_wire(common);
    console.say_lines(figures.lines(common.baud, is_wire))?;
    console.say(format!("            {}", describe_clock(&board)))?;
    let mut result = figures.json(common.baud, is_wire);
    result["clock"] = clock_json(&board);
    console.result(&result)?;
    figures.check().map_err(|losses| Failure::check(losses.to_string()))
}
