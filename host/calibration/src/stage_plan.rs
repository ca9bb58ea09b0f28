//! Poses of a stage for its calibration.

use vergence_rig::{AxisPosition, RigAxis};

/// Poses that lie far apart: of the low ends, middles and high ends of all axes the one farthest from those before, in
/// parts of the ranges, starting at the low ends (the farthest-point design of M. Johnson, L. Moore and D. Ylvisaker,
/// "Minimax and maximin distance designs", J. Stat. Plan. Inference 26, 1990, taken greedily).
#[must_use]
pub fn stage_plan(axes: &[RigAxis], count: usize) -> Vec<Vec<AxisPosition>> {
    let levels = axes.iter().fold(vec![Vec::new()], |grid: Vec<Vec<f64>>, _| {
        grid.iter().flat_map(|start| [0.0, 0.5, 1.0].map(|level| [start.as_slice(), &[level]].concat())).collect()
    });
    let mut chosen: Vec<&Vec<f64>> = levels.iter().take(1).collect();
    while chosen.len() < count.min(levels.len()) {
        let distance = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
        let nearest = |pose: &&Vec<f64>| chosen.iter().map(|other| distance(pose, other)).fold(f64::INFINITY, f64::min);
        // Of equals the first: `max_by` would take the last.
        let farthest = levels.iter().rev().max_by(|a, b| nearest(a).total_cmp(&nearest(b)));
        chosen.extend(farthest);
    }
    let position = |(axis, level): (&RigAxis, &f64)| {
        let [low, high] = axis.range.map(AxisPosition::value);
        AxisPosition::from_value(axis.kind, low + level * (high - low))
    };
    chosen.into_iter().map(|levels| axes.iter().zip(levels).map(position).collect()).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test may fail")]

    use super::*;

    #[test]
    fn six_poses_of_the_bench_are_its_corners_its_middle_and_one_more() {
        let bench = vergence_rig::Rig::from_toml(vergence_rig::BENCH_TOML).unwrap();
        let poses = stage_plan(&bench.axes, 6);
        let words: Vec<String> = poses.iter().map(|pose| format!("{} {}", pose[0], pose[1])).collect();
        assert_eq!(
            words[..5],
            [
                "60.000 mm 0.000°",
                "220.000 mm 130.000°",
                "60.000 mm 130.000°",
                "220.000 mm 0.000°",
                "140.000 mm 65.000°"
            ]
        );
        assert_eq!(poses.len(), 6);
        assert_eq!(stage_plan(&bench.axes, 100).len(), 9);
    }
}
