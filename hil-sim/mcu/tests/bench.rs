//! The mechanics on the chip's pins, with registers poked as firmware would.
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

mod common;

use common::serial::{BIT, BRR, CR1, CR3, FIFOEN, FRAME, ISR, RDR, RE, RXNE, TDR, TE, UE};
use common::{Bench as Poked, GPIOA, TIM1, TIM2, bench_with, pin};
use vergence_mcu::{AxisWiring, Bench, BenchWiring, SpiId, SwitchWiring, UartId};
use vergence_plant::{Plant, bench_mechanics};

const HOME: u32 = 4;
const LIMIT: u32 = 5;
const STOP: u32 = 6;

/// The baseline axis alone: steps on PA8, direction PA9, drivers PA10, encoder PA0 and PA1, switches PA4 to PA6.
fn rig(position: f64) -> Poked<Bench> {
    let switch = |name: &str, normally_closed| SwitchWiring { pin: pin(name), normally_closed };
    let wiring = BenchWiring {
        axes: vec![AxisWiring {
            step: pin("PA8"),
            direction: pin("PA9"),
            encoder: [pin("PA0"), pin("PA1")],
            home: switch("PA4", false),
            hard_limit: switch("PA5", true),
            index: None,
            select: None,
        }],
        holding: pin("PB5"),
        drivers_off: pin("PA10"),
        emergency_stop: switch("PA6", true),
        camera_trigger: pin("PA7"),
        driver_line: UartId::UART4,
        servo_bus: UartId::USART3,
        encoder_bus: SpiId::SPI1,
    };
    let plant = Plant::new(&bench_mechanics()[..1], &[position]);
    let mut bench = bench_with(Bench::new(wiring, plant));
    bench.wait(1);
    // Switch inputs, encoder on TIM2, steps on TIM1.
    bench.modify(GPIOA, 0x3F << 8, 0);
    bench.connect("PA0", 1);
    bench.connect("PA1", 1);
    bench.write(TIM2 + 0x18, 0x0101);
    bench.write(TIM2 + 8, 3);
    bench.write(TIM2, 1);
    bench.connect("PA8", 6);
    bench.write(TIM1 + 0x44, 1 << 15);
    bench.write(TIM1 + 0x2C, 799);
    bench.write(TIM1 + 0x34, 400);
    bench.write(TIM1 + 0x18, 7 << 4);
    bench.write(TIM1 + 0x20, 1);
    bench
}

fn input(bench: &mut Poked<Bench>, number: u32) -> bool {
    bench.read(GPIOA + 0x10) >> number & 1 == 1
}

fn switch_drivers_on(bench: &mut Poked<Bench>) {
    bench.write(GPIOA + 0x28, 1 << 10);
    bench.modify(GPIOA, 3 << 20, 1 << 20);
    assert!(bench.chip.world().plant().drivers_on());
}

fn direction(bench: &mut Poked<Bench>, forward: bool) {
    bench.modify(GPIOA, 3 << 18, 1 << 18);
    bench.write(GPIOA + 0x18, if forward { 1 << 9 } else { 1 << 25 });
}

/// Exactly `count` step pulses at 20 kHz.
fn pulse(bench: &mut Poked<Bench>, count: u32) {
    bench.write(TIM1 + 0x30, count - 1);
    bench.write(TIM1 + 0x14, 1);
    bench.write(TIM1, 1 | 8);
    bench.wait(u64::from(count + 2) * 800 + 16_000 * 200);
    assert_eq!(bench.read(TIM1) & 1, 0);
}

#[test]
fn steps_move_the_load_and_the_encoder_answers_on_its_lines() {
    let mut bench = rig(100_000.0);
    switch_drivers_on(&mut bench);
    direction(&mut bench, true);
    pulse(&mut bench, 3_200);
    assert_eq!(bench.chip.world().pulses(), [3_200]);
    // 3200 steps of 1/800 mm are 4 mm, less half the backlash of 8 µm; the encoder counts 0.5 µm.
    let load = bench.chip.world().plant().load(0).unwrap();
    assert!((load - 103_996.0).abs() < 0.5, "{load}");
    let count = bench.read(TIM2 + 0x24) as i32;
    assert!((count - 7_992).abs() <= 1, "{count}");
    direction(&mut bench, false);
    pulse(&mut bench, 3_200);
    let count = bench.read(TIM2 + 0x24) as i32;
    assert!((count - 8).abs() <= 1, "{count}");
}

#[test]
fn without_drivers_nothing_moves() {
    let mut bench = rig(100_000.0);
    direction(&mut bench, true);
    pulse(&mut bench, 100);
    assert_eq!(bench.chip.world().pulses(), [100]);
    assert_eq!(bench.read(TIM2 + 0x24), 0);
    switch_drivers_on(&mut bench);
    pulse(&mut bench, 160);
    assert!((bench.chip.world().plant().load(0).unwrap() - 100_196.0).abs() < 0.5);
}

#[test]
fn switches_are_on_their_lines() {
    // The home switch closes 2 mm below the range of 60 mm, the hard limit opens 6 mm further down.
    let mut bench = rig(100_000.0);
    assert!(input(&mut bench, HOME), "open");
    assert!(!input(&mut bench, LIMIT), "closed");
    let mut bench = rig(57_000.0);
    assert!(!input(&mut bench, HOME));
    assert!(!input(&mut bench, LIMIT));
    let mut bench = rig(51_000.0);
    assert!(!input(&mut bench, HOME));
    assert!(input(&mut bench, LIMIT), "beyond the limit, or a broken wire");
}

