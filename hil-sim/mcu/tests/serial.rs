//! Serial ports and the DMA that serves them (RM0440 §37, §38, §12, §13).
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

mod common;

use common::serial::*;
use common::{Bench, GPIOB, LPUART1, USART2, USART3, bench, frame, pin};
use vergence_cpu::Bus;
use vergence_mcu::{Frame, LineFault, Nothing, UartId};

/// USART2 on PA2 and PA3, its idle frame over.
fn port(extra: u32) -> Bench<Nothing> {
    let mut bench = bench();
    bench.connect("PA2", 7);
    bench.connect("PA3", 7);
    bench.write(USART2 + BRR, BIT as u32);
    bench.write(USART2 + CR1, UE | RE | TE | extra);
    bench.wait(FRAME);
    bench
}

fn flags(bench: &mut Bench<Nothing>, mask: u32) -> u32 {
    bench.read(USART2 + ISR) & mask
}

#[test]
fn the_first_byte_waits_for_an_idle_frame() {
    let mut bench = bench();
    bench.connect("PA2", 7);
    bench.write(USART2 + BRR, BIT as u32);
    bench.write(USART2 + CR1, UE | TE);
    bench.write(USART2 + TDR, 0x55);
    bench.wait(2 * FRAME - 1);
    assert!(bench.sent(UartId::USART2).is_empty());
    bench.wait(1);
    assert_eq!(bench.sent(UartId::USART2), [0x55]);
}

#[test]
fn bytes_take_their_time_and_tell_their_end() {
    let mut bench = port(0);
    assert_eq!(flags(&mut bench, TXE | TC), TXE | TC);
    bench.write(USART2 + TDR, 1);
    assert_eq!(flags(&mut bench, TXE | TC), TXE, "the shift register took it");
    bench.write(USART2 + TDR, 2);
    assert_eq!(flags(&mut bench, TXE | TC), 0);
    bench.wait(FRAME);
    assert_eq!(flags(&mut bench, TXE | TC), TXE);
    bench.wait(FRAME - 1);
    assert_eq!(flags(&mut bench, TC), 0);
    bench.wait(1);
    assert_eq!(flags(&mut bench, TC), TC);
    let sent = bench.chip.take_sent(UartId::USART2);
    assert_eq!(sent.iter().map(|sent| sent.byte).collect::<Vec<_>>(), [1, 2]);
    // Two frames of 1390 cycles of 62.5 ns after the idle frame.
    assert_eq!(sent[1].at.0 - sent[0].at.0, 1390 * 62_500);
    assert_eq!(sent[0].baud, BAUD);
}

#[test]
fn a_full_data_register_is_an_error() {
    let mut bench = port(0);
    for byte in 0..3 {
        bench.write(USART2 + TDR, byte);
    }
    assert!(bench.complaint().unwrap().ends_with("the byte 0x02 is written to a full data register"));
}

#[test]
fn the_fifo_holds_eight() {
    let mut bench = port(FIFOEN);
    for byte in 0..9 {
        assert_eq!(flags(&mut bench, TXE), TXE, "byte {byte}");
        bench.write(USART2 + TDR, byte);
    }
    assert_eq!(flags(&mut bench, TXE), 0);
    bench.wait(9 * FRAME);
    assert_eq!(bench.sent(UartId::USART2), (0..9).collect::<Vec<_>>());
}

#[test]
fn the_low_power_port_divides_by_256() {
    // §38.4.6: BRR = 256 × 16 MHz / 115200 = 35556, so ten bits are 35556 × 10 / 256 = 1388.9 cycles.
    let mut bench = bench();
    bench.connect("PA2", 12);
    bench.write(LPUART1 + BRR, 35_556);
    bench.write(LPUART1 + CR1, UE | TE);
    bench.wait(2_000);
    let begin = bench.now;
    bench.write(LPUART1 + TDR, 7);
    assert_eq!(bench.chip.next_event() - begin, 1_389);
    bench.wait(1_389);
    let sent = bench.chip.take_sent(UartId::LPUART1);
    assert_eq!((sent[0].byte, sent[0].baud), (7, 115_199));
}

#[test]
fn a_byte_arrives_in_the_middle_of_its_stop_bit() {
    let mut bench = port(1 << 5);
    bench.chip.send(UartId::USART2, &[frame(0xA5, BAUD)]);
    // 9.5 bits at 115 108 baud are 1320.5 cycles.
    bench.wait(1_319);
    assert_eq!(flags(&mut bench, RXNE), 0);
    assert!(!bench.line(38));
    bench.wait(1);
    assert_eq!(flags(&mut bench, RXNE), RXNE);
    assert!(bench.line(38));
    assert_eq!(bench.read(USART2 + RDR), 0xA5);
    assert_eq!(flags(&mut bench, RXNE), 0);
    assert!(!bench.line(38));
}

