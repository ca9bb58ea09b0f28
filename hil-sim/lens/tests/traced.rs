//! A traced lens before a sensor against rays traced one by one, and against itself.
#![allow(clippy::expect_used, clippy::print_stdout, reason = "a test fails loudly and shows its figures")]

use std::sync::{Arc, OnceLock};

use nalgebra::{UnitQuaternion, Vector3};
use proptest::prelude::*;
use vergence_lens::{
    BuiltIn, Design, DisplacedDesign, Displacement, ImageScale, LensTable, Limits, Sensor, TracedLens,
};
use vergence_vision::{Angle, Camera, ImageSize, Left, Length, Pixel, Point, Transform};

const PIXELS_PER_RADIAN: f64 = 599.0;
const SENSOR: Sensor = Sensor {
    size: ImageSize { width: 2048, height: 2048 },
    centre: Pixel { u: 1023.1, v: 1025.4 },
    pixel: Length::from_mm(0.0024),
};

const MOUNTED: Displacement = Displacement {
    decentre: Length::from_mm(0.005),
    tilt: Angle::from_deg(0.03),
    sensor_tilt: Angle::from_deg(0.2),
    seed: 3,
};

fn lens(design: BuiltIn) -> TracedLens {
    let table = LensTable::built_in(design).expect("a table");
    TracedLens::new(table, ImageScale::OnAxis(PIXELS_PER_RADIAN), SENSOR, Angle::from_deg(98.0))
}

fn design(lens: BuiltIn) -> Design {
    lens.design().expect("a design").with_focal_length(PIXELS_PER_RADIAN * SENSOR.pixel.mm())
}

/// Angles between the knots of the curves, to the edge of the field.
#[test]
fn chief_rays_traced_one_by_one_arrive_where_the_table_says() {
    for built_in in BuiltIn::ALL {
        let (lens, design) = (lens(built_in), design(built_in));
        let (mut worst_px, mut worst_pupil_px) = (0.0_f64, 0.0_f64);
        for number in 0..230 {
            let theta = Angle::from_deg(0.11 + 0.4253 * f64::from(number));
            let ray = design.chief_ray(theta).expect("a chief ray");
            let [x, _] = design.on_image(&ray, Limits::None).expect("an image");
            // The design's z runs into the lens, the camera's out of it. The chief ray arrives on the other side of the axis.
            let crossing = ray.at.z - ray.at.x * ray.along.z / ray.along.x;
            let shift = design.entrance_pupil() - crossing;
            worst_px = worst_px.max((lens.radius_px(theta) - x.abs() / SENSOR.pixel.mm()).abs());
            let pupil_mm = (lens.pupil(theta).mm() - shift).abs();
            // What an error of the pupil moves at the nearest range.
            worst_pupil_px = worst_pupil_px.max(pupil_mm * theta.rad().sin() / 200.0 * PIXELS_PER_RADIAN);
            for range in [50.0, 350.0, 1e6] {
                let [away, along] = [theta.rad().sin(), theta.rad().cos()];
                let point = Point::from_mm(Vector3::new(0.0, -range * away, shift + range * along));
                let at = lens.project(&point).expect("in the field");
                let off = (at.u - SENSOR.centre.u).hypot(SENSOR.centre.v - at.v - x.abs() / SENSOR.pixel.mm());
                assert!(off < 1e-4, "{}: {off} px at {} deg, {range} mm", lens.name(), theta.deg());
            }
        }
        println!("{}: {worst_px:.1e} px, pupil {worst_pupil_px:.1e} px at 200 mm", lens.name());
        assert!(worst_px < 1e-4 && worst_pupil_px < 1e-4, "{worst_px}, {worst_pupil_px}");
    }
}

#[test]
fn the_scale_is_as_asked() {
    let table = LensTable::built_in(BuiltIn::Sigma8).expect("a table");
    let lens = TracedLens::new(Arc::clone(&table), ImageScale::At98Degrees(1024.0), SENSOR, Angle::from_deg(120.0));
    assert!((lens.radius_px(Angle::from_deg(98.0)) - 1024.0).abs() < 1e-9);
    // The height at 98 degrees is 1.465 focal lengths.
    let on_axis = lens.pixels_per_radian(Angle::from_deg(0.0));
    assert!((on_axis - 699.0).abs() < 1.0, "{on_axis}");
    assert!(lens.theta_max().deg() < 98.6, "it ends with the field of the design");
    let nearest = lens.pupil(Angle::from_deg(98.0)).mm();
    assert!((nearest - 2.13 * on_axis / PIXELS_PER_RADIAN).abs() < 0.02, "{nearest}");
}

