//! The TMC2209's line: published datagrams, and the supervisor against simulated drivers.

#![allow(clippy::unwrap_used, reason = "a test ends by panicking")]

use vergence_control::driver::{ADDRESSES, DriverLine, Register, request, value_of, write};
use vergence_control::{AxisSettings, HomeSensor, SwitchSettings};
use vergence_control::{DriverKind, DriverSettings};
use vergence_plant::{DriverFaults, Drivers, bench_settings};
use vergence_protocol::{DriverState, FaultCode, Microseconds};

/// Time of an exchange on the line, in microseconds.
const EXCHANGE_US: u64 = 500;

/// Datagrams that others have published: the first request of every tool, an answer of IOIN as a logic analyser saw it
/// (its request had bits in the reserved nibble), and the delivered CHOPCONF written.
#[test]
fn datagrams_are_those_that_others_have_published() {
    assert_eq!(request(0, Register::GConf), [0x05, 0x00, 0x00, 0x48]);
    assert_eq!(write(0, Register::ChopConf, 0x1000_0053), [0x05, 0x00, 0xEC, 0x10, 0x00, 0x00, 0x53, 0x9C]);
    let answer = [0x05, 0xFF, 0x06, 0x21, 0x00, 0x02, 0x41, 0x9D];
    assert_eq!(value_of(&answer, Register::IoIn), Some(0x2100_0241));
    assert_eq!(value_of(&answer, Register::GStat), None, "it is about another register");
    assert_eq!(value_of(&answer[..7], Register::IoIn), None);
    for bit in 0..64 {
        let mut wrong = answer;
        wrong[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(value_of(&wrong, Register::IoIn), None, "bit {bit} is wrong");
    }
}

fn tmc() -> DriverSettings {
    DriverSettings { kind: DriverKind::Tmc2209, ..DriverSettings::default() }
}

/// A line with a supervisor and drivers.
struct Bench {
    line: DriverLine,
    drivers: Drivers,
    now: Microseconds,
    /// All datagrams sent.
    sent: Vec<Vec<u8>>,
}

impl Bench {
    fn new(settings: &[DriverSettings], drivers: u8) -> Self {
        let mut bench =
            Self { line: DriverLine::default(), drivers: Drivers::default(), now: Microseconds(0), sent: Vec::new() };
        (0..drivers).for_each(|axis| bench.drivers.attach(axis, 8));
        bench.line.configure(settings.iter().copied());
        bench
    }

    fn run(&mut self, us: u64) {
        let end = self.now.0 + us;
        while let Some(at) = self.line.wakes_at().filter(|at| at.0 <= end) {
            self.now = self.now.max(at);
            if let Some(datagram) = self.line.poll(self.now) {
                self.exchange(&datagram);
            }
        }
        self.now.0 = end;
    }

    fn exchange(&mut self, datagram: &[u8]) {
        self.sent.push(datagram.to_vec());
        let reply = self.drivers.hear(datagram);
        self.now.0 += EXCHANGE_US;
        let bytes = datagram.iter().copied().chain(reply.into_iter().flat_map(|reply| reply.bytes));
        bytes.for_each(|byte| self.line.receive(self.now, byte));
    }

    fn fail(&mut self, axis: usize, faults: DriverFaults) {
        self.drivers.chip_mut(axis).unwrap().fail(faults);
    }
}

#[test]
fn plain_drivers_cause_no_traffic() {
    let mut bench = Bench::new(&[DriverSettings::default(); 2], 2);
    assert_eq!(bench.line.wakes_at(), None);
    assert_eq!(bench.line.poll(Microseconds(1_000_000)), None);
    assert_eq!(bench.line.state(0), DriverState::Plain);
    bench.run(1_000_000);
    assert!(bench.sent.is_empty());
}

#[test]
fn four_drivers_share_the_line_and_each_has_its_own_settings() {
    let settings = [1, 2, 4, 256].map(|microsteps| DriverSettings { microsteps, ..tmc() });
    let mut bench = Bench::new(&settings, ADDRESSES as u8);
    bench.run(100_000);
    for (axis, settings) in settings.iter().enumerate() {
        assert_eq!(bench.line.state(axis), DriverState::Ready);
        assert_eq!(bench.drivers.chip(axis).unwrap().microsteps(), settings.microsteps);
    }
}

#[test]
fn a_driver_is_ready_only_with_all_its_settings() {
    // Whichever of the six writes is lost.
    for lost in 0..6 {
        let mut bench = Bench::new(&[tmc()], 1);
        let mut writes = 0;
        while bench.line.state(0) == DriverState::Starting {
            let at = bench.line.wakes_at().unwrap();
            bench.now = bench.now.max(at);
            let Some(datagram) = bench.line.poll(bench.now) else { continue };
            if datagram.len() == 8 {
                bench.fail(0, DriverFaults { garbled_writes: u32::from(writes == lost), ..DriverFaults::default() });
                writes += 1;
            }
            bench.exchange(&datagram);
        }
        assert_eq!(bench.line.state(0), DriverState::Failed(FaultCode::DriverUnset), "write {lost}");
        bench.run(200_000);
        assert_eq!(bench.line.state(0), DriverState::Ready);
    }
}

#[test]
fn currents_are_nearest_to_those_wanted() {
    for sense_mohm in [75, 110, 150] {
        for run_ma in (400..=1_000).step_by(50) {
            let mut bench = Bench::new(&[DriverSettings { sense_mohm, run_ma, hold_ma: run_ma / 2, ..tmc() }], 1);
            bench.run(100_000);
            let chip = bench.drivers.chip_mut(0).unwrap();
            chip.enable(true);
            let largest = |volts: f64| volts / f64::from(sense_mohm + 20) * 1e6 / 2f64.sqrt();
            let range = if f64::from(run_ma) <= largest(0.180) { 0.180 } else { 0.325 };
            let step = largest(range) / 32.0;
            let off = (chip.current_ma(sense_mohm) - f64::from(run_ma)).abs();
            assert!(off <= 0.51 * step, "{run_ma} mA by {sense_mohm} mOhm: {off} mA off");
        }
    }
}

#[test]
fn one_driver_that_is_not_there_does_not_keep_another_from_being_watched() {
    let mut bench = Bench::new(&[tmc(), tmc()], 1);
    bench.run(100_000);
    assert_eq!(
        [0, 1].map(|axis| bench.line.state(axis)),
        [DriverState::Ready, DriverState::Failed(FaultCode::DriverSilent)]
    );
    bench.drivers.chip_mut(0).unwrap().heat(125.0);
    bench.run(500_000);
    assert_eq!(bench.line.state(0), DriverState::Hot);
    bench.drivers.attach(1, 8);
    bench.run(500_000);
    assert_eq!(bench.line.state(1), DriverState::Ready, "it was plugged in");
}

/// While the motors are on, a short circuit is seen before the stage has gone half its following error at full speed.
#[test]
fn drivers_are_watched_closely_while_the_motors_are_on() {
    let mut bench = Bench::new(&[tmc(), tmc()], 2);
    bench.run(100_000);
    bench.line.set_motors(true);
    bench.drivers.enable(true);
    bench.run(10_000);
    for delay in 0..20 {
        bench.run(delay * 130);
        bench.fail(1, DriverFaults { is_shorted: true, ..DriverFaults::default() });
        bench.run(4_500);
        assert_eq!(bench.line.state(1), DriverState::Failed(FaultCode::DriverShort));
        bench.fail(1, DriverFaults::default());
        bench.drivers.enable(false);
        bench.run(200_000);
        bench.drivers.enable(true);
        assert_eq!(bench.line.state(1), DriverState::Ready);
    }
    bench.line.set_motors(false);
    bench.run(50_000);
    bench.sent.clear();
    bench.run(1_000_000);
    assert!((30..=45).contains(&bench.sent.len()), "{} datagrams a second at rest", bench.sent.len());
}

/// Noise between two datagrams, a wire held low, bytes without end.
#[test]
fn any_bytes_at_any_time_do_no_harm() {
    let mut bench = Bench::new(&[tmc()], 1);
    let mut noise = 1u32;
    for _ in 0..2_000 {
        noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (0..noise >> 28).for_each(|_| bench.line.receive(bench.now, (noise >> 20) as u8));
        bench.run(u64::from(noise >> 22));
    }
    bench.run(400_000);
    assert_eq!(bench.line.state(0), DriverState::Ready);
}

/// TCOOLTHRS stands at three quarters of the speed of homing: 12 MHz by 256 of the full steps a second (datasheet, section
/// 5.3). The bench: 40 mm/s of 800 steps/mm make 4000 full steps a second, 20 degrees/s of 64 000 a turn 444.
#[test]
fn a_stall_is_reported_from_three_quarters_of_the_speed_of_homing_on() {
    let stall =
        |settings: AxisSettings| settings.driver_settings().stall.map(|stall| (stall.longest_tstep, stall.threshold));
    let by_stall = |mut settings: AxisSettings| {
        settings.driver.kind = DriverKind::Tmc2209;
        settings.switches = SwitchSettings { home: HomeSensor::StallGuard, stall_threshold: 50, ..settings.switches };
        assert_eq!(settings.validate(0), Ok(()));
        settings
    };
    let [baseline, separation] = bench_settings();
    assert_eq!(stall(baseline), None, "it has a switch");
    assert_eq!(stall(by_stall(baseline)), Some((15, 50)));
    assert_eq!(stall(by_stall(separation)), Some((140, 50)));
    let mut slow = by_stall(baseline);
    slow.speed = 10_000;
    assert_eq!(stall(slow), Some((62, 50)), "homing is never faster than `speed`");
}
