//! What the figures of a camera test mean: verdict, reason and remedy.

use vergence_board::Finding;
use vergence_camera::{ImageQuality, UsbLink};
use vergence_vision::Side;

use crate::figures::{CameraFigures, TestFigures, TriggerFigures};

/// Largest part of the images that may be lost now and then.
const LOST: f64 = 0.01;
/// Largest deviation of the rate from what is promised.
const RATE: f64 = 0.05;
/// Largest jitter, as a part of the time from image to image.
const JITTER: f64 = 0.1;
/// Mean grey levels outside of which an image is hardly exposed.
const LEVELS: [f64; 2] = [25.0, 225.0];
/// Largest parts of the field that may be saturated and black.
const SATURATED: f64 = 0.1;
const BLACK: f64 = 0.6;
/// Variance of the Laplacian of 8-bit images below which nothing in them is sharp: that of the noise alone of a standard deviation of one level is 20.
const BLURRED: f64 = 20.0;
/// Two cameras that see the same room are about equally sharp; more than this factor apart, one is out of focus.
const UNLIKE: f64 = 4.0;
/// Part of a USB bus beyond which images are at risk.
const TIGHT: f64 = 0.8;
/// Part of the images that may lack a partner.
const ALONE: f64 = 0.05;
/// Differences of stamps beyond this part of their bound are near to being no pair.
const NEAR_BOUND: f64 = 0.5;

/// Every finding on both cameras.
#[must_use]
pub fn check_test(test: &TestFigures) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (side, camera) in [Side::Left, Side::Right].into_iter().zip(&test.cameras) {
        findings.push(images(side, camera));
        if camera.images == 0 {
            continue;
        }
        findings.extend(rate(side, camera));
        findings.extend(camera.looks.map(|looks| exposure(side, looks)));
        findings.extend(camera.trigger.map(|trigger| triggered(side, trigger)));
    }
    findings.extend(sharpness(test.cameras.each_ref().map(|camera| camera.looks)));
    findings.extend(check_bandwidth(test.cameras.each_ref().map(|camera| (camera.mb_per_s(), camera.usb))));
    if test.cameras.iter().all(|camera| camera.images > 0) {
        findings.push(pairing(test));
    }
    findings
}

fn images(side: Side, camera: &CameraFigures) -> Finding {
    let CameraFigures { images, lost, .. } = *camera;
    let remedy = "check cable and power, use a USB 3 port of its own, a smaller --size or a lower --rate";
    if let Some(trouble) = camera.troubles.first() {
        return Finding::fail(
            "images",
            format!("{side} camera: {trouble}"),
            "mend what the reason says, then test again",
        );
    }
    if images == 0 {
        let remedy = "where the trigger fires it, check the wire of the trigger and that the camera waits for it; or test with --free";
        return Finding::fail("images", format!("{side} camera: no image came"), remedy);
    }
    let reason = format!("{side} camera: {images} images came, {lost} were lost on the way");
    match lost as f64 / (images as f64 + lost as f64) {
        0.0 => Finding::pass("images", reason),
        share if share <= LOST => Finding::warn("images", reason, remedy),
        _ => Finding::fail("images", reason, remedy),
    }
}

fn rate(side: Side, camera: &CameraFigures) -> Option<Finding> {
    let (rate, expected) = (camera.rate_hz?, camera.expected_hz?);
    let jitter = camera.jitter_ms.unwrap_or_default();
    let reason = format!("{side} camera: {rate:.2} images a second of {expected:.2} wanted, jitter {jitter:.2} ms");
    let (period_ms, who) = (1e3 / expected, if camera.trigger.is_some() { "trigger" } else { "driver" });
    Some(if (rate / expected - 1.0).abs() > RATE {
        let remedy = match who {
            "trigger" => "fire more slowly (--rate), or shorten exposure and readout: the camera misses pulses",
            _ => "shorten --exposure: in the dark a camera lowers its rate; else it cannot keep it at this --size",
        };
        Finding::warn("rate", reason, remedy)
    } else if jitter > JITTER * period_ms {
        Finding::warn("rate", reason, "fire the cameras by the board's trigger, and see whether the computer is busy")
    } else {
        Finding::pass("rate", reason)
    })
}

