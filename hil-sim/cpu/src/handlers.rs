//! How long exception handlers take, where that is asked for: from the beginning of entry to the end of return.

use crate::bus::Cycle;

/// The time that the handler of one exception has taken so far, in core cycles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HandlerTime {
    /// Number of completed runs.
    pub runs: u64,
    /// Total time without what preempted it.
    pub total: Cycle,
    /// The longest run, without what preempted it.
    pub longest: Cycle,
    /// The longest run, with what preempted it.
    pub longest_span: Cycle,
}

/// A handler that runs, or that another one preempts.
#[derive(Clone, Copy)]
struct Running {
    exception: u16,
    begun: Cycle,
    /// The part of that time which other handlers took.
    preempted: Cycle,
}

/// The times of all handlers.
#[derive(Clone)]
pub(crate) struct HandlerTimes {
    times: Vec<HandlerTime>,
    running: Vec<Running>,
}

impl HandlerTimes {
    /// Number of exceptions that the NVIC can have.
    const EXCEPTIONS: usize = 256;

    pub fn new() -> Self {
        Self { times: vec![HandlerTime::default(); Self::EXCEPTIONS], running: Vec::new() }
    }

    pub fn of(&self, exception: u16) -> HandlerTime {
        self.times.get(usize::from(exception)).copied().unwrap_or_default()
    }

    #[cold]
    pub fn begin(&mut self, exception: u16, now: Cycle) {
        self.running.push(Running { exception, begun: now, preempted: 0 });
    }

    /// Ends the handler that began last.
    #[cold]
    pub fn end(&mut self, now: Cycle) {
        // It may have begun before timing was asked for.
        let Some(Running { exception, begun, preempted }) = self.running.pop() else { return };
        let span = now - begun;
        if let Some(outer) = self.running.last_mut() {
            outer.preempted += span;
        }
        if let Some(time) = self.times.get_mut(usize::from(exception)) {
            time.runs += 1;
            time.total += span - preempted;
            time.longest = time.longest.max(span - preempted);
            time.longest_span = time.longest_span.max(span);
        }
    }
}
