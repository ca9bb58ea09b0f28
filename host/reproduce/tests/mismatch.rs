//! Worlds that are not as the calibration assumes: what the table says of some of them.

#![allow(clippy::expect_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

use vergence_calibration::LensModel;
use vergence_reproduce::mismatch::{Mismatch, MismatchPlan, MismatchTable, RANGES_MM, Trial, Verdict, mismatches};
use vergence_reproduce::{MODES, TRUE_LENS};

const VIEWS_ASK: LensModel = LensModel::ByEvidence;

/// The tables of docs/measured/mismatch.md: as many rigs as VERGENCE_SEEDS says, all mismatches; otherwise one rig and the worlds whose verdict is clear.
fn table() -> MismatchTable {
    let seeds = std::env::var("VERGENCE_SEEDS").ok().and_then(|text| text.parse().ok());
    let plan = MismatchPlan::new(seeds.unwrap_or(1), TRUE_LENS).expect("traced lenses");
    if seeds.is_some() {
        return mismatches(&plan, &|_, _| ()).expect("a table");
    }
    let worlds = [
        (Mismatch::Nothing, VIEWS_ASK),
        (Mismatch::TracedLens, LensModel::Central),
        (Mismatch::TracedLens, VIEWS_ASK),
        (Mismatch::Decentre, VIEWS_ASK),
        (Mismatch::BowedTarget, VIEWS_ASK),
        (Mismatch::ScrewPitch, VIEWS_ASK),
        (Mismatch::RollingShutter, VIEWS_ASK),
        (Mismatch::Focus, VIEWS_ASK),
    ];
    let trial = |(mismatch, model)| Trial::of(mismatch, plan.lens, model, 0).expect("a trial");
    MismatchTable::of(plan, &worlds.map(trial))
}

#[test]
fn what_is_not_caught_is_told_from_what_is() {
    let table = table();
    table.lines().iter().for_each(|line| println!("{line}"));
    let caught = |mismatch| !matches!(table.verdict(mismatch), Verdict::NotCaught { .. });
    let harmless = [
        Mismatch::Nothing,
        Mismatch::TracedLens,
        Mismatch::Decentre,
        Mismatch::BowedTarget,
        Mismatch::ScrewPitch,
        Mismatch::RollingShutter,
    ];
    for mismatch in harmless {
        assert!(caught(mismatch), "{}: {}", mismatch.as_str(), table.verdict(mismatch).sentence());
    }
    // A lens that is longer than at its calibration looks like eyes that are turned. The covariance does not know of it, but a warning does.
    assert!(!caught(Mismatch::Focus), "{}", table.verdict(Mismatch::Focus).sentence());
    let places = (0..MODES.len()).flat_map(|mode| (0..RANGES_MM.len()).map(move |range| (mode, range)));
    for (mode, range) in places {
        let cell = |mismatch, model| table.cell(mismatch, model, mode, range).expect("points");
        let (central, ours) = (cell(Mismatch::TracedLens, LensModel::Central), cell(Mismatch::TracedLens, VIEWS_ASK));
        assert!(central.nees > 1.5 * ours.nees && ours.points > 25, "{central:?} {ours:?}");
        // Nothing that noise explains is beyond the noise.
        let nothing = cell(Mismatch::Nothing, VIEWS_ASK);
        assert!((0.5..2.0).contains(&(nothing.mean_abs_mm / nothing.stated_mm)), "{nothing:?}");
        // Depth by parallax: the bound grows with more than the range.
        let nearer = range.checked_sub(1).and_then(|nearer| table.cell(Mismatch::Nothing, VIEWS_ASK, mode, nearer));
        assert!(nearer.is_none_or(|nearer| nearer.stated_mm < nothing.stated_mm), "{nothing:?}");
    }
    for share in table.paper() {
        assert!(share.bound_mm < share.central_mm && share.share() > 0.05, "{share:?}");
    }
}

/// By the rig files of calibrated benches and the warning that `depth` and `run` print: lenses 0.1 % longer than at their calibration are told of in
/// nearly every cloud, and of clouds without it one in fifty at most comes with a warning.
#[test]
fn lenses_that_grew_are_warned_of_and_others_are_not() {
    let seeds = std::env::var("VERGENCE_SEEDS").ok().and_then(|text| text.parse().ok()).unwrap_or(3);
    let warned = |mismatch: Mismatch| -> usize {
        let lens = MismatchPlan::new(1, TRUE_LENS).expect("traced lenses").lens;
        let trial = |seed| Trial::of(mismatch, lens, VIEWS_ASK, seed).expect("a trial");
        (0..seeds).map(|seed| trial(seed).warned.iter().filter(|warned| **warned).count()).sum()
    };
    let (grown, others) = (warned(Mismatch::Focus), warned(Mismatch::TracedLens));
    let clouds = MODES.len() * seeds as usize;
    println!("of {clouds} clouds by longer lenses {grown} come with a warning, of {clouds} others {others}");
    assert!(10 * grown >= 8 * clouds && 50 * others <= clouds, "{grown} and {others} of {clouds}");
}