fn exposure(side: Side, looks: ImageQuality) -> Finding {
    let ImageQuality { mean, saturated, black, .. } = looks;
    let percent = |part: f64| format!("{:.1} %", part * 100.0);
    let reason = format!(
        "{side} camera: mean level {mean:.0} of 255, {} saturated, {} black inside the field",
        percent(saturated),
        percent(black)
    );
    let [dark, bright] = LEVELS;
    if black > 0.99 {
        return Finding::fail("exposure", reason, "take the lens cap off, and lengthen --exposure");
    }
    if saturated > 0.99 {
        return Finding::fail("exposure", reason, "shorten --exposure, lower --gain, or close the iris");
    }
    if mean < dark || black > BLACK {
        return Finding::warn("exposure", reason, "lengthen --exposure, raise --gain, or add light");
    }
    if mean > bright || saturated > SATURATED {
        return Finding::warn(
            "exposure",
            reason,
            "shorten --exposure or lower --gain: nothing is matched where all is white",
        );
    }
    Finding::pass("exposure", reason)
}

/// Sharpness of both images, which show about the same.
fn sharpness(looks: [Option<ImageQuality>; 2]) -> Option<Finding> {
    let [left, right] = looks.map(|looks| looks.map(|looks| looks.sharpness));
    let (left, right) = (left?, right?);
    let reason = format!("variance of the Laplacian {left:.0} in the left image and {right:.0} in the right one");
    let (least, side) = if left < right { (left, Side::Left) } else { (right, Side::Right) };
    Some(if least < BLURRED {
        Finding::warn("sharpness", reason, format!("focus the {side} lens on something with texture, and wipe it"))
    } else if left.max(right) > UNLIKE * least {
        Finding::warn("sharpness", reason, format!("focus the {side} lens as well as the other one, and wipe it"))
    } else {
        Finding::pass("sharpness", reason)
    })
}

/// Whether the buses carry what the cameras send, in megabytes per second each.
#[must_use]
pub fn check_bandwidth(cameras: [(Option<f64>, Option<UsbLink>); 2]) -> Vec<Finding> {
    let [(Some(left), left_usb), (Some(right), right_usb)] = cameras else {
        let sent = cameras.iter().any(|(sent, _)| sent.is_some());
        let none = Finding::pass("bandwidth", "the images come over no cable: they are simulated or from files");
        return if sent { Vec::new() } else { vec![none] };
    };
    let judged = |sent: f64, usb: UsbLink, whose: &str| {
        let share = sent / usb.usable_mb_per_s();
        let reason = format!(
            "{whose}: {sent:.1} MB/s of some {:.0} that {usb} carries ({:.0} %)",
            usb.usable_mb_per_s(),
            share * 100.0
        );
        let remedy = match usb.mbit_per_s > 480.0 {
            false => "use USB 3 ports and cables, one bus for each camera, a smaller --size, a lower --rate, or MJPG",
            true => "use a bus for each camera, a smaller --size, or a lower --rate",
        };
        match share {
            share if share > 1.0 => Finding::fail("bandwidth", reason, remedy),
            share if share > TIGHT => Finding::warn("bandwidth", reason, remedy),
            _ => Finding::pass("bandwidth", reason),
        }
    };
    match (left_usb, right_usb) {
        (Some(one), Some(other)) if one.bus == other.bus => {
            let slower = if one.mbit_per_s < other.mbit_per_s { one } else { other };
            vec![judged(left + right, slower, "both cameras on one bus")]
        }
        (left_usb, right_usb) => [(left, left_usb, "left camera"), (right, right_usb, "right camera")]
            .into_iter()
            .map(|(sent, usb, whose)| match usb {
                Some(usb) => judged(sent, usb, whose),
                None => Finding::pass("bandwidth", format!("{whose}: {sent:.1} MB/s, not over USB")),
            })
            .collect(),
    }
}