#[test]
fn a_byte_too_many_is_lost_and_flagged() {
    for (fifo, depth) in [(0, 1), (FIFOEN, 8)] {
        let mut bench = port(fifo);
        let frames: Vec<_> = (0..depth + 1).map(|byte| frame(byte, BAUD)).collect();
        bench.chip.send(UartId::USART2, &frames);
        bench.wait(u64::from(depth) * FRAME);
        assert_eq!(flags(&mut bench, ORE), 0);
        bench.wait(FRAME);
        assert_eq!(flags(&mut bench, ORE), ORE);
        let kept: Vec<_> = (0..depth).map(|_| bench.read(USART2 + RDR) as u8).collect();
        assert_eq!(kept, (0..depth).collect::<Vec<_>>());
        bench.write(USART2 + ICR, ORE);
        assert_eq!(flags(&mut bench, ORE | RXNE), 0);
    }
}

#[test]
fn an_idle_line_is_noticed_after_a_frame() {
    let mut bench = port(0);
    bench.write(USART2 + CR2, 1 << 23);
    bench.write(USART2 + RTOR, 30);
    bench.chip.send(UartId::USART2, &[frame(1, BAUD), frame(2, BAUD)]);
    bench.wait(3 * FRAME - 10);
    assert_eq!(flags(&mut bench, IDLE), 0);
    bench.wait(20);
    assert_eq!(flags(&mut bench, IDLE | RTOF), IDLE);
    bench.wait(20 * BIT);
    assert_eq!(flags(&mut bench, IDLE | RTOF), IDLE | RTOF);
    bench.write(USART2 + ICR, IDLE | RTOF);
    assert_eq!(flags(&mut bench, IDLE | RTOF), 0);
}

#[test]
fn line_faults_and_wrong_baud_rates_are_flagged() {
    for (sent, errors) in [
        (Frame { byte: 1, baud: BAUD, fault: LineFault::Noise }, NE),
        (Frame { byte: 1, baud: BAUD, fault: LineFault::Framing }, FE),
        (frame(1, BAUD * 103 / 100), 0),
        (frame(1, BAUD * 106 / 100), FE),
        (frame(1, 9_600), FE),
    ] {
        let mut bench = port(0);
        bench.chip.send(UartId::USART2, &[sent]);
        bench.wait(20 * FRAME);
        assert_eq!(flags(&mut bench, NE | FE), errors, "{sent:?}");
    }
}

#[test]
fn without_pins_nothing_goes_in_or_out() {
    let mut bench = bench();
    bench.write(USART2 + BRR, BIT as u32);
    bench.write(USART2 + CR1, UE | RE | TE);
    bench.wait(FRAME);
    bench.write(USART2 + TDR, 1);
    bench.chip.send(UartId::USART2, &[frame(1, BAUD)]);
    bench.wait(3 * FRAME);
    assert!(bench.sent(UartId::USART2).is_empty());
    assert_eq!(flags(&mut bench, RXNE | TC), TC);
}

#[test]
fn one_wire_echoes_and_enables_its_driver() {
    let mut bench = bench();
    bench.connect("PB10", 7);
    bench.connect("PB14", 7);
    bench.write(GPIOB + 4, 1 << 10);
    bench.write(USART3 + BRR, BIT as u32);
    // Half duplex, driver enable.
    bench.write(USART3 + CR3, 1 << 3 | 1 << 14);
    bench.write(USART3 + CR1, UE | RE | TE);
    bench.wait(FRAME);
    assert!(!bench.chip.is_high(pin("PB14")));
    bench.write(USART3 + TDR, 0x42);
    assert!(bench.chip.is_high(pin("PB14")));
    bench.wait(FRAME);
    assert!(!bench.chip.is_high(pin("PB14")));
    assert_eq!(bench.read(USART3 + RDR), 0x42);
    bench.chip.send(UartId::USART3, &[frame(0x43, BAUD)]);
    bench.wait(FRAME);
    assert_eq!(bench.read(USART3 + RDR), 0x43);
}

const DMA1: u32 = 0x4002_0000;
const DMAMUX: u32 = 0x4002_0800;
const RAM: u32 = 0x2000_0000;

