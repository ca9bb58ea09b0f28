//! Small programs by hand: the core starts, computes, stores and stops.

mod common;

use common::{Board, RAM, boot};
use vergence_cpu::{NEVER, Stop};

#[test]
fn a_loop_sums_the_first_ten_numbers() {
    // movs r0, #0; movs r1, #10; 1: adds r0, r1; subs r1, #1; bne 1b; bkpt 7
    let mut board = Board::with_program(&[0x2000, 0x210a, 0x1840, 0x3901, 0xd1fc, 0xbe07]);
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(7));
    assert_eq!(cpu.register(0), 55);
    assert_eq!(cpu.instructions(), 2 + 30 + 1);
    // One cycle each, two more for each of the nine branches taken.
    assert_eq!(cpu.now(), 33 + 18);
}

#[test]
fn a_store_over_code_is_seen_by_the_next_fetch() {
    // movs r0, #1 at 0x400 runs, then code stores `movs r0, #42` over it and jumps back once.
    let program = [
        0x2001, // 400: movs r0, #1
        0x282a, // 402: cmp r0, #42
        0xd003, // 404: beq 40e
        0x4903, // 406: ldr r1, =0x400 (at 0x414)
        0x4a03, // 408: ldr r2, =0x202a (at 0x418)
        0x800a, // 40a: strh r2, [r1]
        0xe7f8, // 40c: b 400
        0xbe00, // 40e: bkpt 0
        0x0000, 0x0000, // 410
        0x0400, 0x0000, // 414
        0x202a, 0x0000, // 418
    ];
    let mut board = Board::with_program(&program);
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, 1_000), Stop::Breakpoint(0));
    assert_eq!(cpu.register(0), 42);
}

#[test]
fn stacking_several_registers_goes_down_and_comes_back() {
    // movs r0, #1; movs r1, #2; push {r0, r1}; pop {r2, r3}; bkpt
    let mut board = Board::with_program(&[0x2001, 0x2102, 0xb403, 0xbc0c, 0xbe00]);
    let mut cpu = boot(&mut board);
    let top = cpu.register(13);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(0));
    assert_eq!((cpu.register(2), cpu.register(3), cpu.register(13)), (1, 2, top));
    assert_eq!(board.word(top - 8), 1);
    assert!(top > RAM);
}
