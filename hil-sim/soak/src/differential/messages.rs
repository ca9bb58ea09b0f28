//! Compares two messages. What differs by design is left out here, and listed in `hil-sim/FIDELITY.md`.

use vergence_control::TICK_US;
use vergence_protocol::management::{Identity, ManagementReport};
use vergence_protocol::{
    BoardInfo, BoardStatistics, FaultCode, FaultRecord, Happening, Microseconds, PoseReport, RecordedEvents, Report,
    TriggerMark,
};

use super::compare::Comparison;
use super::difference::Difference;
use super::side::Said;
use super::slack::{HOMING_TICKS, apart};

/// Most microseconds from the instant at which one board takes a request to that at which the other does: the node on the
/// chip may be in its tick.
const REQUEST_US: f64 = 600.0;
/// Most microseconds from a reply of one board to that of the other: a frame may be on the wire.
const REPLY_US: f64 = 5_000.0;

/// Compares a message of the native board with that of the chip.
pub fn compare(with: &mut Comparison, native: &Said, chip: &Said) -> Result<(), Difference> {
    match (native, chip) {
        (Said::Report(native), Said::Report(chip)) => reports(with, native, chip),
        (Said::Management(native), Said::Management(chip)) => match (native, chip) {
            (ManagementReport::Identity(native), ManagementReport::Identity(chip)) => {
                Difference::unless_equal("identity", &alike_identity(native), &alike_identity(chip))
            }
            _ => Difference::unless_equal("answer of the updater", native, chip),
        },
        _ => Err(Difference::new("kind of a message", native, chip)),
    }
}

fn reports(with: &mut Comparison, native: &Report, chip: &Report) -> Result<(), Difference> {
    match (native, chip) {
        (
            Report::Hello { protocol, schema, session, .. },
            Report::Hello { protocol: p, schema: s, session: named, .. },
        ) => Difference::unless_equal("hello", &(protocol, schema, session), &(p, s, named)),
        (Report::Info { to, info }, Report::Info { to: t, info: i }) => {
            Difference::unless_equal("info", &(to, alike_info(info)), &(t, alike_info(i)))
        }
        (Report::TimeReply { t0, t1, t2 }, Report::TimeReply { t0: sent, t1: came, t2: left }) => {
            Difference::unless_equal("time probe", t0, sent)?;
            times(with, "time at which a probe came", *t1, *came, REQUEST_US)?;
            times(with, "time at which a probe was answered", *t2, *left, REPLY_US)
        }
        (Report::Fault(native), Report::Fault(chip)) => faults(with, native, chip),
        (Report::Events { to, events }, Report::Events { to: t, events: e }) => {
            Difference::unless_equal("answer to a question for events", to, t)?;
            recorded(with, events, e)
        }
        (Report::Statistics { to, statistics }, Report::Statistics { to: t, statistics: s }) => {
            Difference::unless_equal("statistics", &(to, alike_figures(statistics)), &(t, alike_figures(s)))
        }
        (Report::TriggerMark(native), Report::TriggerMark(chip)) => marks(with, native, chip),
        _ => Difference::unless_equal("message", native, chip),
    }
}

/// Without what names the board.
fn alike_info(info: &BoardInfo) -> impl PartialEq + std::fmt::Debug {
    (info.firmware, info.build, info.reset, info.axes)
}

fn alike_identity(identity: &Identity) -> impl PartialEq + std::fmt::Debug {
    (identity.version, identity.oldest, identity.build, identity.boot, identity.capacity)
}

/// Without what depends on the speed of the wire and on the log.
fn alike_figures(figures: &BoardStatistics) -> BoardStatistics {
    BoardStatistics { sent: 0, poses_replaced: 0, logs_dropped: 0, ..*figures }
}

/// Compares two times, each of its board's clock.
fn times(
    with: &mut Comparison,
    field: &str,
    native: Microseconds,
    chip: Microseconds,
    allowed: f64,
) -> Result<(), Difference> {
    let chip = with.native_time(chip.0);
    if allowed <= REQUEST_US {
        let us = (native.0 as i64).abs_diff(chip);
        with.figures.request_us = with.figures.request_us.max(us);
    }
    Difference::unless_close(field, native.0 as f64, chip as f64, allowed)
}

fn event_us(with: &Comparison) -> f64 {
    (with.apart.ticks() * TICK_US) as f64 + REQUEST_US + 0.5
}

fn faults(with: &mut Comparison, native: &FaultRecord, chip: &FaultRecord) -> Result<(), Difference> {
    with.note_names(native, chip);
    fault_content(with, native, chip)?;
    let allowed = event_us(with);
    times(with, "time of a fault", native.at, chip.at, allowed)
}