#[test]
fn dma_fills_a_ring_and_tells_half_and_whole() {
    let mut bench = port(0);
    bench.write(USART2 + CR3, 1 << 6);
    // Channel 3 of DMA1 serves USART2_RX (26): four bytes around, interrupts at half and whole.
    bench.write(DMAMUX + 8, 26);
    bench.write(DMA1 + 8 + 40 + 4, 4);
    bench.write(DMA1 + 8 + 40 + 8, USART2 + RDR);
    bench.write(DMA1 + 8 + 40 + 12, RAM);
    bench.write(DMA1 + 8 + 40, 1 | 1 << 1 | 1 << 2 | 1 << 5 | 1 << 7);
    let bytes: Vec<_> = (1..=6).map(|byte| frame(byte, BAUD)).collect();
    bench.chip.send(UartId::USART2, &bytes);
    bench.wait(FRAME);
    assert_eq!(bench.read(DMA1 + 8 + 40 + 4), 3);
    assert!(!bench.line(13));
    bench.wait(FRAME);
    assert!(bench.line(13));
    assert_eq!(bench.read(DMA1) >> 8, 0b0101, "global and half");
    bench.write(DMA1 + 4, 0x100);
    assert_eq!(bench.read(DMA1), 0, "the global clear bit clears all");
    bench.wait(2 * FRAME);
    assert_eq!(bench.read(DMA1) >> 8, 0b0011, "global and complete");
    bench.wait(2 * FRAME);
    assert_eq!(bench.read(DMA1 + 8 + 40 + 4), 2);
    assert_eq!(bench.read(RAM).to_le_bytes(), [5, 6, 3, 4]);
}

#[test]
fn dma_feeds_the_transmitter() {
    let mut bench = port(0);
    bench.write(RAM, u32::from_le_bytes(*b"dma!"));
    bench.write(DMAMUX, 27);
    bench.write(DMA1 + 12, 4);
    bench.write(DMA1 + 16, USART2 + TDR);
    bench.write(DMA1 + 20, RAM);
    bench.write(DMA1 + 8, 1 | 1 << 1 | 1 << 4 | 1 << 7);
    bench.write(USART2 + CR3, 1 << 7);
    bench.wait(4 * FRAME);
    assert_eq!(bench.sent(UartId::USART2), *b"dma!");
    assert!(bench.line(11));
}

#[test]
fn a_timer_gets_its_next_period_by_dma() {
    // As step pulses do: each compare event fetches the next reload value.
    const TIM1: u32 = 0x4001_2C00;
    let mut bench = bench();
    bench.write(RAM, 199 | 299 << 16);
    bench.write(DMAMUX + 4, 42);
    bench.write(DMA1 + 28 + 4, 2);
    bench.write(DMA1 + 28 + 8, TIM1 + 0x2C);
    bench.write(DMA1 + 28 + 12, RAM);
    bench.write(DMA1 + 28, 1 | 1 << 4 | 1 << 7 | 1 << 8 | 1 << 10);
    bench.write(TIM1 + 0x2C, 99);
    bench.write(TIM1 + 0x34, 50);
    bench.write(TIM1 + 0xC, 1 << 9);
    bench.write(TIM1, 0x81);
    bench.wait(51);
    assert_eq!(bench.read(TIM1 + 0x2C), 199);
    // The period of 100 runs out, then 200.
    bench.wait(100);
    assert_eq!(bench.read(TIM1 + 0x2C), 299);
    assert_eq!(bench.read(DMA1 + 28 + 4), 0);
    assert_eq!(bench.read(DMA1) >> 4 & 0xF, 0b0111);
}

#[test]
fn memory_to_memory_takes_time() {
    let mut bench = bench();
    bench.write(RAM, 0x0403_0201);
    bench.write(DMA1 + 12, 4);
    bench.write(DMA1 + 16, RAM);
    bench.write(DMA1 + 20, RAM + 16);
    bench.write(DMA1 + 8, 1 | 1 << 6 | 1 << 7 | 1 << 14);
    bench.wait(23);
    assert_eq!(bench.read(DMA1) & 0xF, 0b0101);
    bench.wait(1);
    assert_eq!(bench.read(DMA1) & 0xF, 0b0111);
    assert_eq!(bench.read(RAM + 16), 0x0403_0201);
}

#[test]
fn an_address_where_nothing_answers_stops_the_channel() {
    let mut bench = bench();
    bench.write(DMA1 + 12, 4);
    bench.write(DMA1 + 16, 0x6000_0000);
    bench.write(DMA1 + 20, RAM);
    bench.write(DMA1 + 8, 1 | 1 << 3 | 1 << 14);
    bench.wait(10);
    assert_eq!(bench.read(DMA1) & 0xF, 0b1001);
    assert!(bench.line(11));
    assert_eq!(bench.read(DMA1 + 8) & 1, 0);
    assert_eq!(bench.chip.next_event(), u64::MAX);
}
