//! The straight ways by which a target is reached: one for stages, several for a trunk, whose loop must stay closed.

use vergence_protocol::{AxisInfo, Permille};
use vergence_rig::linkage::{NoPath, WantedClearance};
use vergence_rig::{AxisPosition, Rig, RigTrunk};

/// A pose of a trunk that is no further from a mode on any axis, in radians, counts as that mode: 1.5 degrees. Modes such as gecko lie
/// at a dead centre, beyond which the angles of no shape lie.
const AT_MODE: f64 = 0.026;

/// Folds that are no further from flat than this, in radians, are put flat before a path begins: ten degrees.
const SAGGED: f64 = 0.1745;
/// The speed at which that is done.
const UNFOLDING: Permille = Permille(300);

/// A straight way of all axes, from rest to rest.
#[derive(Clone, Debug, PartialEq)]
pub struct Way {
    /// Where it ends.
    pub targets: Vec<AxisPosition>,
    /// Share of full speed.
    pub speed: Permille,
}

/// The ways from `standing` to `targets`.
///
/// # Errors
/// [`NoPath`] of a trunk.
pub fn straight_ways(
    rig: &Rig,
    axes: &[AxisInfo],
    standing: &[AxisPosition],
    targets: &[AxisPosition],
) -> Result<Vec<Way>, NoPath> {
    let straight = vec![Way { targets: targets.to_vec(), speed: Permille::FULL }];
    match &rig.trunk {
        Some(trunk) => along_path(rig, trunk, axes, [standing, targets]),
        None => Ok(straight),
    }
}

fn along_path(
    rig: &Rig,
    trunk: &RigTrunk,
    axes: &[AxisInfo],
    [standing, targets]: [&[AxisPosition]; 2],
) -> Result<Vec<Way>, NoPath> {
    let from = near_mode(rig, standing).unwrap_or(standing);
    if let Some(flat) = unfolded(trunk, from, targets) {
        let mut ways = vec![Way { targets: flat.clone(), speed: UNFOLDING }];
        ways.extend(along_path(rig, trunk, axes, [&flat, targets])?);
        return Ok(ways);
    }
    let [from, to] = [from, targets].map(|place| place.iter().map(|position| position.value()).collect::<Vec<f64>>());
    let path = trunk.path(&from, &to, &WantedClearance::default())?;
    let mut ways: Vec<Way> = path
        .legs
        .iter()
        .filter_map(|leg| {
            let values = trunk.values_of(leg.end()?, rig.axes.len());
            let targets = rig.axes.iter().zip(values).map(|(axis, value)| AxisPosition::from_value(axis.kind, value));
            Some(Way { targets: targets.collect(), speed: share(leg.speed, axes) })
        })
        .collect();
    // The last leg ends where it was asked for, to the last digit; and a pose that is reached is asked for again.
    match ways.last_mut() {
        Some(last) => last.targets = targets.to_vec(),
        None => ways.push(Way { targets: targets.to_vec(), speed: Permille::FULL }),
    }
    Ok(ways)
}

/// Where the trunk is flat with its corners as they stand, where folds are a little off and the goal is flat: a trunk that was without
/// torque sags. The links give way to so small a fold.
fn unfolded(trunk: &RigTrunk, standing: &[AxisPosition], targets: &[AxisPosition]) -> Option<Vec<AxisPosition>> {
    let values = |place: &[AxisPosition]| place.iter().map(|position| position.value()).collect::<Vec<f64>>();
    if trunk.is_flat(&values(standing)) || !trunk.is_flat(&values(targets)) {
        return None;
    }
    let mut flat = standing.to_vec();
    for &axis in trunk.axes.iter().skip(3) {
        let (slot, target) = (flat.get_mut(axis)?, targets.get(axis)?);
        if (slot.value() - target.value()).abs() > SAGGED {
            return None;
        }
        *slot = *target;
    }
    Some(flat)
}

/// The mode at which the axes stand, if they do.
fn near_mode<'a>(rig: &'a Rig, standing: &[AxisPosition]) -> Option<&'a [AxisPosition]> {
    let is_near = |mode: &&vergence_rig::Mode| {
        mode.targets.iter().zip(standing).all(|(one, other)| (one.value() - other.value()).abs() < AT_MODE)
    };
    rig.modes.iter().find(is_near).map(|mode| mode.targets.as_slice())
}

/// The share of the board's full speed at which its joints are no faster than `speed`, in radians per second.
fn share(speed: f64, axes: &[AxisInfo]) -> Permille {
    let fastest = axes.iter().map(|axis| axis.speed).max().map_or(speed, |fastest| f64::from(fastest) * 1e-6);
    let share = (speed / fastest * f64::from(Permille::FULL.0)).round();
    Permille((share as u16).clamp(1, Permille::FULL.0))
}
