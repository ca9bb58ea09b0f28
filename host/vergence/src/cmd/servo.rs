//! `vergence servo`: makes the servos of a robot ready, over a USB adapter on their bus.

use serde_json::json;
use vergence_board::servos::{
    FoundServo, ServoError, ServoPort, Swing, examine, scan, scan_at, set_baud, set_id, swing,
};
use vergence_dynamixel::Id;
use vergence_dynamixel::units::Baud;

use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::on_own_thread;

/// Finds servos of the X series (DYNAMIXEL Protocol 2.0), gives them numbers and a speed, and tests them, over a USB adapter on
/// their bus. The board must not drive the bus meanwhile. See the chapter on the robot's bus in docs/guide.md.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(Debug, clap::Subcommand)]
enum Task {
    /// Lists the servos that answer, at all speeds or at one. Exit code 1 where answers are garbled, as by two servos with one number.
    Scan(Scan),
    /// Gives a servo another number. Refused where the new one is taken, answers are garbled, or torque is on.
    SetId(SetId),
    /// Gives a servo another speed of the line. Refused while torque is on.
    SetBaud(SetBaud),
    /// Asks a servo how it is, and measures the round trip. Moves nothing without --move. Exit code 1 where it is not well.
    Test(Test),
}

#[derive(Clone, Debug, clap::Args)]
struct Adapter {
    /// The USB adapter on the servos' bus, such as /dev/ttyUSB0.
    #[arg(long, value_name = "PORT")]
    adapter: String,
}

#[derive(Clone, Debug, clap::Args)]
struct Line {
    #[command(flatten)]
    adapter: Adapter,
    /// Speed of the servo's line in bits per second; 57600 as from the factory.
    #[arg(long, value_name = "BAUD", default_value = "1000000", value_parser = parse_baud)]
    baud: Baud,
}

#[derive(Clone, Debug, clap::Args)]
struct Scan {
    #[command(flatten)]
    adapter: Adapter,
    /// Look at this speed alone.
    #[arg(long, value_name = "BAUD", value_parser = parse_baud)]
    baud: Option<Baud>,
}

#[derive(Clone, Debug, clap::Args)]
struct SetId {
    /// Its number now; 1 as from the factory.
    #[arg(value_parser = parse_id)]
    from: Id,
    /// Its number from now on; Origaker's are 13 to 17.
    #[arg(value_parser = parse_id)]
    to: Id,
    #[command(flatten)]
    line: Line,
}

#[derive(Clone, Debug, clap::Args)]
struct SetBaud {
    /// Its number.
    #[arg(value_parser = parse_id)]
    id: Id,
    /// Its speed from now on, in bits per second; the board's is 1000000 as delivered.
    #[arg(value_parser = parse_baud)]
    to: Baud,
    #[command(flatten)]
    line: Line,
}

#[derive(Clone, Debug, clap::Args)]
struct Test {
    /// Its number.
    #[arg(value_parser = parse_id)]
    id: Id,
    #[command(flatten)]
    line: Line,
    /// Turns it by five degrees and back, slowly.
    #[arg(long = "move")]
    moves: bool,
}

fn parse_id(text: &str) -> Result<Id, String> {
    let number: u16 = text.parse().map_err(|_| format!("'{text}' is no number"))?;
    let id = u8::try_from(number).ok().and_then(|number| Id::servo(number).ok());
    id.ok_or_else(|| ServoError::NoId(number).to_string())
}

fn parse_baud(text: &str) -> Result<Baud, String> {
    let bits: u32 = text.parse().map_err(|_| format!("'{text}' is no number"))?;
    let baud = Baud::ALL.into_iter().find(|baud| baud.bits_per_second() == bits);
    baud.ok_or_else(|| ServoError::NoBaud(bits).to_string())
}

pub async fn run(args: Args, console: Console) -> Result<(), Failure> {
    on_own_thread(move || match args.task {
        Task::Scan(args) => scan_bus(&args, console),
        Task::SetId(args) => {
            let SetId { from, to, line } = args;
            set_id(&mut open(&line)?, from, to)?;
            console.say(format!("servo {} is now {}", from.get(), to.get()))?;
            console.result(&json!({ "id": to.get(), "was": from.get() }))
        }
        Task::SetBaud(args) => {
            let SetBaud { id, to, line } = args;
            set_baud(&mut open(&line)?, id, to)?;
            console.say(format!("servo {} now speaks at {} bit/s", id.get(), to.bits_per_second()))?;
            console.result(&json!({ "id": id.get(), "baud": to.bits_per_second() }))
        }
        Task::Test(args) => test(&args, console),
    })
    .await
}

fn open(line: &Line) -> Result<ServoPort, ServoError> {
    ServoPort::open(&line.adapter.adapter, line.baud)
}

fn scan_bus(args: &Scan, console: Console) -> Result<(), Failure> {
    let mut port = ServoPort::open(&args.adapter.adapter, args.baud.unwrap_or(Baud::M1))?;
    let scanned = match args.baud {
        Some(baud) => vec![(baud, scan_at(&mut port)?)],
        None => {
            let progress = console.progress("looking for servos");
            let scanned = scan(&mut port, |baud| {
                progress.set_message(format!("at {} bit/s", baud.bits_per_second()));
                progress.tick();
            })?;
            progress.finish_and_clear();
            scanned
        }
    };
    let servos: Vec<FoundServo> = scanned.iter().flat_map(|(_, scanned)| scanned.servos.clone()).collect();
    console.say(FoundServo::HEAD)?;
    console.say_lines(servos.iter().map(FoundServo::row))?;
    console.say(format!("{} servos answer", servos.len()))?;
    console.result(&json!({ "servos": servos.iter().map(FoundServo::json).collect::<Vec<_>>() }))?;
    match scanned.iter().find(|(_, scanned)| scanned.garbled > 0) {
        Some((baud, _)) => Err(Failure::check(ServoError::Garbled(baud.bits_per_second()).to_string())),
        None => Ok(()),
    }
}

fn test(args: &Test, console: Console) -> Result<(), Failure> {
    let mut port = open(&args.line)?;
    let found = examine(&mut port, args.id)?;
    console.say_lines(found.lines())?;
    let swung = if args.moves { Some(swing(&mut port, args.id)?) } else { None };
    console.say_lines(swung.as_ref().map(Swing::in_words))?;
    console.result(&found.json(args.id, swung.as_ref()))?;
    let (id, errors) = (args.id.get(), found.errors_in_words());
    match swung {
        _ if !found.errors.is_empty() => Err(Failure::check(format!(
            "servo {id} has found errors of its hardware ({errors}): see its manual, then take its supply away and give it back"
        ))),
        Some(Swing { is_good: false, .. }) => Err(Failure::check(format!("servo {id} did not go where it was sent"))),
        _ => Ok(()),
    }
}
