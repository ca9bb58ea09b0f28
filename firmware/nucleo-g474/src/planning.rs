//! Plans of moves, made in a task of the executor: below the node and its tick, and one axis at a time, so that bytes from
//! the host pass between two steps.
//!
//! The planner is lent to and fro: the task fills it, the node reads it in its interrupt and gives it back.

use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use static_cell::StaticCell;
use vergence_control::{MovePlanner, Node, PlanRequest};

use crate::exchange;

/// The latest request of the node.
static WANTED: Signal<CriticalSectionRawMutex, PlanRequest> = Signal::new();
/// The planner with its plan, for the node.
static MADE: Signal<CriticalSectionRawMutex, &'static mut MovePlanner> = Signal::new();
/// The planner that the node has read.
static READ: Signal<CriticalSectionRawMutex, &'static mut MovePlanner> = Signal::new();

/// Passes plans to the node, and its requests to the task. Call it in each run of the node, after its tick; `made` is the
/// plan that waits for its tick.
pub fn exchange(node: &mut Node, made: &mut Option<&'static mut MovePlanner>) {
    if made.is_none() {
        *made = MADE.try_take();
    }
    if let Some(planner) = made.take_if(|planner| node.give_plan(planner)) {
        READ.signal(planner);
    }
    if let Some(request) = node.take_plan_request() {
        WANTED.signal(request);
    }
}

/// Memory for the planner. Call it once.
pub fn planner() -> &'static mut MovePlanner {
    static MEMORY: StaticCell<MovePlanner> = StaticCell::new();
    MEMORY.init_with(MovePlanner::default)
}

/// Makes the plans that the node asks for. A newer request ends the work on an older one.
#[embassy_executor::task]
pub async fn plan(mut planner: &'static mut MovePlanner) {
    loop {
        planner.begin(WANTED.wait().await);
        while !planner.step() && !WANTED.signaled() {
            yield_now().await;
        }
        if planner.trajectories().is_empty() {
            continue;
        }
        MADE.signal(planner);
        exchange::ring();
        planner = READ.wait().await;
    }
}
