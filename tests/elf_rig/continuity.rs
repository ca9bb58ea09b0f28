//! Continuity of the acceleration, from the instants of step pulses alone.
//!
//! A motor passes the middle between two steps at the instant of a pulse, so that pulses are samples of its position. Of a
//! position with a continuous acceleration, whose jerk is at most J, the third divided difference over any four instants is at
//! most J/6. A jump of the acceleration by D between the middle two of four instants that are h apart adds 3D/4h to six times it
//! (the second-degree B-spline at its middle).

use vergence_plant::StepMade;

/// Distance of the samples, in seconds: with a longer one a jump is spread, with a shorter one errors of the instants count more.
const APART_S: f64 = 0.004;
/// Windows with a longer gap than this are left out: the axis rests.
const LONGEST_S: f64 = 2.0 * APART_S;
/// Instants of pulses are off by up to this to either side, in seconds, beside a constant delay: a list begins by a clock of whole
/// microseconds (1 us), its periods are cut off to tenths of a microsecond (0.1 us), the planned instants are good to 50 ns to
/// either side (0.1 us), and an instruction under way or a wait state may come between (0.1 us).
const INSTANT_S: f64 = (1.0 + 0.1 + 0.1 + 0.1) / 2.0 * 1e-6;

/// What the windows of a motion have shown.
#[derive(Clone, Copy, Debug, Default)]
pub struct Continuity {
    /// Number of windows.
    pub windows: usize,
    /// Largest jerk, less what errors of the instants explain, as a share of the allowed one.
    pub worst: f64,
    /// The smallest jump of the acceleration that would show in every window, in steps per second squared: at full speed.
    pub shows: f64,
}

impl Continuity {
    /// Takes those of another motion as well.
    pub fn merge(&mut self, other: &Self) {
        self.windows += other.windows;
        self.worst = self.worst.max(other.worst);
        self.shows = self.shows.max(other.shows);
    }

    /// Looks at the pulses of one motion; `jerk` is allowed, in steps per second cubed.
    pub fn of(steps: &[StepMade], jerk: f64) -> Self {
        let samples = samples(steps);
        let mut all = Self::default();
        let mut next = 0.0;
        for first in 0..samples.len() {
            // A window in each millisecond.
            if samples[first].0 < next {
                continue;
            }
            next = samples[first].0 + 0.001;
            let Some(window) = window(&samples[first..]) else { continue };
            let (measured, unsure) = third_derivative(&window);
            all.windows += 1;
            all.worst = all.worst.max((measured.abs() - unsure) / jerk);
            all.shows = all.shows.max((2.0 * jerk + unsure) * APART_S / 0.75);
        }
        all
    }
}

/// Seconds and positions in steps.
fn samples(steps: &[StepMade]) -> Vec<(f64, f64)> {
    let mut at = 0;
    let start = steps.first().map_or(0, |step| step.at_ns);
    let sample = |step: &StepMade| {
        let before = at;
        at += if step.forward { 1 } else { -1 };
        ((step.at_ns - start) as f64 * 1e-9, f64::from(before + at) / 2.0)
    };
    steps.iter().map(sample).collect()
}

/// The first sample and three more, each at least so far behind the one before.
fn window(samples: &[(f64, f64)]) -> Option<[(f64, f64); 4]> {
    let mut window = [*samples.first()?; 4];
    for number in 1..4 {
        let before = window[number - 1].0;
        let found = samples.partition_point(|(at, _)| *at < before + APART_S);
        window[number] = *samples.get(found)?;
        if window[number].0 - before > LONGEST_S {
            return None;
        }
    }
    Some(window)
}

/// Six times the third divided difference, and how far errors of the instants can put it off.
fn third_derivative(window: &[(f64, f64); 4]) -> (f64, f64) {
    let (mut sum, mut unsure) = (0.0, 0.0);
    for (index, (at, position)) in window.iter().enumerate() {
        let others = window.iter().enumerate().filter(|(other, _)| *other != index);
        let product: f64 = others.map(|(_, (other, _))| at - other).product();
        sum += 6.0 * (position - window[0].1) / product;
        unsure += 6.0 * speed(window, index) * INSTANT_S / product.abs();
    }
    (sum, unsure)
}

/// The larger of the mean speeds beside a sample, in steps per second.
fn speed(window: &[(f64, f64); 4], index: usize) -> f64 {
    let mean = |pair: &[(f64, f64)]| ((pair[1].1 - pair[0].1) / (pair[1].0 - pair[0].0)).abs();
    let beside = window.windows(2).enumerate().filter(|(pair, _)| *pair == index || pair + 1 == index);
    beside.map(|(_, pair)| mean(pair)).fold(0.0, f64::max)
}
