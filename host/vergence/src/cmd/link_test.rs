//! `vergence link-test`: how good the link is.

use std::time::Duration;

use serde_json::json;
use vergence_board::{LinkFigures, clock_json, describe_clock};
use vergence_protocol::Request;
use vergence_rig::rounded;

use super::connect::{connect, is_wire};
use crate::cli::Globals;
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

pub async fn run(args: &Args, globals: &Globals, console: Console) -> Result<(), Failure> {
    let period_us = u32::try_from(args.stream.as_micros()).unwrap_or(u32::MAX);
    let mut board = connect(globals, console, "measuring the link").await?;
    board.ask(Request::SetStream { period_us }).await?;
    let figures = LinkFigures::measure(&mut board, args.duration).await?;
    let floor = figures.wire_floor_ms(globals.baud);
    let is_wire = is_wire(globals);
    let percentile = |share| figures.percentile(share).unwrap_or(f64::NAN);
    let [request, answer] = figures.bytes;
    let answered = figures.round_trips_ms.len();
    let host = &figures.host;

    console.say(format!(
        "requests    {answered} answered, {} unanswered, {} frames sent again",
        figures.unanswered, host.retransmitted
    ))?;
    console.say(format!(
        "round trip  median {:.3} ms, 95 % {:.3} ms, 99 % {:.3} ms, longest {:.3} ms",
        percentile(0.5),
        percentile(0.95),
        percentile(0.99),
        percentile(1.0)
    ))?;
    console.say(format!(
        "wire floor  {floor:.3} ms: {request} + {answer} bytes of 10 bits at {} baud{}",
        globals.baud,
        if is_wire { "" } else { "; this port is no wire, its bytes take no time" }
    ))?;
    console.say(format!("poses       {} received, {} lost", host.poses, host.poses_lost))?;
    console.say(format!("host heard  {} frames, dropped {}", host.link.frames, host.link.dropped()))?;
    console.say(match &figures.board {
        Some(board) => format!(
            "board heard {} frames, dropped {}, {} twice, {} after a gap; replaced {} poses unsent (since its start)",
            board.link.frames,
            board.link.dropped(),
            board.duplicates,
            board.gaps,
            board.poses_replaced
        ),
        None => "board heard unknown: this firmware keeps no counts".into(),
    })?;
    console.say(format!("            {}", describe_clock(&board)))?;
    console.result(&json!({
        "requests": answered + figures.unanswered as usize,
        "unanswered": figures.unanswered,
        "retransmitted": host.retransmitted,
        "round_trip_ms": {
            "median": rounded(percentile(0.5)), "p95": rounded(percentile(0.95)),
            "p99": rounded(percentile(0.99)), "max": rounded(percentile(1.0)),
        },
        "wire_floor_ms": rounded(floor),
        "is_wire": is_wire,
        "poses": host.poses,
        "poses_lost": host.poses_lost,
        "host": host.link,
        "board": figures.board,
        "clock": clock_json(&board),
    }))?;
    if figures.unanswered > 0 || host.poses_lost > 0 {
        return Err(Failure::check(format!(
            "the link lost {} requests and {} poses: check cable, baud rate and what else uses the processor",
            figures.unanswered, host.poses_lost
        )));
    }
    Ok(())
}
