//! Simulated servos on the serial port that the board keeps for them: one wire, USART3 on PB10 and PB14.
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

mod common;

use common::serial::{BRR, CR1, CR3, FIFOEN, ISR, RDR, RE, RXNE, TDR, TE, UE};
use common::{Bench, GPIOB, USART3, bench_with};
use vergence_dynamixel::units::Baud;
use vergence_dynamixel::{FastBlocks, Id, Receiver, Status, encode};
use vergence_mcu::{Nothing, OnPort, UartId};
use vergence_plant::servo::{Free, Servo, ServoBus, ServoModel};

type Wired = Bench<(Nothing, OnPort<ServoBus<Free>>)>;

/// Cycles of a byte at 1 Mbit/s and 16 MHz.
const BYTE: u64 = 160;

/// Five servos at the given speed on the port at 1 Mbit/s.
fn wired(baud: Baud) -> Wired {
    let servo = |number| Servo::new(ServoModel::XM430_W350, Id::servo(number).unwrap(), baud, 1.0);
    let device = ServoBus::new((13..18).map(servo).collect(), Free::default());
    let mut bench = bench_with((Nothing, OnPort { port: UartId::USART3, device }));
    bench.connect("PB10", 7);
    bench.connect("PB14", 7);
    bench.write(GPIOB + 4, 1 << 10);
    bench.write(USART3 + BRR, 16);
    bench.write(USART3 + CR3, 1 << 3 | 1 << 14);
    bench.write(USART3 + CR1, UE | RE | TE | FIFOEN);
    bench.wait(BYTE);
    bench
}

fn heard(bench: &mut Wired) -> Vec<u8> {
    let mut bytes = Vec::new();
    while bench.read(USART3 + ISR) & RXNE != 0 {
        bytes.push(bench.read(USART3 + RDR) as u8);
    }
    bytes
}

/// Sends a packet and hears for 200 bytes' time what comes back, the packet itself included.
fn ask(bench: &mut Wired, packet: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for &byte in packet {
        bench.write(USART3 + TDR, byte.into());
        bench.wait(BYTE);
        bytes.extend(heard(bench));
    }
    for _ in 0..200 {
        bench.wait(BYTE);
        bytes.extend(heard(bench));
    }
    bytes
}

#[test]
fn the_port_hears_itself_and_the_servos() {
    let mut bench = wired(Baud::M1);
    let ping = encode::ping(Id::servo(13).unwrap()).unwrap();
    let bytes = ask(&mut bench, &ping);
    assert_eq!(bytes[..ping.len()], ping[..]);
    let mut receiver = Receiver::default();
    receiver.hear(&bytes[ping.len()..]);
    let packet = receiver.next_packet().unwrap();
    assert_eq!(Status::of(&packet).unwrap().ping_info().unwrap().model, 1020);
}

#[test]
fn five_servos_answer_in_one_packet() {
    let mut bench = wired(Baud::M1);
    let ids = [13, 14, 15, 16, 17].map(|number| Id::servo(number).unwrap());
    let question = encode::fast_sync_read(132, 4, &ids).unwrap();
    let bytes = ask(&mut bench, &question);
    let mut receiver = Receiver::default();
    receiver.hear(&bytes[question.len()..]);
    let packet = receiver.next_packet().unwrap();
    let expected = ids.map(|id| (id, 4));
    // 1 rad is 651.9 counts.
    let blocks: Vec<_> = FastBlocks::of(&packet, &expected).unwrap().map(|block| block.unwrap().data).collect();
    assert_eq!(blocks, [&651_u32.to_le_bytes()[..]; 5]);
}

#[test]
fn servos_at_another_speed_do_not_understand() {
    let mut bench = wired(Baud::M2);
    let ping = encode::ping(Id::servo(13).unwrap()).unwrap();
    assert_eq!(ask(&mut bench, &ping), ping[..]);
}
