//! Methods of triangulation: computed vectors, and rays that make no point. What noise and slipped matches do to them is
//! compared by the tests of `vergence-reproduce`.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic as tests do")]

use nalgebra::Vector3;
use vergence_vision::{AngularNorm, Kernel, Left, Point, Rejection, Triangulated, UnitRay, angular, edge_plane, mid2};

fn ray(x: f64, y: f64, z: f64) -> UnitRay<Left> {
    UnitRay::new(Vector3::new(x, y, z)).unwrap()
}

fn point(x: f64, y: f64, z: f64) -> Point<Left> {
    Point::from_mm(Vector3::new(x, y, z))
}

/// Evaluated with numpy from Lee and Civera's formulas.
#[test]
fn angular_optima_of_skew_rays() {
    let (u, v, t) = (ray(0.2, 0.05, 1.0), ray(-0.25, -0.02, 1.0), point(145.0, 0.0, 0.0));
    for (norm, expected) in [
        (AngularNorm::L1, [64.31925404, 16.07981351, 321.59627019]),
        (AngularNorm::L2, [64.40596597, 4.94834392, 322.20111915]),
        (AngularNorm::Linf, [64.40643778, 4.88766968, 322.2022995]),
    ] {
        let found = angular(norm, &u, &v, &t).unwrap().point.mm();
        assert!((found - Vector3::from(expected)).amax() < 1e-8, "{norm:?}: {found:?}");
    }
}

#[test]
fn rays_that_make_no_point_are_rejected_by_every_method() {
    use Rejection::{Diverging, OnBaseline, Parallel};
    let t = point(145.0, 0.0, 0.0);
    let cases = [
        (ray(0.0, 0.0, 1.0), ray(0.0, 0.0, 1.0), t, Parallel),
        (ray(0.1, 0.0, 1.0), ray(-0.1, 0.0, 1.0), point(0.0, 0.0, 0.0), OnBaseline),
        (ray(-0.1, 0.0, 1.0), ray(0.1, 0.0, 1.0), t, Diverging),
        (ray(0.0, 0.0, 1.0), ray(0.1, 0.0, 1.0), t, Diverging),
        (ray(0.1, 0.0, -1.0), ray(0.1, 0.0, 1.0), t, Diverging),
    ];
    for (u, v, t, expected) in cases {
        for norm in [AngularNorm::L1, AngularNorm::L2, AngularNorm::Linf] {
            assert_eq!(angular(norm, &u, &v, &t), Err(expected), "{norm:?} {u:?} {v:?}");
        }
        let found = mid2(&u, &v, &t);
        assert!(found == Err(expected) || (expected == OnBaseline && found.is_err()), "{found:?} {u:?} {v:?}");
        let found = edge_plane(&ray(0.0, 1.0, 0.0), &u, &v, &t);
        assert!(found == Err(expected) || (expected == OnBaseline && found.is_err()), "{found:?} {u:?} {v:?}");
    }
    let level = edge_plane(&ray(1.0, 0.0, 0.0), &ray(0.2, 0.0, 1.0), &ray(-0.2, 0.0, 1.0), &t);
    assert_eq!(level, Err(Parallel), "an edge in the epipolar plane fixes no range");
}

#[test]
fn kernel_names_are_parsed_and_printed() {
    for kernel in Kernel::ALL {
        assert_eq!(kernel.to_string().parse::<Kernel>(), Ok(kernel));
    }
    let upright = UnitRay::new(Vector3::new(0.0, 2.0, 0.0)).unwrap();
    assert_eq!("edge-plane:0, 2, 0".parse(), Ok(Kernel::EdgePlane(upright)));
    for wrong in
        ["middle", "edge-plane", "edge-plane:0,1", "edge-plane:0,0,0", "edge-plane:0,up,0", "edge-plane:0,NaN,0"]
    {
        assert!(wrong.parse::<Kernel>().is_err(), "{wrong}");
    }
}

/// 3 m away, a degree of mismatch across the epipolar plane costs the midpoint a ninth of the range.
#[test]
fn far_away_the_midpoint_is_far_too_near() {
    let t = point(145.0, 0.0, 0.0);
    let (u, v) = (ray(72.5, 0.0, 3000.0), ray(-72.5, 3000.0 * 1f64.to_radians().tan(), 3000.0));
    let depth = |made: Triangulated| made.point.mm().z - 3000.0;
    assert!((depth(vergence_vision::midpoint(&u, &v, &t).unwrap()) + 346.0).abs() < 1.0);
    assert!(depth(vergence_vision::pseudo_intersection(&u, &v, &t).unwrap()).abs() < 0.005);
    assert!((depth(angular(AngularNorm::L1, &u, &v, &t).unwrap()) + 0.46).abs() < 0.01);
}