impl Comparison {
    /// Notes that the boards have different names for a failure at the edge of two rules.
    fn note_names(&mut self, native: &FaultRecord, chip: &FaultRecord) {
        let near =
            |fault: &FaultRecord| matches!(fault.code, FaultCode::Stall | FaultCode::Slip | FaultCode::WrongDirection);
        let differ = native.code != chip.code && near(native) && near(chip);
        if differ && self.slack.is_between_stall_and_slip(usize::from(native.axis.unwrap_or_default())) {
            self.named_apart = true;
            self.figures.named_apart += 1;
        }
    }

    /// The code of a fault, or that of a slip where the boards have different names for one.
    fn alike_code(&self, code: FaultCode) -> FaultCode {
        let is_other = matches!(code, FaultCode::Stall | FaultCode::WrongDirection);
        if self.named_apart && is_other { FaultCode::Slip } else { code }
    }
}

/// Compares faults without their times.
fn fault_content(with: &Comparison, native: &FaultRecord, chip: &FaultRecord) -> Result<(), Difference> {
    let alike = |fault: &FaultRecord| (with.alike_code(fault.code), fault.seq, fault.axis, fault.later);
    Difference::unless_equal("fault", &alike(native), &alike(chip))?;
    detail(with, native.code, native.axis, [native.detail, chip.detail])
}

fn detail(with: &Comparison, code: FaultCode, axis: Option<u8>, details: [i32; 2]) -> Result<(), Difference> {
    let allowed = match code {
        FaultCode::LeaseExpired => event_us(with),
        FaultCode::TickMissed => 30.0,
        FaultCode::FollowingError
        | FaultCode::NotSettled
        | FaultCode::HomeNotRepeatable
        | FaultCode::Stall
        | FaultCode::Slip
        | FaultCode::WrongDirection
        | FaultCode::EncoderLost => with.slack.load(usize::from(axis.unwrap_or_default()), with.apart.ticks() as f64),
        _ => 0.0,
    };
    let [native, chip] = details.map(f64::from);
    Difference::unless_close(format!("detail of the fault {code:?}"), native, chip, allowed)
}

fn marks(with: &mut Comparison, native: &TriggerMark, chip: &TriggerMark) -> Result<(), Difference> {
    Difference::unless_equal("number of a pulse", &native.seq, &chip.seq)?;
    times(with, "time of a pulse", native.at, chip.at, REQUEST_US)?;
    let late = (native.at.0 as i64).abs_diff(with.native_time(chip.at.0)) as f64 / TICK_US as f64;
    for (axis, (&ours, &theirs)) in native.counts.iter().zip(&chip.counts).enumerate() {
        let ticks = if with.apart.homing || with.apart.in_faults() { with.apart.ticks() as f64 } else { 0.0 };
        let allowed = with.slack.counts(axis, late + ticks);
        let field = format!("counts of axis {axis} at a pulse");
        Difference::unless_close(field, 0.0, f64::from(apart(ours, theirs)), allowed)?;
    }
    Ok(())
}

fn recorded(with: &mut Comparison, native: &RecordedEvents, chip: &RecordedEvents) -> Result<(), Difference> {
    let alike = |page: &RecordedEvents| (page.first, page.total, page.events.len());
    Difference::unless_equal("numbers of recorded events", &alike(native), &alike(chip))?;
    for (native, chip) in native.events.iter().zip(&chip.events) {
        match (native.what, chip.what) {
            // The record of the start has no time.
            (Happening::Started, Happening::Started) => continue,
            (Happening::Encoder { axis, counts: _ }, Happening::Encoder { axis: a, counts: _ }) => {
                Difference::unless_equal("axis of a recorded encoder", &axis, &a)?;
            }
            (Happening::Fault { code, axis, detail: _ }, Happening::Fault { code: c, axis: a, detail: _ }) => {
                let [ours, theirs] = [code, c].map(|code| with.alike_code(code));
                Difference::unless_equal("recorded fault", &(ours, axis), &(theirs, a))?;
            }
            (ours, theirs) => Difference::unless_equal("recorded event", &ours, &theirs)?,
        }
        // Those of former motions are read as well.
        times(
            with,
            "time of a recorded event",
            native.at,
            chip.at,
            (HOMING_TICKS * TICK_US) as f64 + REQUEST_US + 0.5,
        )?;
    }
    Ok(())
}

/// The first difference of two poses at the same tick, without counts.
pub fn pose_differs(with: &Comparison, native: &PoseReport, chip: &PoseReport) -> Option<Difference> {
    let alike = |pose: &PoseReport| {
        let fault = pose.fault.map(|fault| (with.alike_code(fault.code), fault.seq, fault.axis, fault.later));
        (pose.state, pose.mode, pose.move_id, pose.phase, pose.referenced, fault)
    };
    let [ours, theirs] = [alike(native), alike(chip)];
    let equal = Difference::unless_equal("state, mode, move, phase, references and fault of a pose", &ours, &theirs);
    let fault = native.fault.zip(chip.fault);
    equal.and_then(|()| fault.map_or(Ok(()), |(ours, theirs)| fault_content(with, &ours, &theirs))).err()
}