fn triggered(side: Side, trigger: TriggerFigures) -> Finding {
    let TriggerFigures { pulses, paired, ambiguous, arrival, stamp } = trigger;
    let remedy = "check the wire of the trigger, and that the camera exposes at its rising edge; see 'vergence devices' for its controls";
    let (Some(arrival), Some(stamp)) = (arrival, stamp) else {
        let reason = format!("{side} camera: of {pulses} pulses none has an image");
        return match ambiguous {
            0 => Finding::fail("trigger", reason, remedy),
            _ => Finding::fail(
                "trigger",
                format!("{reason} that is surely its own: the instant of exposures is known too badly for this rate"),
                "give --exposure and --readout, or fire more slowly (--rate)",
            ),
        };
    };
    let reason = format!(
        "{side} camera: {paired} of {pulses} pulses have an image; its exposure is {:.1} ms after the pulse (at most {:.1}), its arrival {:.1} ms (at most {:.1})",
        stamp.median_ms, stamp.most_ms, arrival.median_ms, arrival.most_ms
    );
    match (pulses.saturating_sub(paired)) as f64 / (pulses as f64).max(1.0) {
        share if share <= LOST => Finding::pass("trigger", reason),
        share if share <= ALONE => Finding::warn("trigger", reason, remedy),
        _ => Finding::fail(
            "trigger",
            reason,
            "fire more slowly (--rate), or check the wire of the trigger: pulses are missed",
        ),
    }
}

fn pairing(test: &TestFigures) -> Finding {
    let how = if test.by_trigger { "by the pulses of the trigger" } else { "by time" };
    let bound = test.bound_ms.map_or_else(String::new, |bound| format!(", bound {bound:.1} ms"));
    let remedy = match test.by_trigger {
        true => "give --exposure and --readout, so that images find their pulses",
        false => "let the board fire both cameras, or give both the same rate; a moving rig needs the trigger",
    };
    let Some(difference) = test.difference else {
        return Finding::fail(
            "pairing",
            format!("no image of the left camera has one of the right camera {how}{bound}"),
            remedy,
        );
    };
    let reason = format!(
        "{} pairs {how}, {} images alone; stamps {:.2} ms apart (at most {:.2}{bound})",
        test.pairs, test.alone, difference.median_ms, difference.most_ms
    );
    let share = test.alone as f64 / (test.pairs + test.alone) as f64;
    let is_near = !test.by_trigger && test.bound_ms.is_some_and(|bound| difference.most_ms > NEAR_BOUND * bound);
    match share {
        share if share > 0.5 => Finding::fail("pairing", reason, remedy),
        share if share > ALONE || is_near => Finding::warn("pairing", reason, remedy),
        _ => Finding::pass("pairing", reason),
    }
}

#[cfg(test)]
mod tests {
    use vergence_board::Verdict;

    use super::*;
    use crate::figures::Step;

    fn usb(bus: u32, mbit_per_s: f64) -> Option<UsbLink> {
        Some(UsbLink { bus, mbit_per_s })
    }

    fn verdicts(found: &[Finding]) -> Vec<Verdict> {
        found.iter().map(|finding| finding.verdict).collect()
    }

    /// A camera of 1280 x 960 pixels of one byte at 30 Hz sends 36.9 MB/s.
    #[test]
    fn cameras_that_share_a_bus_share_its_bandwidth() {
        let sent = Some(36.9);
        let both = |left, right| verdicts(&check_bandwidth([(sent, left), (sent, right)]));
        assert_eq!(both(usb(1, 480.0), usb(1, 480.0)), [Verdict::Fail]);
        assert_eq!(both(usb(1, 480.0), usb(3, 480.0)), [Verdict::Warn, Verdict::Warn]);
        assert_eq!(both(usb(2, 5000.0), usb(2, 5000.0)), [Verdict::Pass]);
        assert_eq!(both(None, None), [Verdict::Pass, Verdict::Pass]);
        assert_eq!(verdicts(&check_bandwidth([(None, None), (None, None)])), [Verdict::Pass]);
    }

