//! Labels of targets that look alike under several: tried jointly over a pair, or left out with a reason.
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a test may fail, and tells its figures")]

mod simulated;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use simulated::{COLUMNS, Dice, Pair, ROWS, SQUARE_MM, apart, lens, other_lens, pair_pose};
use vergence_calibration::{ExtrinsicsOptions, LabelError, StereoView, calibrate_extrinsics, label_pairs};
use vergence_targets::{Relabelling, SeenTarget, TargetKind, TargetSpec, TargetView};
use vergence_vision::Length;

const HALF_TURN: Relabelling = Relabelling { quarters: 2, shift: [COLUMNS as i32 - 1, ROWS as i32 - 1] };

fn pair() -> Pair {
    Pair { left: lens(), right: other_lens(), left_from_right: pair_pose(40.0), noise_px: 0.1 }
}

/// The labellings of a patch that could be shifted by up to `reach` squares and turned by half.
fn shifts(reach: i32) -> Vec<Relabelling> {
    let shifts = (-reach..=reach).flat_map(|i| (-reach..=reach).map(move |j| [i, j]));
    shifts
        .flat_map(|shift| {
            let same = Relabelling { shift, ..Relabelling::SAME };
            [same, HALF_TURN.then(same)]
        })
        .collect()
}

/// The view under one of `labellings`, which its image allows all.
fn seen(view: &TargetView, labellings: &[Relabelling], dice: &mut Dice) -> SeenTarget {
    let taken = labellings[dice.between(0.0, labellings.len() as f64) as usize];
    let mut view = view.clone();
    for corner in &mut view.corners {
        corner.target_mm = taken.target_mm(corner.target_mm, SQUARE_MM);
    }
    let labellings = labellings.iter().map(|way| taken.inverse().then(*way)).collect();
    SeenTarget { view, labellings, pitch: Length::from_mm(SQUARE_MM) }
}

fn both(views: &[StereoView], labellings: &[Relabelling], dice: &mut Dice) -> Vec<[SeenTarget; 2]> {
    views.iter().map(|view| [seen(&view.left, labellings, dice), seen(&view.right, labellings, dice)]).collect()
}

fn labelled(pair: &Pair, seen: &[[SeenTarget; 2]]) -> Vec<Result<StereoView, LabelError>> {
    let seen: Vec<[&SeenTarget; 2]> = seen.iter().map(|[left, right]| [left, right]).collect();
    label_pairs([&pair.left, &pair.right], &seen)
}

fn by_index(seen: &[[SeenTarget; 2]]) -> Vec<StereoView> {
    let pair = |[left, right]: &[SeenTarget; 2]| StereoView {
        name: left.view.name.clone(),
        left: left.view.clone(),
        right: right.view.clone(),
    };
    seen.iter().map(pair).collect()
}

/// Whether the right corners have the labels of the left ones: the true relative labelling.
fn agrees(view: &StereoView, truth: &StereoView) -> bool {
    let shift = |seen: &TargetView, truth: &TargetView, index: usize| {
        let (a, b) = (seen.corners[index].target_mm, truth.corners[index].target_mm);
        [a[0] - b[0], a[1] - b[1]]
    };
    let same = |a: [f64; 2], b: [f64; 2]| (a[0] - b[0]).hypot(a[1] - b[1]) < 1e-6;
    let turned = |seen: &TargetView, truth: &TargetView| {
        !same(shift(seen, truth, 0), shift(seen, truth, seen.corners.len() - 1))
    };
    turned(&view.left, &truth.left) == turned(&view.right, &truth.right)
        && (turned(&view.left, &truth.left)
            || same(shift(&view.left, &truth.left, 0), shift(&view.right, &truth.right, 0)))
}

#[test]
fn a_half_turn_and_shifts_are_told_by_the_other_views() {
    for (seed, labellings) in [(1, vec![Relabelling::SAME, HALF_TURN]), (2, shifts(3)), (3, shifts(3))] {
        let (pair, mut dice) = (pair(), Dice::new(seed));
        let views = pair.views(12, &mut dice);
        let seen = both(&views, &labellings, &mut dice);
        let by_index = calibrate_extrinsics(&pair.left, &pair.right, &by_index(&seen), &ExtrinsicsOptions::default());
        let off =
            by_index.map(|found| (apart(&found.joint.left_from_right, &pair.left_from_right), found.corners_inlier));
        let labelled: Vec<StereoView> = labelled(&pair, &seen).into_iter().map(Result::unwrap).collect();
        for (view, truth) in labelled.iter().zip(&views) {
            assert!(agrees(view, truth), "{}: a wrong label", view.name);
        }
        let found = calibrate_extrinsics(&pair.left, &pair.right, &labelled, &ExtrinsicsOptions::default()).unwrap();
        let (turn, shift) = apart(&found.joint.left_from_right, &pair.left_from_right);
        println!("seed {seed}: by index {off:?}; labelled {turn:.4}°, {shift:.3} mm");
        assert!(turn < 0.05 && shift < 0.3, "{turn}° {shift} mm");
        assert!(!matches!(off, Ok(((turn, shift), _)) if turn < 0.05 && shift < 0.3), "paired by index it was right");
    }
}

