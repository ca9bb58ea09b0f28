//! How long lenses take that are computed by the camera models of other programs, beside a polynomial lens, for whole arrays on one thread.
//!
//! `cargo bench -p vergence-vision`
#![allow(
    clippy::expect_used,
    missing_docs,
    reason = "a bench may fail; criterion's macros make items without comments"
)]

#[path = "../tests/foreign_models/mod.rs"]
mod foreign_models;

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use foreign_models::{SIZE, at, kannala_brandt, models};
use vergence_vision::{Asymmetry, BatchLens, ImageSize, KannalaBrandt, SightRegion, fit_lens};

const POINTS: u32 = 4096;

fn lenses() -> Vec<(&'static str, KannalaBrandt)> {
    let foreign = models().into_iter().filter(|(_, model)| model.as_kannala_brandt().is_none()).map(|(name, model)| {
        let size = if name == "OCam" { ImageSize { width: 1040, height: 1024 } } else { SIZE };
        let polynomial = fit_lens(model.as_ref(), SightRegion { size, outline: &[] }).expect("a lens").lens;
        (name, polynomial.computed_by(model, 1.0))
    });
    let by = Asymmetry { tangential: [4e-4, -3e-4], prism: [5e-4, -1e-4, -4e-4, 2e-4] };
    let displaced = kannala_brandt().with_asymmetry(by).expect("a lens");
    [("polynomial", kannala_brandt()), ("polynomial, displaced", displaced)].into_iter().chain(foreign).collect()
}

fn arrays(criterion: &mut Criterion) {
    for (name, lens) in lenses() {
        let field = lens.theta_max().rad().min(1.5);
        let rays =
            (0..POINTS).map(|n| at(field * f64::from(n) / f64::from(POINTS), 2.4 * f64::from(n)).vector().into());
        let (batch, rays) = (BatchLens::new(&lens), rays.collect::<Vec<[f64; 3]>>());
        let pixels = batch.project(&rays);
        let mut group = criterion.benchmark_group(name);
        group.throughput(Throughput::Elements(u64::from(POINTS)));
        group.bench_function("project", |bencher| bencher.iter(|| batch.project(black_box(&rays))));
        group.bench_function("unproject", |bencher| bencher.iter(|| batch.unproject(black_box(&pixels))));
        group.finish();
    }
}

criterion_group!(benches, arrays);
criterion_main!(benches);
