#![allow(clippy::all)]
use vergence_calibration::LensModel;
use vergence_reproduce::TRUE_LENS;
use vergence_reproduce::mismatch::{Mismatch, MismatchPlan, Trial};
#[test]
fn diag() {
    let var = |n: &str, d: &str| std::env::var(n).unwrap_or(d.into());
    let plan = MismatchPlan::new(1, TRUE_LENS).unwrap();
    let model: LensModel = var("MODEL", "by-evidence").parse().unwrap();
    for name in var("WORLD", "decentred elements").split(',') {
        let m = Mismatch::ALL.into_iter().find(|m| m.as_str() == name).unwrap();
        for seed in 0..var("SEEDS", "3").parse().unwrap() {
            eprintln!("== {name} seed {seed} {model}");
            let t = Trial::of(m, plan.lens, model, seed).unwrap();
            let n: f64 = t.sightings.iter().map(|s| s.square).sum::<f64>() / t.sightings.len() as f64;
            eprintln!("== mean NEES {n:.2} corner {:.4}", t.corner_px);
        }
    }
}
