//! A device on the serial port that the board keeps for a robot's servo bus: one wire, USART3 on PB10 and PB14.
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

mod common;

use common::serial::{BAUD, BIT, BRR, CR1, CR3, FE, FIFOEN, FRAME, ICR, IDLE, ISR, RDR, RE, RXNE, TDR, TE, UE};
use common::{Bench, GPIOB, USART2, USART3, bench_with, frame, pin};
use vergence_mcu::{Frame, Nothing, OnPort, Picoseconds, SentByte, SerialDevice, UartId};

const ID: u8 = 7;
/// Delay before an answer, as of servos: the line is released before they answer.
const RETURN_DELAY: Picoseconds = Picoseconds::microseconds(250);

/// A device that answers its number and that number's complement with its number and the count of requests. The
/// protocol is invented for this test.
#[derive(Clone, Debug)]
struct Servo {
    baud: u32,
    last: Option<u8>,
    asked: u8,
    answers_at: Option<Picoseconds>,
}

impl SerialDevice for Servo {
    fn receive(&mut self, SentByte { at, byte, .. }: SentByte) {
        if self.last == Some(ID) && byte == !ID {
            self.asked += 1;
            self.answers_at = Some(at + RETURN_DELAY);
        }
        self.last = Some(byte);
    }

    fn next_event(&self) -> Picoseconds {
        self.answers_at.unwrap_or(Picoseconds::NEVER)
    }

    fn speak(&mut self, _now: Picoseconds) -> Vec<Frame> {
        self.answers_at = None;
        vec![frame(ID, self.baud), frame(self.asked, self.baud)]
    }
}

/// The reserved port with a servo, half duplex with driver enable, and USART2 with nothing.
fn bus(baud: u32) -> Bench<(Nothing, OnPort<Servo>)> {
    let device = Servo { baud, last: None, asked: 0, answers_at: None };
    let mut bench = bench_with((Nothing, OnPort { port: UartId::USART3, device }));
    for (name, function) in [("PB10", 7), ("PB14", 7), ("PA2", 7)] {
        bench.connect(name, function);
    }
    bench.write(GPIOB + 4, 1 << 10);
    for port in [USART2, USART3] {
        bench.write(port + BRR, BIT as u32);
    }
    bench.write(USART3 + CR3, 1 << 3 | 1 << 14);
    bench.write(USART3 + CR1, UE | RE | TE | FIFOEN);
    bench.write(USART2 + CR1, UE | TE | FIFOEN);
    bench.wait(FRAME);
    bench
}

fn ask(bench: &mut Bench<(Nothing, OnPort<Servo>)>, port: u32) {
    bench.write(port + TDR, ID.into());
    bench.write(port + TDR, (!ID).into());
    bench.wait(2 * FRAME);
}

fn answers(bench: &mut Bench<(Nothing, OnPort<Servo>)>) -> Vec<u8> {
    let mut bytes = Vec::new();
    while bench.read(USART3 + ISR) & RXNE != 0 {
        bytes.push(bench.read(USART3 + RDR) as u8);
    }
    bytes
}

#[test]
fn a_servo_on_the_reserved_port_answers_after_its_delay() {
    let mut bench = bus(BAUD);
    ask(&mut bench, USART3);
    assert_eq!(answers(&mut bench), [ID, !ID], "one wire: its own question");
    assert!(!bench.chip.is_high(pin("PB14")), "the line is free for the answer");
    // 250 us are 4000 cycles at 16 MHz.
    bench.wait(4_000 + FRAME / 2);
    assert!(answers(&mut bench).is_empty());
    bench.wait(FRAME);
    assert_eq!(answers(&mut bench), [ID]);
    bench.wait(FRAME);
    assert_eq!(answers(&mut bench), [1]);
    let mut again = Bench { chip: bench.chip.clone(), now: bench.now };
    for bench in [&mut bench, &mut again] {
        ask(bench, USART3);
        bench.wait(4_000 + 2 * FRAME);
        assert_eq!(answers(bench), [ID, !ID, ID, 2], "a snapshot goes on like the original");
    }
}

/// On one wire the receiver finds the line idle after its own bytes as after those of others, and not between two bytes.
#[test]
fn the_line_is_idle_a_frame_after_the_last_byte_of_either_side() {
    let mut bench = bus(BAUD);
    ask(&mut bench, USART3);
    assert_eq!(bench.read(USART3 + ISR) & IDLE, 0, "the second byte has just ended");
    bench.wait(FRAME - 2);
    assert_eq!(bench.read(USART3 + ISR) & IDLE, 0);
    bench.wait(4);
    assert_ne!(bench.read(USART3 + ISR) & IDLE, 0);
    bench.write(USART3 + ICR, IDLE);
    bench.wait(4_000 + FRAME);
    assert_eq!(bench.read(USART3 + ISR) & IDLE, 0, "in the answer of two bytes");
    bench.wait(FRAME);
    assert_ne!(bench.read(USART3 + ISR) & IDLE, 0);
}

#[test]
fn the_direction_of_the_buffer_is_that_of_the_board_while_it_speaks() {
    let mut bench = bus(BAUD);
    bench.write(USART3 + TDR, ID.into());
    bench.write(USART3 + TDR, (!ID).into());
    bench.wait(FRAME + BIT);
    assert!(bench.chip.is_high(pin("PB14")), "in the second byte");
    bench.wait(FRAME);
    assert!(!bench.chip.is_high(pin("PB14")));
}

#[test]
fn other_ports_are_not_its_own_and_other_speeds_are_noise() {
    let mut bench = bus(BAUD);
    ask(&mut bench, USART2);
    bench.wait(4_000 + 2 * FRAME);
    assert!(answers(&mut bench).is_empty());
    let mut bench = bus(1_000_000);
    ask(&mut bench, USART3);
    assert_eq!(answers(&mut bench), [ID, !ID]);
    bench.wait(4_000 + 2 * FRAME);
    assert_ne!(bench.read(USART3 + ISR) & FE, 0);
}
