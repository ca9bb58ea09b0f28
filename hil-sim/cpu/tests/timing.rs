//! Cycles of instructions, against the Cortex-M4 Technical Reference Manual (ARM 100166, tables 3-1 and 7-1).

mod common;

use common::code::{BREAKPOINT, CPACR, NOP, constant, write};
use common::{Board, RAM, boot};
use vergence_cpu::{Cpu, NEVER, Stop};

/// Cycles that code takes between a prologue and the breakpoint; R5 points to RAM, R6 is 1000, R7 is 3.
fn cycles_with(wait_states: u32, code: &[u16]) -> u64 {
    let prologue =
        [write(CPACR, 0xf << 20), constant(5, RAM), constant(6, 1_000), constant(7, 3), vec![0xee00, 0x6a10]].concat();
    let run = |code: &[u16]| {
        let mut board = Board::with_program(&[&prologue, code, &[BREAKPOINT]].concat());
        board.wait_states = wait_states;
        let mut cpu: Cpu = boot(&mut board);
        assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(0));
        cpu.now()
    };
    run(code) - run(&[])
}

fn cycles(code: &[u16]) -> u64 {
    cycles_with(0, code)
}

#[test]
fn data_processing_takes_one_cycle() {
    // adds r0, r6, r7; lsls r0, r6, #3; muls r0, r6, r0; mla r0, r6, r7, r0; umull r0, r1, r6, r7
    for code in [&[0x19f0][..], &[0x00f0], &[0x4370], &[0xfb06, 0x0007], &[0xfba6, 0x0107], &[NOP]] {
        assert_eq!(cycles(code), 1, "{code:04x?}");
    }
}

#[test]
fn divisions_take_two_to_twelve_by_their_quotient() {
    // udiv r0, r7, r6 (3 / 1000); udiv r0, r6, r7 (1000 / 3); mvn r1, #0 and udiv r0, r1, #1
    assert_eq!(cycles(&[0xfbb7, 0xf0f6]), 2);
    let middle = cycles(&[0xfbb6, 0xf0f7]);
    assert!((3..12).contains(&middle), "{middle}");
    let longest = cycles(&[0xf06f, 0x0100, 0x2001, 0xfbb1, 0xf0f0]) - 2;
    assert_eq!(longest, 12);
}

#[test]
fn loads_take_two_and_neighbours_are_pipelined() {
    // ldr r0, [r5] once, twice; str r0, [r5]; ldm r5, {r0-r3}; stm r5!, {r0-r3}; push and pop of two
    assert_eq!(cycles(&[0x6828]), 2);
    assert_eq!(cycles(&[0x6828, 0x6829]), 3);
    assert_eq!(cycles(&[0x6828, NOP, 0x6829]), 5);
    assert_eq!(cycles(&[0x6028]), 1);
    assert_eq!(cycles(&[0xe895, 0x000f]), 5);
    assert_eq!(cycles(&[0xc50f]), 5);
    assert_eq!(cycles(&[0xb403, 0xbc03]), 6);
}

#[test]
fn taken_branches_refill_the_pipeline_and_wait_for_the_flash() {
    // b to the next instruction; beq not taken (R6 is not compared: Z is clear); bne taken
    assert_eq!(cycles(&[0xe7ff]), 3);
    assert_eq!(cycles(&[0xd0ff]), 1);
    assert_eq!(cycles(&[0xd1ff]), 3);
    assert_eq!(cycles_with(4, &[0xe7ff]), 7);
    assert_eq!(cycles_with(4, &[0xd0ff]), 1);
}

#[test]
fn floats_take_what_the_manual_says() {
    // vadd, vmul, vmla, vfma, vdiv, vsqrt on s0, s0, s0; vldr s0, [r5]; vmov r0, s0
    for (code, expected) in [
        ([0xee30, 0x0a00], 1),
        ([0xee20, 0x0a00], 1),
        ([0xee00, 0x0a00], 3),
        ([0xeea0, 0x0a00], 3),
        ([0xee80, 0x0a00], 14),
        ([0xeeb1, 0x0ac0], 14),
        ([0xed95, 0x0a00], 2),
        ([0xee10, 0x0a10], 1),
    ] {
        assert_eq!(cycles(&code), expected, "{code:04x?}");
    }
}

#[test]
fn an_instruction_that_its_it_block_skips_takes_one_cycle() {
    // it eq; muleq...: Z is clear
    assert_eq!(cycles(&[0xbf08, 0x4370]), 2);
}
