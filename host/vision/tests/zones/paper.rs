//! Zones of the paper's modes and of its printed equation.

use vergence_vision::{Angle, Length, PUBLISHED_MODES, paper_eq3};

use super::{FIELD, PRINTED, Rig, assert_near, degrees, exact, rig};

fn paper(r: Rig) -> [f64; 3] {
    let [field, separation] = [r.field, r.separation].map(Angle::from_deg);
    degrees(paper_eq3(field, separation, Length::from_mm(r.baseline), Length::from_mm(r.radius)))
}

#[test]
fn modes_with_nominal_baseline_and_separation() {
    // In the order of the published modes.
    let nominal = [
        ([192.66, 6.59, 160.76], None),
        ([57.15, 236.65, 66.19], Some([55.80, 209.46, 94.75])),
        ([73.77, 239.62, 46.62], Some([73.60, 208.27, 78.13])),
        ([134.91, 119.33, 105.75], Some([134.62, 88.39, 136.99])),
        ([156.53, 80.72, 122.75], None),
    ];
    for (mode, (by_counting, by_equation)) in PUBLISHED_MODES.into_iter().zip(nominal) {
        let rig = rig(mode.baseline.mm(), mode.separation.deg(), mode.radius.mm());
        assert_near(exact(rig), by_counting, PRINTED, mode.name);
        if let Some(expected) = by_equation {
            assert_near(paper(rig), expected, PRINTED, mode.name);
            let printed = [mode.stereo.deg(), mode.mono.unwrap().deg()];
            // The nominal pose is not that of the paper, but near it.
            assert!((printed[0] - expected[0]).abs() < 2.5 && (printed[1] - expected[1]).abs() < 2.5, "{}", mode.name);
        }
    }
    let table = [
        (rig(380.0, -40.0, 3000.0), [157.46, 81.89, 120.65]),
        (Rig { field: 191.95, ..rig(145.0, 0.0, 350.0) }, [189.48, 4.94, 165.58]),
        (Rig { field: 199.95, ..rig(145.0, 0.0, 350.0) }, [195.84, 8.23, 155.94]),
    ];
    for (rig, by_counting) in table {
        assert_near(exact(rig), by_counting, PRINTED, rig);
    }
}

/// Baseline and separation are themselves fitted to the published figures and rounded: to 0.1 mm and 0.01°.
#[test]
fn modes_with_fitted_baseline_and_separation() {
    let table = [
        (rig(145.4, 119.76, 350.0), [57.37, 236.16, 66.47], [56.00, 209.00, 95.00]),
        (rig(32.1, 119.43, 3000.0), [76.04, 238.78, 45.19], [76.0, 207.0, 77.0]),
        (rig(62.0, 59.39, 3000.0), [136.12, 118.49, 105.39], [136.0, 87.0, 137.0]),
    ];
    for (rig, by_counting, by_equation) in table {
        assert_near(exact(rig), by_counting, 0.02, rig);
        assert_near(paper(rig), by_equation, 0.02, rig);
    }
}

#[test]
fn half_circle_lenses_have_mono_zones_of_twice_the_separation() {
    for (separation, expected) in
        [(20.0, [155.877, 40.0, 164.123]), (60.0, [108.110, 120.0, 131.890]), (120.0, [39.331, 240.0, 80.669])]
    {
        assert_near(exact(Rig { field: 180.0, ..rig(145.0, separation, 350.0) }), expected, 0.0005 + 1e-9, separation);
    }
}

#[test]
fn the_published_human_stereo_angle_bounds_the_baseline() {
    for (baseline, stereo) in [(129.9, 193.00), (108.0, 193.5), (152.0, 192.5)] {
        let [found, ..] = exact(rig(baseline, 0.0, 350.0));
        assert!((found - stereo).abs() < 0.01, "{baseline} mm: {found}");
    }
}

#[test]
fn the_printed_equation_fails_outside_its_domain() {
    let [stereo, mono, _] = paper(rig(145.0, 0.0, 350.0));
    assert!((stereo - 201.6).abs() < 0.05 && (mono + 34.3).abs() < 0.05, "{stereo} {mono}");
}

/// Equation as printed minus exact, for u = field - separation, at b = 0.024 (R = 3 m), at b = 0.207 (R = 350 mm), and
/// the worst over all b. None depends on the field itself; with 180° the fields never overlap at the rear.
#[test]
fn the_printed_stereo_angle_falls_short_by_the_stated_amounts() {
    for (u, far, near, worst) in [
        (30.0, -0.03, -0.11, -0.13),
        (56.0, -0.10, -0.74, -0.88),
        (76.0, -0.17, -1.36, -2.24),
        (100.0, -0.25, -2.08, -5.29),
        (136.0, -0.29, -2.48, -10.95),
        (156.0, -0.22, -1.93, -9.16),
    ] {
        let error = |b| {
            let rig = Rig { field: 180.0, ..rig(145.0, 180.0 - u, 72.5 / b) };
            paper(rig)[0] - exact(rig)[0]
        };
        // At 1 the cameras are on the circle.
        let largest_b = (u / 2.0f64).to_radians().tan().min(1.0 - 1e-6);
        let lowest = (1..=2000).map(|i| error(largest_b * f64::from(i) / 2000.0)).fold(0.0, f64::min);
        for (found, expected) in [(error(0.024), far), (error(0.207), near), (lowest, worst)] {
            assert!((found - expected).abs() <= PRINTED, "u = {u}: {found}, expected {expected}");
        }
    }
}

/// The fields' inner edges cross on the midline at (B / 2) cot(u / 2); nearer there is no stereo in front.
#[test]
fn the_domain_of_the_printed_equation_ends_where_stereo_vanishes() {
    let u = (FIELD - 120.0f64).to_radians();
    let radius = 72.5 / (u / 2.0).tan();
    let at = |radius| rig(145.0, 120.0, radius);
    assert!(paper(at(radius))[0].abs() < 1e-9 && exact(at(radius))[0] < 1e-5);
    assert!(exact(at(radius * 1.01))[0] > 0.1);
}

/// As printed, the blind zone of the far field is too large by twice what the lens sees past 180°.
#[test]
fn the_printed_blind_angle_is_exact_only_for_half_circle_lenses() {
    let far = |field| Rig { field, ..rig(145.0, 120.0, 1e9) };
    let excess = |field| paper(far(field))[2] - exact(far(field))[2];
    assert!((excess(FIELD) - 31.9).abs() < 1e-4 && excess(180.0).abs() < 1e-4);
}