#[test]
fn light_and_spots_are_those_of_the_design() {
    let (lens, design) = (lens(BuiltIn::Sigma8), design(BuiltIn::Sigma8).stopped_down(2.8));
    for deg in [0.0, 33.0, 71.0, 93.0] {
        let theta = Angle::from_deg(deg);
        let spot = design.spot(theta, Limits::Rims).expect("a spot");
        let [radial, tangential] = lens.spot_px(theta).map(|px| px * SENSOR.pixel.mm());
        assert!((radial - spot.radial).abs() < 2e-5 && (tangential - spot.tangential).abs() < 2e-5, "{deg}: {spot:?}");
        let centroid = (lens.clone().by_centroid().radius_px(theta) - lens.radius_px(theta)) * SENSOR.pixel.mm();
        assert!((centroid - spot.centroid_from_chief).abs() < 2e-5, "{deg}: {centroid} {spot:?}");
    }
    let [middle, edge] = [0.0, 97.0].map(|deg| lens.illumination(Angle::from_deg(deg)));
    assert!((middle - 1.0).abs() < 1e-9 && edge < 0.95 && edge > 0.3, "{middle} {edge}");
}

#[test]
fn corners_of_a_target_lie_where_their_light_arrives() {
    let lens = lens(BuiltIn::Sigma8);
    let turn = UnitQuaternion::from_euler_angles(0.3, 1.2, -0.4);
    let camera_from_target: Transform<Camera, Left> = Transform::new(turn, Vector3::new(260.0, -40.0, 60.0));
    let corner = |number: i32| Point::from_mm(Vector3::new(f64::from(number % 9), f64::from(number / 9), 0.0) * 25.0);
    let corners: Vec<Point<Left>> = (0..54).map(corner).collect();
    let pixels = lens.project_target(&camera_from_target, &corners);
    let seen =
        pixels.iter().zip(&corners).filter_map(|(pixel, corner)| Some(((*pixel)?, camera_from_target * *corner)));
    let off = seen.map(|(pixel, corner)| {
        let ray = lens.ray(pixel).expect("light");
        (corner.mm() - ray.origin.mm()).cross(&ray.direction.vector()).norm()
    });
    let off: Vec<f64> = off.collect();
    assert!(off.len() > 25 && off.iter().all(|mm| *mm < 1e-9), "{off:?}");
    let behind = Transform::new(UnitQuaternion::identity(), Vector3::new(0.0, 0.0, -300.0));
    assert!(lens.project_target(&behind, &corners).iter().all(Option::is_none));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]
    #[test]
    fn the_image_of_a_point_on_the_ray_of_a_pixel_is_that_pixel(
        theta in 0.0..97.5_f64, turn in 0.0..6.3_f64, log_range in 1.7..6.0_f64, number in 0..BuiltIn::ALL.len(), centroid: bool,
        mounted: bool,
    ) {
        static LENSES: OnceLock<[[TracedLens; 2]; BuiltIn::ALL.len()]> = OnceLock::new();
        let both = |design| [lens(design), lens(design).displaced(&MOUNTED).expect("a lens")];
        let lens = LENSES.get_or_init(|| BuiltIn::ALL.map(both))[number][usize::from(mounted)].clone();
        let lens = if centroid { lens.by_centroid() } else { lens };
        let radius = lens.radius_px(Angle::from_deg(theta));
        let pixel = Pixel { u: SENSOR.centre.u + radius * turn.cos(), v: SENSOR.centre.v + radius * turn.sin() };
        let ray = lens.ray(pixel).expect("inside of the field");
        let point = Point::from_mm(ray.origin.mm() + ray.direction.vector() * 10_f64.powf(log_range));
        let again = lens.project(&point).expect("inside of the field");
        let off = (again.u - pixel.u).hypot(again.v - pixel.v);
        prop_assert!(off < 1e-9, "{off} px");
    }
}

