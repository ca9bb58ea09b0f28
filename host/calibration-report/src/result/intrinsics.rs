//! The result of the calibration of a camera as lines of text and as JSON.

use serde_json::{Value, json};
use vergence_calibration::{IntrinsicsCalibration, LensStep, PupilEvidence, StepEvidence, StepVerdict, TargetWarp};
use vergence_targets::TargetView;
use vergence_vision::{CENTRAL_PARAMETERS, LENS_PARAMETERS};

const NAMES: [&str; LENS_PARAMETERS] = [
    "fx",
    "fy",
    "cx",
    "cy",
    "k1",
    "k2",
    "k3",
    "k4",
    "pupil_e0_mm",
    "pupil_e1_mm",
    "p1",
    "p2",
    "s0",
    "s1",
    "s2",
    "s3",
    "k5",
    "k6",
    "p3",
    "p4",
];

/// How the target bows.
#[must_use]
pub fn bow_in_words(warp: &TargetWarp) -> String {
    let TargetWarp { shape, sigma_mm: [x, y] } = warp;
    format!(
        "the target bows: its middle is {:.3} ± {x:.3} mm over its left and right edges and {:.3} ± {y:.3} mm over its upper and lower ones, \
         away from the camera where positive",
        shape.along_x_mm, shape.along_y_mm
    )
}

/// The same for programs.
#[must_use]
pub(super) fn bow_json(warp: Option<TargetWarp>) -> Value {
    let bow = |warp: TargetWarp| {
        let TargetWarp { shape, sigma_mm } = warp;
        json!({"along_x_mm": shape.along_x_mm, "along_y_mm": shape.along_y_mm, "sigma_mm": sigma_mm})
    };
    warp.map_or(Value::Null, bow)
}

/// What the views say of the pupil.
#[must_use]
pub fn pupil_in_words(pupil: &PupilEvidence) -> String {
    match pupil {
        PupilEvidence::NotAsked => "nothing was asked of the pupil, and the lens counts as central".to_owned(),
        PupilEvidence::Central { gain, sigma_mm } => format!(
            "the lens is central: a pupil that moves would lower chi-squared by {gain:.1} only (30 are asked for; e0 is known to \
             {sigma_mm:.2} mm)"
        ),
        PupilEvidence::Moves { gain, held_out_px: [central, moving] } => format!(
            "the pupil moves with the angle: chi-squared falls by {gain:.0}, and views held out from {central:.4} to {moving:.4} px"
        ),
        PupilEvidence::CannotTell { sigma_mm, .. } => format!(
            "the views cannot tell whether the pupil moves (e0 ± {sigma_mm:.2} mm by them), so that depths are less certain: take a third of \
             the views at 200 to 300 mm, at all angles to the axis"
        ),
    }
}

fn pupil_json(pupil: &PupilEvidence) -> Value {
    match pupil {
        PupilEvidence::NotAsked => json!({"verdict": "not_asked"}),
        PupilEvidence::Central { gain, sigma_mm } => {
            json!({"verdict": "central", "chi_squared_gain": gain, "sigma_mm": sigma_mm})
        }
        PupilEvidence::Moves { gain, held_out_px: [central, moving] } => {
            json!({"verdict": "moves", "chi_squared_gain": gain, "held_out_px": {"central": central, "moving": moving}})
        }
        PupilEvidence::CannotTell { gain, sigma_mm } => {
            json!({"verdict": "cannot_tell", "chi_squared_gain": gain, "sigma_mm": sigma_mm})
        }
    }
}

/// What the views say of parameters that a lens may have.
#[must_use]
pub fn step_in_words(evidence: &StepEvidence) -> String {
    let StepEvidence { step, gain, rms_px: [without, with], held_out_px, verdict } = evidence;
    let what = match step {
        LensStep::PupilGrowth => "a pupil with e1",
        LensStep::Asymmetry => "decentring p and thin prism s",
        LensStep::FurtherTerms => "terms k5 and k6 of its radius",
        LensStep::TargetBow => "a bow",
    };
    let (has, like) = match step {
        LensStep::TargetBow => ("target", "a board that spoils a calibration"),
        _ => ("lens", "a badly mounted lens"),
    };
    let held_out = held_out_px
        .map(|[without, with]| format!(", those of views held out {with:.4} instead of {without:.4} px"))
        .unwrap_or_default();
    let figures = format!("residuals are {with:.4} instead of {without:.4} px{held_out}");
    match verdict {
        StepVerdict::Found => {
            format!("the {has} has {what}: chi-squared falls by {gain:.1} (30 are asked for), {figures}")
        }
        StepVerdict::NotTold => format!(
            "the views do not tell {what}: chi-squared falls by {gain:.1} (30 are asked for), {figures}. It counts as unknown within \
             what is usual, and makes the lens less certain by that"
        ),
        StepVerdict::Absent if *step == LensStep::FurtherTerms => format!(
            "the lens keeps a radius of five terms: with two more chi-squared would fall by {gain:.1} (30 are asked for){held_out}"
        ),
        StepVerdict::Absent => format!(
            "the {has} does not have {what}: chi-squared would fall by {gain:.1} only, and the views would show that of {like}"
        ),
    }
}