#[test]
fn the_emergency_stop_is_seen_and_cuts_the_drivers() {
    let mut bench = rig(100_000.0);
    switch_drivers_on(&mut bench);
    assert!(!input(&mut bench, STOP));
    bench.chip.with_world(|world, _| world.plant_mut().press_emergency_stop(true));
    bench.wait(1);
    assert!(input(&mut bench, STOP));
    direction(&mut bench, true);
    pulse(&mut bench, 100);
    assert_eq!(bench.read(TIM2 + 0x24), 0);
}

#[test]
fn the_boards_pins_can_do_what_they_are_wired_for() {
    // Timer outputs at the step pins (AF6, AF4), timer inputs at the encoders' (AF1, AF1; AF2, AF1).
    let wiring = BenchWiring::nucleo_g474();
    let names = |pins: [vergence_mcu::Pin; 4]| pins.map(|pin| pin.to_string());
    let [baseline, separation] = [wiring.axes[0], wiring.axes[1]]
        .map(|axis| names([axis.step, axis.direction, axis.encoder[0], axis.encoder[1]]));
    assert_eq!(baseline, ["PA8", "PA9", "PA0", "PA1"]);
    assert_eq!(separation, ["PC6", "PC8", "PB2", "PC12"]);
    let plant = Plant::new(&bench_mechanics(), &[100_000.0, 300_000.0]);
    let mut bench = bench_with(Bench::new(wiring, plant));
    bench.wait(1);
    const TIM8: u32 = 0x4001_3400;
    const TIM5: u32 = 0x4000_0C00;
    for (pin, function) in [("PC6", 4), ("PB2", 2), ("PC12", 1)] {
        bench.connect(pin, function);
    }
    bench.write(TIM5 + 0x18, 0x0101);
    bench.write(TIM5 + 8, 3);
    bench.write(TIM5, 1);
    switch_drivers_on(&mut bench);
    bench.modify(0x4800_0800, 3 << 16, 1 << 16);
    bench.write(0x4800_0818, 1 << 8);
    for (register, value) in [(0x44, 1 << 15), (0x2C, 799), (0x34, 400), (0x18, 7 << 4), (0x20, 1), (0x30, 639)] {
        bench.write(TIM8 + register, value);
    }
    bench.write(TIM8 + 0x14, 1);
    bench.write(TIM8, 1 | 8);
    bench.wait(800 * 640 + 16_000 * 200);
    // A hundredth of a revolution is 1000 counts, less half the backlash of 120 µrad, which is 1 count.
    let count = bench.read(TIM5 + 0x24) as i32;
    assert!((998..=1_000).contains(&count), "{count}");
}

#[test]
fn a_reset_of_the_chip_lets_the_drivers_go() {
    let mut bench = rig(100_000.0);
    switch_drivers_on(&mut bench);
    bench.chip.reset(bench.now, vergence_mcu::ResetCause::Software);
    assert!(!bench.chip.world().plant().drivers_on());
}

const UART4: u32 = 0x4000_4C00;

fn heard(bench: &mut Poked<Bench>) -> Vec<u8> {
    let mut bytes = Vec::new();
    while bench.read(UART4 + ISR) & RXNE != 0 {
        bytes.push(bench.read(UART4 + RDR) as u8);
    }
    bytes
}

/// One wire (RM0440, 37.5.15): the port hears itself, then the driver, which begins eight bits later as after reset.
#[test]
fn a_motor_driver_answers_on_its_wire() {
    let mut bench = rig(100_000.0);
    bench.chip.with_world(|world, _| world.plant_mut().drivers_mut().attach(0, 8));
    bench.connect("PC10", 5);
    bench.write(UART4 + BRR, BIT as u32);
    bench.write(UART4 + CR3, 1 << 3);
    bench.write(UART4 + CR1, UE | RE | TE | FIFOEN);
    bench.wait(2 * FRAME);
    for _ in 0..2 {
        let request = [0x05, 0x00, 0x06, 0x6F];
        request.iter().for_each(|&byte| bench.write(UART4 + TDR, byte));
        bench.wait(4 * FRAME);
        assert_eq!(heard(&mut bench), request.map(|byte| byte as u8));
        bench.wait(8 * BIT + FRAME - BIT);
        assert!(heard(&mut bench).is_empty());
        bench.wait(2 * BIT);
        assert_eq!(heard(&mut bench), [0x05]);
        bench.wait(7 * FRAME);
        let reply = heard(&mut bench);
        assert_eq!(reply[..5], [0xFF, 0x06, 0x21, 0x00, 0x00], "the version of the chip");
    }
    // Another driver's address, and a wrong checksum.
    for request in [[0x05, 0x01, 0x06, 0x0B], [0x05, 0x00, 0x06, 0x6E]] {
        request.iter().for_each(|&byte| bench.write(UART4 + TDR, byte));
        bench.wait(20 * FRAME);
        assert_eq!(heard(&mut bench), request.map(|byte| byte as u8));
    }
}