#[test]
fn certain_views_decide_for_open_ones() {
    let (pair, mut dice) = (pair(), Dice::new(4));
    let views = pair.views(5, &mut dice);
    let mut seen = both(&views, &shifts(4), &mut dice);
    for (one, view) in seen.iter_mut().zip(&views).take(3) {
        *one = [&view.left, &view.right].map(|view| SeenTarget::certain(view.clone(), Length::from_mm(SQUARE_MM)));
    }
    for (view, truth) in labelled(&pair, &seen).into_iter().zip(&views) {
        assert!(agrees(&view.unwrap(), truth));
    }
}

#[test]
fn a_view_that_no_labelling_fits_is_left_out() {
    let (pair, mut dice) = (pair(), Dice::new(5));
    let mut views = pair.views(8, &mut dice);
    // The target moved between both images of the last view.
    let moved = pair.views(1, &mut dice).remove(0);
    views[7].right = moved.right;
    let seen = both(&views, &[Relabelling::SAME, HALF_TURN], &mut dice);
    let labelled = labelled(&pair, &seen);
    assert!(labelled[..7].iter().all(Result::is_ok));
    assert_eq!(labelled[7], Err(LabelError::NoneFits));
}

#[test]
fn targets_that_were_all_held_alike_are_left_out() {
    let (pair, mut dice) = (pair(), Dice::new(6));
    let held = Isometry3::from_parts(
        Vector3::new(-40.0, -60.0, 330.0).into(),
        UnitQuaternion::from_euler_angles(0.2, 0.3, 0.1),
    );
    let views: Vec<StereoView> = (0..8).map(|index| pair.see(format!("view {index}"), &held, &mut dice)).collect();
    for result in labelled(&pair, &both(&views, &[Relabelling::SAME, HALF_TURN], &mut dice)) {
        assert_eq!(result, Err(LabelError::Undecided));
    }
    let few = both(&pair.views(2, &mut dice), &[Relabelling::SAME, HALF_TURN], &mut dice);
    for result in labelled(&pair, &few) {
        assert!(matches!(result, Err(LabelError::TooFewAgree { .. })), "{result:?}");
    }
}

/// The bow of a board is the same after half a turn, not after a shift.
#[test]
fn views_of_an_unknown_part_of_the_board_are_not_placed_on_it() {
    let (mut dice, square) = (Dice::new(7), Length::from_mm(SQUARE_MM));
    let view = pair().views(1, &mut dice).remove(0).left;
    let board = TargetKind::Chessboard(TargetSpec { columns: COLUMNS, rows: ROWS, square });
    assert!(SeenTarget::certain(view.clone(), square).is_placed(&board));
    assert!(seen(&view, &[Relabelling::SAME, HALF_TURN], &mut dice).is_placed(&board));
    assert!(!seen(&view, &shifts(1), &mut dice).is_placed(&board));
}

#[test]
fn no_wrong_label_survives_in_many_sets() {
    let (mut right, mut left_out) = (0, 0);
    for seed in 0..simulated::seeds(30) {
        let (pair, mut dice) = (pair(), Dice::new(100 + seed));
        let count = 3 + seed as usize % 10;
        let views = pair.views(count, &mut dice);
        let labellings = if seed % 2 == 0 { vec![Relabelling::SAME, HALF_TURN] } else { shifts(2) };
        for (result, truth) in labelled(&pair, &both(&views, &labellings, &mut dice)).into_iter().zip(&views) {
            match result {
                Ok(view) => {
                    assert!(agrees(&view, truth), "seed {seed}: a wrong label survived");
                    right += 1;
                }
                Err(_) => left_out += 1,
            }
        }
    }
    println!("{right} views labelled rightly, {left_out} left out, none wrong");
    assert!(right > 4 * left_out);
}
