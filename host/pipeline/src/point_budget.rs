//! How many points a live matcher looks for, so that pairs keep the rate of the cameras.
//!
//! Less time than frames means fewer points first, and a lower rate only where they would become too few. What a pair takes is a time of its own and a
//! time for its points, both told by the pairs that were measured: there are as many points as let a pair take a part of the period. What that leaves
//! absorbs what single pairs take more.
//! What else a pair takes, as ranges of all its pixels, leaves less time for points. Where not even the least points would keep the rate beside it, they are
//! as many as there is time for without it: fewer would be lost for nothing.

use std::collections::VecDeque;

use crate::pair_time::PairTime;

/// Seconds of the period of the cameras that a pair leaves: what a system takes of a pair for others is milliseconds, at any rate.
const HEADROOM: f64 = 0.006;
/// Smallest and largest part of the period that a pair may take all the same.
const SHARES: (f64, f64) = (0.5, 0.85);
/// Exponent of the ratio of the points that there is time for to those that there are: from pair to pair the number goes that part of the way.
const GAIN: f64 = 0.5;
/// Smallest and largest factor from pair to pair, where none is skipped.
const STEPS: (f64, f64) = (0.85, 1.15);
/// A number that is right to this part stays: tracks that are given up are found again at a price.
const NEAR: f64 = 0.05;
/// Pairs after which the number may change although none is late: the first ones are searched in more rows than others.
const SURE: u32 = 5;
/// Periods of which the median counts.
const KEPT: usize = 5;
/// The first pair is searched as a whole, which costs so many times what the others will.
const FIRST: f64 = 2.5;
/// Seconds that the first search takes for all points. How fast the computer is shows only then: this is twice what two cores take for 640 x 640 pixels.
const WHOLE: f64 = 0.1;
/// While the first pair is searched, another may wait and none be lost: it may take as much as so many periods.
const FIRST_PERIODS: f64 = 1.5;

/// What a pair took until the next one could begin, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PairCost {
    /// All but the others: its points, and what it takes without any.
    pub points: f64,
    /// What else was measured of it, as the ranges of all its pixels.
    pub others: f64,
}

/// The points that a pair may have because of time, and those that it would have without.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PointLimit {
    /// Most points that are looked for.
    pub most: usize,
    /// Most points with time enough.
    pub of: usize,
    /// Whether fewer points let pairs come faster. Where a pair takes the whole period whatever its points, they do not.
    pub helps: bool,
}

/// The points that the pairs of a live rig may have, by what pairs cost. It has no clock: callers measure.
#[derive(Clone, Debug)]
pub struct PointBudget {
    least: f64,
    of: f64,
    now: f64,
    time: Option<PairTime>,
    pairs: u32,
    periods: VecDeque<f64>,
    helps: bool,
}

impl PointBudget {
    /// For a matcher that looks for at most `of` points. Time never limits them to less than `least`. `period` is that of the cameras in seconds, where it is
    /// known before they deliver.
    #[must_use]
    pub fn new(least: usize, of: usize, period: Option<f64>) -> Self {
        let most = of as f64;
        let least = most.min(least as f64);
        let part = period.map_or(1.0, |period| FIRST_PERIODS * period / WHOLE);
        let now = (most * part).clamp(least, most);
        Self { least, of: most, now, time: None, pairs: 0, periods: VecDeque::new(), helps: true }
    }

    /// The limit of the next pair; `None` where there is time for all points.
    #[must_use]
    pub fn limit(&self) -> Option<PointLimit> {
        let [most, of] = [self.now, self.of].map(|points| points.round() as usize);
        (most < of).then_some(PointLimit { most, of, helps: self.helps })
    }

    /// Notes the seconds from one exposure of the cameras to the next, whether it was measured or not.
    pub fn came_after(&mut self, seconds: f64) {
        if is_time(seconds) {
            self.periods.push_back(seconds);
            self.periods.drain(..self.periods.len().saturating_sub(KEPT));
        }
    }

    /// Notes what a pair took, and changes the limit.
    pub fn took(&mut self, PairCost { points: seconds, others }: PairCost) {
        let part = self.now / self.of;
        if !is_time(seconds) || part <= 0.0 {
            return;
        }
        self.pairs += 1;
        match &mut self.time {
            Some(time) => time.note(seconds, part),
            None => self.time = Some(PairTime::first(seconds / FIRST, part)),
        }
        let period = vergence_vision::median(self.periods.iter().copied().collect());
        if let (Some(time), Some(period)) = (&self.time, period) {
            let at_least = time.with(part) * self.least / self.now;
            let others = if at_least + others < period { others } else { 0.0 };
            let wanted = time.part_within(room(period) - others) * self.of;
            self.helps = time.fixed() < period - others;
            self.now = self.next(wanted.max(self.least), time.with(part) > period - others);
        }
    }

    /// The number of points after this one, where there is time for `wanted`. Pairs that are late cost others: then it comes down at once.
    fn next(&self, wanted: f64, is_late: bool) -> f64 {
        let ratio = wanted / self.now;
        let is_near = (ratio - 1.0).abs() < NEAR && wanted > self.least && wanted < self.of;
        if is_late {
            wanted.min(self.now)
        } else if is_near || self.pairs < SURE {
            self.now
        } else {
            (self.now * ratio.powf(GAIN).clamp(STEPS.0, STEPS.1)).clamp(self.least, self.of)
        }
    }
}