fn steps_json(steps: &[StepEvidence]) -> Value {
    let one = |evidence: &StepEvidence| {
        let terms = match evidence.step {
            LensStep::PupilGrowth => "pupil_e1",
            LensStep::Asymmetry => "tangential_and_prism",
            LensStep::FurtherTerms => "radial_k5_and_k6",
            LensStep::TargetBow => "target_bow",
        };
        let [without, with] = evidence.rms_px;
        json!({
            "terms": terms,
            "chi_squared_gain": evidence.gain,
            "rms_px": {"without": without, "with": with},
            "held_out_px": evidence.held_out_px.map(|[without, with]| json!({"without": without, "with": with})),
            "verdict": match evidence.verdict {
                StepVerdict::Found => "found",
                StepVerdict::NotTold => "not_told",
                StepVerdict::Absent => "absent",
            },
        })
    };
    steps.iter().map(one).collect()
}

fn parameters(calibration: &IntrinsicsCalibration) -> [f64; LENS_PARAMETERS] {
    calibration.lens().to_array()
}

fn sigma(calibration: &IntrinsicsCalibration) -> [f64; LENS_PARAMETERS] {
    std::array::from_fn(|index| calibration.covariance[(index, index)].max(0.0).sqrt())
}

/// The result of the calibration of a camera from `views` as lines for people.
#[must_use]
pub fn intrinsics_lines(calibration: &IntrinsicsCalibration, views: &[TargetView]) -> Vec<String> {
    let mut lines = vec![format!(
        "{} of {} corners in {} of {} views: {:.3} px rms ({:.3} px with the outliers), valid to {:.2} from the axis",
        calibration.corners_inlier,
        calibration.corners_total,
        calibration.views_used,
        views.len(),
        calibration.rms_inlier_px,
        calibration.rms_px,
        calibration.camera.theta_max()
    )];
    let named = NAMES.iter().zip(parameters(calibration)).zip(sigma(calibration)).enumerate();
    for (index, ((name, value), sigma)) in named {
        if index < CENTRAL_PARAMETERS || sigma > 0.0 {
            lines.push(format!("  {name} {value:12.5} ± {sigma:.5}"));
        }
    }
    lines.push(format!("  {}", pupil_in_words(&calibration.pupil)));
    lines.extend(calibration.steps.iter().map(|step| format!("  {}", step_in_words(step))));
    lines.extend(calibration.warp.map(|warp| format!("  {}", bow_in_words(&warp))));
    for outlier in &calibration.outliers {
        let name = views.get(outlier.view).map_or("", |view| &view.name);
        let residual = outlier.residual_px.map(|px| format!(" ({px:.2} px)")).unwrap_or_default();
        lines.push(format!("  left out: corner {} of {name}, {}{residual}", outlier.corner, outlier.reason));
    }
    lines
}

/// The result of the calibration of a camera for programs; `seconds` is how long it took.
#[must_use]
pub fn intrinsics_json(calibration: &IntrinsicsCalibration, seconds: f64) -> Value {
    let named = |values: [f64; LENS_PARAMETERS]| -> Value {
        NAMES
            .iter()
            .zip(values)
            .map(|(name, value)| ((*name).to_owned(), json!(value)))
            .collect::<serde_json::Map<_, _>>()
            .into()
    };
    let views: Vec<_> = calibration
        .views
        .iter()
        .map(|view| {
            json!({
                "name": view.name,
                "corners": view.corners,
                "corners_inlier": view.corners_inlier,
                "rms_px": view.rms_px,
                "rms_inlier_px": view.rms_inlier_px,
            })
        })
        .collect();
    json!({
        "rms_px": calibration.rms_px,
        "rms_inlier_px": calibration.rms_inlier_px,
        "corners_total": calibration.corners_total,
        "corners_inlier": calibration.corners_inlier,
        "views_used": calibration.views_used,
        "theta_max_deg": calibration.camera.theta_max().deg(),
        "pixel_sigma": calibration.sigma0_px,
        "view_scatter": calibration.view_scatter,
        "opencv": named(parameters(calibration)),
        "sigma": named(sigma(calibration)),
        "pupil": pupil_json(&calibration.pupil),
        "steps": steps_json(&calibration.steps),
        "target_bow": bow_json(calibration.warp),
        "seconds": seconds,
        "views": views,
    })
}