    fn healthy() -> CameraFigures {
        let step = |median_ms| Some(Step { median_ms, most_ms: median_ms + 1.0 });
        CameraFigures {
            images: 30,
            lost: 0,
            rate_hz: Some(10.0),
            expected_hz: Some(10.0),
            jitter_ms: Some(0.2),
            looks: Some(ImageQuality { mean: 110.0, saturated: 0.01, black: 0.02, sharpness: 300.0 }),
            bytes: None,
            usb: None,
            trigger: Some(TriggerFigures {
                pulses: 30,
                paired: 30,
                ambiguous: 0,
                arrival: step(16.0),
                stamp: step(3.0),
            }),
            troubles: Vec::new(),
        }
    }

    fn test(left: CameraFigures) -> TestFigures {
        let difference = Some(Step { median_ms: 0.1, most_ms: 0.3 });
        TestFigures {
            cameras: [left, healthy()],
            timing: [None, None],
            pairs: 30,
            alone: 0,
            difference,
            bound_ms: Some(1.0),
            by_trigger: true,
        }
    }

    /// Each fault of the left camera turns the verdict of its check, and of no other.
    #[test]
    fn every_fault_of_a_camera_is_found() {
        assert!(check_test(&test(healthy())).iter().all(|finding| finding.verdict == Verdict::Pass));
        let looks = |change: fn(&mut ImageQuality)| {
            let mut looks = healthy().looks.expect("there");
            change(&mut looks);
            CameraFigures { looks: Some(looks), ..healthy() }
        };
        let trigger = |change: fn(&mut TriggerFigures)| {
            let mut trigger = healthy().trigger.expect("there");
            change(&mut trigger);
            CameraFigures { trigger: Some(trigger), ..healthy() }
        };
        let cases = [
            ("images", Verdict::Fail, CameraFigures { lost: 3, ..healthy() }),
            ("images", Verdict::Fail, CameraFigures { troubles: vec!["unplugged".into()], ..healthy() }),
            ("rate", Verdict::Warn, CameraFigures { rate_hz: Some(7.5), ..healthy() }),
            ("rate", Verdict::Warn, CameraFigures { jitter_ms: Some(15.0), ..healthy() }),
            ("exposure", Verdict::Fail, looks(|looks| looks.black = 1.0)),
            ("exposure", Verdict::Warn, looks(|looks| looks.mean = 10.0)),
            ("exposure", Verdict::Warn, looks(|looks| looks.saturated = 0.3)),
            ("sharpness", Verdict::Warn, looks(|looks| looks.sharpness = 60.0)),
            ("sharpness", Verdict::Warn, looks(|looks| looks.sharpness = 6.0)),
            ("trigger", Verdict::Fail, trigger(|trigger| trigger.paired = 15)),
            ("trigger", Verdict::Fail, trigger(|trigger| trigger.arrival = None)),
        ];
        for (check, verdict, left) in cases {
            let found = check_test(&test(left.clone()));
            let bad: Vec<_> = found.iter().filter(|finding| finding.verdict != Verdict::Pass).collect();
            assert_eq!(bad.len(), 1, "{left:?}: {bad:?}");
            assert_eq!((bad[0].check, bad[0].verdict), (check, verdict), "{left:?}");
            assert!(bad[0].remedy.is_some());
        }
    }

    #[test]
    fn cameras_out_of_step_and_a_camera_that_is_silent_fail() {
        let silent = check_test(&test(CameraFigures { images: 0, ..CameraFigures::default() }));
        assert!(silent.iter().any(|finding| finding.check == "images" && finding.verdict == Verdict::Fail));
        let free = TestFigures { by_trigger: false, pairs: 10, alone: 20, ..test(healthy()) };
        assert!(check_test(&free).iter().any(|found| found.check == "pairing" && found.verdict == Verdict::Fail));
        let near = TestFigures {
            by_trigger: false,
            bound_ms: Some(16.0),
            difference: Some(Step { median_ms: 12.0, most_ms: 13.0 }),
            ..test(healthy())
        };
        assert!(check_test(&near).iter().any(|found| found.check == "pairing" && found.verdict == Verdict::Warn));
    }
}