/// Seconds that a pair may take of a period.
fn room(period: f64) -> f64 {
    (period - HEADROOM).clamp(SHARES.0 * period, SHARES.1 * period)
}

fn is_time(seconds: f64) -> bool {
    seconds.is_finite() && seconds > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The limits while each pair costs `fixed` and `per_point` for each of its points, and pairs come every `period` seconds.
    fn limits(budget: &mut PointBudget, [fixed, per_point, period]: [f64; 3], pairs: usize) -> Vec<usize> {
        let one = |_| {
            let points = budget.limit().map_or(700, |limit| limit.most);
            budget.came_after(period);
            budget.took(PairCost { points: fixed + per_point * points as f64, others: 0.0 });
            points
        };
        (0..pairs).map(one).collect()
    }

    #[test]
    fn fewer_points_keep_the_rate_of_the_cameras() {
        let mut budget = PointBudget::new(120, 700, None);
        // 10 ms and 0.05 ms for each point: all take 45 ms, and 11 ms have time for 14 of them at 60 Hz, 27 ms for 346 at 30 Hz.
        assert!(limits(&mut budget, [0.010, 5e-5, 1.0 / 15.0], 40).iter().all(|points| *points == 700));
        assert_eq!(budget.limit(), None, "there is time for all");
        let at_30 = limits(&mut budget, [0.010, 5e-5, 1.0 / 30.0], 60);
        assert!(at_30[20..].iter().all(|points| (325..365).contains(points)), "{at_30:?}");
        // At once where pairs are late, and from then on by little from pair to pair.
        let steps = at_30.windows(2).filter(|two| two[0].abs_diff(two[1]) * 6 > two[0]).count();
        assert!(steps == 1 && at_30[..6].iter().any(|points| *points < 450), "{at_30:?}");
        let at_60 = limits(&mut budget, [0.010, 5e-5, 1.0 / 60.0], 60);
        assert_eq!(at_60.last(), Some(&120), "the floor: from here on the rate becomes lower");
        assert_eq!(budget.limit(), Some(PointLimit { most: 120, of: 700, helps: true }));
        let again = limits(&mut budget, [0.010, 5e-5, 1.0 / 15.0], 100);
        assert_eq!(again.last(), Some(&700), "all come back with the time");
    }

    /// Pairs that take longer than the period are skipped by the next: the limit is there within a few.
    #[test]
    fn the_first_pairs_tell_how_many_points_there_is_time_for() {
        let (period, mut budget) = (1.0 / 60.0, PointBudget::new(150, 700, None));
        // 8 ms and 0.05 ms for each point: all take 43 ms, the first pair as a whole 86 ms.
        budget.came_after(period);
        budget.took(PairCost { points: 0.086, others: 0.0 });
        let points = limits(&mut budget, [0.008, 5e-5, period], 60);
        let late = points.iter().filter(|points| 0.008 + 5e-5 * **points as f64 > period).count();
        assert!(points[0] < 350 && late <= 6, "{points:?}");
        assert!(points[20..].iter().all(|points| (150..=180).contains(points)), "{points:?}");
        // A first pair that takes long where there is time for the others limits nothing.
        let mut budget = PointBudget::new(150, 700, None);
        budget.came_after(1.0 / 15.0);
        budget.took(PairCost { points: 0.110, others: 0.0 });
        assert_eq!(budget.limit(), None);
    }

    /// How long a pair takes is not known before the first one: it is bounded where its period is short, and nowhere else.
    #[test]
    fn the_first_pair_is_bounded_where_pairs_come_fast() {
        let first = |rate: f64| PointBudget::new(150, 700, Some(1.0 / rate)).limit().map(|limit| limit.most);
        assert_eq!([first(5.0), first(15.0)], [None, None]);
        assert_eq!([first(30.0), first(60.0), first(500.0)], [Some(350), Some(175), Some(150)]);
    }

    #[test]
    fn one_pair_that_takes_long_limits_nothing() {
        let mut budget = PointBudget::new(120, 700, None);
        limits(&mut budget, [0.010, 5e-5, 1.0 / 15.0], 10);
        budget.took(PairCost { points: 0.4, others: 0.0 });
        budget.took(PairCost { points: 0.4, others: 0.0 });
        assert_eq!(budget.limit(), None);
    }

    #[test]
    fn what_else_is_measured_costs_points_where_that_keeps_the_rate() {
        let after = |others: f64| {
            let mut budget = PointBudget::new(150, 700, None);
            for _ in 0..60 {
                let points = budget.limit().map_or(700, |limit| limit.most);
                budget.came_after(0.2);
                budget.took(PairCost { points: 0.010 + 1e-4 * points as f64, others });
            }
            budget.limit().map_or(700, |limit| limit.most)
        };
        // All points take 80 ms of 170; 120 ms for others leave 50, enough for 400 of them.
        assert_eq!(after(0.080), 700);
        assert!((360..430).contains(&after(0.120)), "{}", after(0.120));
        // The least points take 25 ms: they keep the rate beside 170 ms, and no number of them beside 190 ms or a second.
        assert_eq!([after(0.160), after(0.170), after(0.190), after(1.0)], [150, 150, 700, 700]);
    }

    #[test]
    fn a_floor_above_what_the_matcher_looks_for_is_all_of_it() {
        let mut budget = PointBudget::new(900, 700, None);
        limits(&mut budget, [1.0, 1e-3, 0.01], 50);
        assert_eq!(budget.limit(), None);
    }
}
