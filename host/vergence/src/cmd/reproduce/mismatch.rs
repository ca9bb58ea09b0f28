//! `vergence reproduce --mismatch`: worlds that are not as the calibration assumes.

use serde_json::json;
use vergence_files::write_whole;
use vergence_reproduce::mismatch::{MismatchPlan, mismatch_page, mismatches};
use vergence_rig::rounded;

use super::Args;
use crate::console::Console;
use crate::failure::Failure;
use crate::interrupt::{interrupted, on_own_thread};
use crate::stopwatch::Stopwatch;

pub async fn run(args: &Args, console: Console, whole: &Stopwatch) -> Result<(), Failure> {
    let plan = MismatchPlan::new(args.seeds, args.lens).ok_or_else(|| {
        Failure::usage("--mismatch displaces the elements of traced lenses: name such with --lens; a rig with ideal ones stands beside it anyway")
    })?;
    let bar = console.count_bar("rigs, each with one mismatch", 1);
    let shown = bar.clone();
    let work = on_own_thread(move || {
        Ok(mismatches(&plan, &|done, all| {
            shown.set_length(all as u64);
            shown.set_position(done as u64);
        })?)
    });
    let table = tokio::select! {
        biased;
        () = interrupted() => Err(Failure::interrupted("interrupted: no page was written; fewer --seeds take less time")),
        table = work => table,
    }?;
    bar.finish_and_clear();
    let page = args.out.join("mismatch.html");
    write_whole(&page, mismatch_page(&table).as_bytes())?;
    table.lines().iter().try_for_each(|line| console.say(line))?;
    console.say(format!("{} shows all of it; {:.0} s", page.display(), whole.seconds()))?;
    let mut figures = table.json();
    figures["page"] = json!(page);
    figures["seconds"] = rounded(whole.seconds()).into();
    console.result(&figures)
}