/// As badly mounted as a cheap lens, and twice as well.
#[test]
fn a_displaced_lens_images_as_its_rays_traced_one_by_one() {
    for (micrometres, tilt, sensor_tilt, seed) in [(5.0, 0.03, 0.2, 1), (10.0, 0.05, 0.4, 2)] {
        let by = Displacement {
            decentre: Length::from_mm(1e-3 * micrometres),
            tilt: Angle::from_deg(tilt),
            sensor_tilt: Angle::from_deg(sensor_tilt),
            seed,
        };
        let design = design(BuiltIn::Sigma8);
        let (symmetric, lens) = (lens(BuiltIn::Sigma8), lens(BuiltIn::Sigma8).displaced(&by).expect("a lens"));
        let mounted = DisplacedDesign::new(&design, &by);
        let (mut worst, mut moved, mut again) = (0.0_f64, 0.0_f64, 0.0_f64);
        for number in 1..160 {
            let (theta, turn) = (Angle::from_deg(0.61 * f64::from(number)), Angle::from_rad(2.4 * f64::from(number)));
            let ray = mounted.chief_ray(theta, turn).expect("a chief ray");
            let traced = mounted.on_sensor(&ray).expect("an image").map(|mm| mm / SENSOR.pixel.mm());
            // A camera's x and y run against the light's.
            let from = Vector3::new(
                turn.rad().cos() * theta.rad().sin(),
                turn.rad().sin() * theta.rad().sin(),
                theta.rad().cos(),
            );
            let far = Point::from_mm(from * 1e12);
            let at = lens.project(&far).expect("in the field");
            worst = worst.max((at.u - SENSOR.centre.u - traced[0]).hypot(at.v - SENSOR.centre.v - traced[1]));
            let before = symmetric.project(&far).expect("in the field");
            moved = moved.max((at.u - before.u).hypot(at.v - before.v));
            let light = lens.ray(at).expect("light");
            again = again.max((light.direction.vector() - from).norm() * PIXELS_PER_RADIAN);
        }
        println!(
            "{micrometres} um: {worst:.1e} px off, image moved by up to {moved:.2} px, back to the ray within {again:.1e} px"
        );
        assert!(worst < 4e-4 && again < 1e-6 && moved > 0.5, "{worst} {again} {moved}");
    }
}

/// Where the direction across the axis is none.
#[test]
fn a_displaced_lens_moves_the_light_on_its_axis_as_that_beside_it() {
    for design in BuiltIn::ALL {
        let lens = lens(design).displaced(&MOUNTED).expect("a lens");
        let image = |x: f64, y: f64| lens.project(&Point::from_mm(Vector3::new(x, y, 350.0))).expect("in the field");
        let on_axis = image(0.0, 0.0);
        for (x, y) in [(1e-7, 0.0), (0.0, 1e-7), (-1e-7, -1e-7)] {
            let beside = image(x, y);
            let apart = (beside.u - on_axis.u).hypot(beside.v - on_axis.v);
            assert!(apart < 1e-3, "{apart} px at ({x}, {y}), {on_axis:?}");
        }
        let moved = (on_axis.u - SENSOR.centre.u).hypot(on_axis.v - SENSOR.centre.v);
        assert!(moved > 0.5, "{moved} px");
    }
}

/// What is kept for the next photograph is of this very lens, and of no one that it was made from.
#[test]
fn kept_directions_are_those_of_the_lens_at_hand() {
    let pixels: Vec<[f64; 2]> = (0..40).map(|i| [25.0 * f64::from(i) + 100.0, 500.0]).collect();
    let whole = lens(BuiltIn::Sigma8);
    let kept_first = |lens: &TracedLens| lens.kept_directions(&pixels);
    kept_first(&whole);
    let changed = [
        whole.clone().by_centroid(),
        whole.clone().displaced(&MOUNTED).expect("a lens"),
        whole.before_part([40, 30], ImageSize { width: 900, height: 900 }),
        whole.clone().bare(),
        whole,
    ];
    let bits = |rays: &[[f64; 3]]| rays.as_flattened().iter().map(|number| number.to_bits()).collect::<Vec<_>>();
    for lens in &changed {
        assert!(bits(&kept_first(lens)) == bits(&lens.directions(&pixels)), "{lens:?}");
        assert!(bits(&lens.kept_directions(&pixels[..7])) == bits(&lens.directions(&pixels[..7])));
    }
}
