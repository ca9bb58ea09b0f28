//! `vergence trigger`: fires the cameras and shows where the axes were at each pulse.

use std::time::Duration;

use tokio::time::timeout;
use vergence_board::{Board, mark_json, mark_line};
use vergence_protocol::{Request, Trigger};

use super::camera_options::parse_rate;
use super::connect::connect;
use crate::cli::CommonOptions;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::interrupted;

/// Fires both cameras once or at a rate, until Ctrl-C. The board latches the encoders at the edge of each pulse and sends
/// them with its time: this prints them. Needs no arming.
#[derive(Debug, clap::Args)]
#[command(group = clap::ArgGroup::new("when").required(true))]
pub struct Args {
    /// One pulse.
    #[arg(long, group = "when")]
    once: bool,
    /// So many pulses each second, 0.1 to 500.
    #[arg(long, group = "when", value_name = "HZ", value_parser = parse_rate)]
    rate: Option<f64>,
    /// Stop after this many pulses.
    #[arg(long, requires = "rate")]
    count: Option<u64>,
    /// Stop after this time.
    #[arg(long = "for", requires = "rate", value_name = "TIME", value_parser = humantime::parse_duration)]
    duration: Option<Duration>,
}

pub async fn run(args: &Args, common: &CommonOptions, console: Console) -> Result<(), Failure> {
    let mut board = connect(common, console, "trigger").await?;
    board.compare_clocks().await?;
    let trigger = match args.rate {
        Some(rate) => Trigger::Every { period_us: (1e6 / rate).round() as u32 },
        None => Trigger::Once,
    };
    let pulses = if args.once { Some(1) } else { args.count };
    board.ask(Request::SetTrigger(trigger)).await?;
    let mut received = Received::default();
    let forever = Duration::from_secs(u64::from(u32::MAX));
    let ended = tokio::select! {
        ended = timeout(args.duration.unwrap_or(forever), listen(&mut board, pulses, &mut received, console)) => {
            ended.unwrap_or(Ok(()))
        }
        () = interrupted() => Ok(()),
    };
    ended?;
    board.ask(Request::SetTrigger(Trigger::Off)).await?;
    console.say(format!("{} pulses, {} of their marks were lost", received.marks, received.lost))
}

/// How many marks came, and how many their numbers say are missing.
#[derive(Debug, Default)]
struct Received {
    marks: u64,
    lost: u64,
    next: u32,
}

async fn listen(
    board: &mut Board,
    pulses: Option<u64>,
    received: &mut Received,
    console: Console,
) -> Result<(), Failure> {
    while pulses.is_none_or(|pulses| received.marks + received.lost < pulses) {
        let mark = board.next_mark().await?;
        received.lost += u64::from(mark.seq.wrapping_sub(received.next));
        received.marks += 1;
        received.next = mark.seq.wrapping_add(1);
        console.say(mark_line(board.rig(), &mark))?;
        console.result(&mark_json(board, &mark))?;
    }
    Ok(())
}
