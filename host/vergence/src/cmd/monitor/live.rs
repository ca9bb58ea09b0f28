//! The monitor on a terminal: lines that are drawn over.

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};
use vergence_board::{describe_fault, positions};
use vergence_protocol::PoseReport;
use vergence_rig::{AxisPosition, Rig, RigAxis};

/// More often than this nobody sees.
const DRAWS_PER_SECOND: u8 = 20;
/// Letters of the picture of an axis.
const RULER: usize = 32;
/// Speeds are taken over at least this: over less they are the encoder's steps.
const SPEED_SPAN_US: u64 = 50_000;

/// One line for the state, one for each axis, one for the link, one for a fault.
pub struct Live {
    lines: MultiProgress,
    state: ProgressBar,
    axes: Vec<ProgressBar>,
    link: ProgressBar,
    fault: ProgressBar,
    before: Option<PoseReport>,
    speeds: Vec<f64>,
}

impl Live {
    pub fn new(rig: &Rig) -> Self {
        let lines = MultiProgress::with_draw_target(ProgressDrawTarget::stdout_with_hz(DRAWS_PER_SECOND));
        let line = || {
            let line = ProgressBar::new_spinner();
            if let Ok(style) = ProgressStyle::with_template("{msg}") {
                line.set_style(style);
            }
            lines.add(line)
        };
        let state = line();
        let axes = rig.axes.iter().map(|_| line()).collect();
        let (link, fault) = (line(), line());
        Self { state, axes, link, fault, before: None, speeds: vec![0.0; rig.axes.len()], lines }
    }

    /// Draws a pose; `link` is a line about the link.
    pub fn draw(&mut self, rig: &Rig, pose: &PoseReport, link: String) {
        self.measure_speeds(rig, pose);
        let mode = rig.reported_mode(pose).map(|mode| format!(" [{mode}]")).unwrap_or_default();
        show(&self.state, format!("{}{mode}  {:.2} s since the board started", pose.state, pose.at.0 as f64 * 1e-6));
        let width = rig.axes.iter().map(|axis| axis.name.len()).max().unwrap_or(0);
        for (index, (axis, position)) in rig.axes.iter().zip(positions(rig, pose)).enumerate() {
            let Some(line) = self.axes.get(index) else { continue };
            let speed = AxisPosition::from_value(axis.kind, self.speeds.get(index).copied().unwrap_or(0.0));
            let where_it_is =
                if pose.referenced.contains(index) { ruler(axis, position) } else { "no reference".into() };
            let [position, speed] = [position, speed].map(|it| it.to_string());
            show(line, format!("{:width$}  {position:>11}  {speed:>11}/s  {where_it_is}", axis.name));
        }
        show(&self.link, link);
        show(&self.fault, pose.fault.map(|fault| describe_fault(rig, &fault)).unwrap_or_default());
    }

    fn measure_speeds(&mut self, rig: &Rig, pose: &PoseReport) {
        let Some(before) = &self.before else {
            self.before = Some(pose.clone());
            return;
        };
        let span = pose.at.0.saturating_sub(before.at.0);
        if span >= SPEED_SPAN_US {
            let ways = positions(rig, pose).into_iter().zip(positions(rig, before));
            self.speeds = ways.map(|(now, before)| now.minus(before).value() / (span as f64 * 1e-6)).collect();
            self.before = Some(pose.clone());
        }
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        // What was shown last stays on the screen.
        for line in self.axes.iter().chain([&self.state, &self.link, &self.fault]) {
            line.abandon();
        }
        let _ = self.lines.println("");
    }
}

fn show(line: &ProgressBar, text: String) {
    line.set_message(text);
    line.tick();
}

/// The range of the axis, and where in it it is.
fn ruler(axis: &RigAxis, position: AxisPosition) -> String {
    let [low, high] = axis.range.map(|end| end.value());
    let share = ((position.value() - low) / (high - low)).clamp(0.0, 1.0);
    let mark = (share * (RULER - 1) as f64).round() as usize;
    let picture: String = (0..RULER).map(|index| if index == mark { '|' } else { '-' }).collect();
    format!("{} [{picture}] {}", axis.range[0], axis.range[1])
}
