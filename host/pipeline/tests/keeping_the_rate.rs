//! The number of points keeps the rate of the cameras on simulated computers.

use proptest::prelude::*;
use vergence_pipeline::{PairCost, PointBudget, PointLimit};

/// All points that there may be, and the fewest that time leaves.
const ALL: f64 = 700.0;
const LEAST: f64 = 100.0;
/// Pairs until the number of points is right.
const LEARNT: usize = 15;

/// A computer, and cameras that deliver every `period` seconds. A pair takes `fixed` and `each` for each of its points.
#[derive(Clone, Copy, Debug)]
struct Computer {
    fixed: f64,
    each: f64,
    period: f64,
    /// Standard deviation of what a pair takes, as a part of it.
    noise: f64,
}

/// Numbers without order.
struct Mixed(u64);

impl Mixed {
    /// Between 0 and 1. D. Knuth's multiplier of a linear congruential generator (MMIX).
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Of mean 0 and standard deviation 1, and never beyond 3.5.
    fn normal(&mut self) -> f64 {
        ((0..12).map(|_| self.uniform()).sum::<f64>() - 6.0).clamp(-3.5, 3.5)
    }
}

/// What became of a pair.
#[derive(Clone, Copy, Debug)]
struct Measured {
    points: f64,
    seconds: f64,
    limit: Option<PointLimit>,
}

impl Computer {
    /// Measures the first pairs: the first one is searched as a whole, the next two in more rows than others.
    fn begin(self, budget: &mut PointBudget, random: &mut Mixed) -> Vec<Measured> {
        self.measure(budget, random, 3, |pair| if pair == 0 { 2.0 } else { 1.2 })
    }

    /// Measures so many pairs; pair k takes `slower(k)` times what it takes otherwise.
    fn measure(
        self,
        budget: &mut PointBudget,
        random: &mut Mixed,
        pairs: usize,
        slower: impl Fn(usize) -> f64,
    ) -> Vec<Measured> {
        let one = |pair| {
            let limit = budget.limit();
            let points = limit.map_or(ALL, |limit| limit.most as f64);
            let seconds = self.takes(points) * slower(pair) * (1.0 + self.noise * random.normal());
            budget.came_after(self.period);
            budget.took(PairCost { points: seconds, others: 0.0 });
            Measured { points, seconds, limit }
        };
        (0..pairs).map(one).collect()
    }

    fn takes(self, points: f64) -> f64 {
        self.fixed + self.each * points
    }

    /// The points with which a pair takes what it should, where they are `slower`: all of the period but 6 ms or 15 %.
    fn best(self, slower: f64) -> f64 {
        let room = (self.period - 0.006).min(0.85 * self.period);
        ((room / slower - self.fixed) / self.each).clamp(LEAST, ALL)
    }

    /// Pairs that take longer than the period.
    fn late(self, pairs: &[Measured]) -> usize {
        pairs.iter().filter(|pair| pair.seconds > self.period).count()
    }

    fn budget(self) -> PointBudget {
        PointBudget::new(LEAST as usize, ALL as usize, Some(self.period))
    }
}

/// The largest change of the number of points within some pairs, as a part of it.
fn swing(pairs: &[Measured]) -> f64 {
    let points = || pairs.iter().map(|pair| pair.points);
    let [least, most] = [points().fold(f64::INFINITY, f64::min), points().fold(0.0, f64::max)];
    (most - least) / most
}

fn is_right(points: f64, best: f64) -> bool {
    (0.85 * best..=1.15 * best).contains(&points)
}

/// At 60 Hz, with time for more than the least points while nothing else is computed.
fn computers() -> impl Strategy<Value = (Computer, u64)> {
    (0.001..0.006_f64, 1.2e-5..4e-5_f64, 0.0..0.03_f64, any::<u64>())
        .prop_map(|(fixed, each, noise, seed)| (Computer { fixed, each, period: 1.0 / 60.0, noise }, seed))
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(200) })]

    #[test]
    fn the_points_are_right_after_a_few_pairs_and_stay((computer, seed) in computers()) {
        let (mut budget, mut random) = (computer.budget(), Mixed(seed));
        let mut pairs = computer.begin(&mut budget, &mut random);
        pairs.extend(computer.measure(&mut budget, &mut random, 300, |_| 1.0));
        let (later, best) = (&pairs[LEARNT..], computer.best(1.0));
        let points: Vec<_> = pairs.iter().map(|pair| pair.points).collect();
        prop_assert_eq!(computer.late(later), 0);
        prop_assert!(later.iter().all(|pair| is_right(pair.points, best)), "{} are best: {:?}", best, points);
        prop_assert!(swing(&later[LEARNT..]) < 0.1, "{}: {:?}", swing(&later[LEARNT..]), points);
    }

    /// Another program takes half of the computer for three seconds.
    #[test]
    fn a_computer_that_is_slower_for_a_while_has_fewer_points((computer, seed) in computers()) {
        let (mut budget, mut random) = (computer.budget(), Mixed(seed));
        computer.begin(&mut budget, &mut random);
        computer.measure(&mut budget, &mut random, 60, |_| 1.0);
        let slow = computer.measure(&mut budget, &mut random, 180, |_| 2.0);
        let points: Vec<_> = slow.iter().map(|pair| pair.points).collect();
        let (best, least) = (computer.best(2.0), 2.0 * computer.takes(LEAST) < 0.7 * computer.period);
        if least {
            prop_assert_eq!(computer.late(&slow[LEARNT..]), 0);
        }
        prop_assert!(slow[LEARNT..].iter().all(|pair| is_right(pair.points, best)), "{} are best: {:?}", best, points);
        let after = computer.measure(&mut budget, &mut random, 120, |_| 1.0);
        prop_assert_eq!(computer.late(&after), 0);
        let points: Vec<_> = after.iter().map(|pair| pair.points).collect();
        prop_assert!(after[40..].iter().all(|pair| is_right(pair.points, computer.best(1.0))), "{:?}", points);
    }

    /// One pair in twenty takes up to three times as long: that says nothing of the others.
    #[test]
    fn single_slow_pairs_change_little((computer, seed) in computers()) {
        let (mut budget, mut random) = (computer.budget(), Mixed(seed));
        computer.begin(&mut budget, &mut random);
        computer.measure(&mut budget, &mut random, 60, |_| 1.0);
        let spiked = computer.measure(&mut budget, &mut random, 200, |pair| if pair % 20 == 7 { 3.0 } else { 1.0 });
        let points: Vec<_> = spiked.iter().map(|pair| pair.points).collect();
        prop_assert!(swing(&spiked) < 0.1, "{} {:?}", swing(&spiked), points);
        prop_assert!(is_right(points[199], computer.best(1.0)), "{:?} {:?}", computer.best(1.0), points);
        prop_assert_eq!(computer.late(&spiked), 10);
    }
}

/// A pair has time of its own: while the axes turn, places of pixels are computed anew for each.
#[test]
fn a_time_of_its_own_that_grows_costs_points_and_gives_them_back() {
    let standing = Computer { fixed: 0.003, each: 2.5e-5, period: 1.0 / 60.0, noise: 0.03 };
    let turning = Computer { fixed: 0.006, ..standing };
    let (mut budget, mut random) = (standing.budget(), Mixed(5));
    for computer in [standing, turning, standing, turning] {
        let pairs = computer.measure(&mut budget, &mut random, 120, |_| 1.0);
        let points: Vec<_> = pairs.iter().map(|pair| pair.points).collect();
        assert_eq!(computer.late(&pairs[LEARNT..]), 0, "{points:?}");
        assert!(points[40..].iter().all(|points| is_right(*points, computer.best(1.0))), "{computer:?} {points:?}");
    }
}

#[test]
fn time_enough_limits_nothing_whatever_single_pairs_take() {
    // As two images of 1280 x 1280 pixels at 15 Hz: 50 of 66 ms.
    let computer = Computer { fixed: 0.020, each: 4.3e-5, period: 1.0 / 15.0, noise: 0.05 };
    let (mut budget, mut random) = (computer.budget(), Mixed(3));
    let first = computer.measure(&mut budget, &mut random, 1, |_| 2.6);
    let pairs = computer.measure(&mut budget, &mut random, 300, |pair| if pair % 25 == 24 { 2.0 } else { 1.0 });
    let points: Vec<_> = first.iter().chain(&pairs).map(|pair| pair.points).collect();
    assert!(first.iter().chain(&pairs).all(|pair| pair.limit.is_none()), "{points:?}");
}

#[test]
fn fewer_points_are_said_not_to_help_where_a_pair_takes_the_period_without_any() {
    let last = |computer: Computer| {
        let mut budget = PointBudget::new(LEAST as usize, ALL as usize, None);
        computer.measure(&mut budget, &mut Mixed(1), 60, |_| 1.0).pop().and_then(|pair| pair.limit)
    };
    let least = |helps| Some(PointLimit { most: LEAST as usize, of: ALL as usize, helps });
    let computer = Computer { fixed: 0.020, each: 2e-5, period: 1.0 / 60.0, noise: 0.03 };
    assert_eq!(last(computer), least(false));
    assert_eq!(
        last(Computer { fixed: 0.009, each: 8e-5, ..computer }),
        least(true),
        "these take longer than the period, too"
    );
}
