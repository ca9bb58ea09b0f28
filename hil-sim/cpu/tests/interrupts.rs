//! The NVIC: levels and pulses, priorities, tail chaining, late arrival, masks, the system timer.

mod common;

use common::code::{
    BREAKPOINT, CPSID_I, CPSIE_I, FOREVER, ICSR, IPR, ISER, ISPR, NOP, RETURN, STK_CTRL, STK_LOAD, STK_VAL, WFI,
    constant, read, trace, write,
};
use common::{Board, LINES_REGISTER, boot};
use vergence_cpu::{Cpu, NEVER, Stop};

/// The trace that the handlers leave in R4.
fn traced(cpu: &Cpu) -> u32 {
    cpu.register(4)
}

/// A board that enables lines 0 to 3 with these priorities and then idles; handler n traces n + 1.
fn idling(priorities: u32) -> Board {
    let program = [write(IPR, priorities), write(ISER, 15), vec![FOREVER]].concat();
    let mut board = Board::with_program(&program);
    for line in 0..4 {
        board.handler(16 + line, &trace(line as u16 + 1));
    }
    board
}

#[test]
fn a_pulse_is_latched_and_taken_once() {
    let mut board = idling(0);
    board.schedule = vec![(100, 1), (101, 0)];
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, 1_000), Stop::Reached);
    assert_eq!(traced(&cpu), 1);
}

#[test]
fn a_level_pends_again_until_it_is_released() {
    let mut board = idling(0);
    board.handler(16, &[0x3401, RETURN]);
    // Entry, handler and return or chaining take some twenty cycles each time round.
    board.schedule = vec![(100, 1), (200, 0)];
    let mut cpu = boot(&mut board);
    cpu.run(&mut board, 1_000);
    let times = traced(&cpu);
    assert!((3..20).contains(&times), "{times}");
    // The same level released by the handler itself is taken once.
    let mut board = idling(0);
    board.handler(16, &[write(LINES_REGISTER, 0), vec![0x3401, RETURN]].concat());
    board.schedule = vec![(100, 1)];
    let mut cpu = boot(&mut board);
    cpu.run(&mut board, 1_000);
    assert_eq!(traced(&cpu), 1);
}

#[test]
fn a_pulse_during_its_own_handler_pends_once_more() {
    let mut board = idling(0);
    board.handler(16, &[0x3401, NOP, NOP, NOP, NOP, NOP, NOP, NOP, NOP, RETURN]);
    board.schedule = vec![(100, 1), (101, 0), (115, 1), (116, 0)];
    let mut cpu = boot(&mut board);
    cpu.run(&mut board, 1_000);
    assert_eq!(traced(&cpu), 2);
}

#[test]
fn simultaneous_lines_go_by_priority_and_then_by_number() {
    let mut board = idling(0x20_40_20_80);
    board.schedule = vec![(100, 0b1111), (101, 0)];
    let mut cpu = boot(&mut board);
    cpu.run(&mut board, 1_000);
    assert_eq!(traced(&cpu), 0x2431);
}

#[test]
fn chained_handlers_save_unstacking_and_stacking() {
    let run = |schedule| {
        let mut board = idling(0);
        board.schedule = schedule;
        let mut cpu = boot(&mut board);
        cpu.run(&mut board, 2_000);
        (traced(&cpu), cpu.instructions())
    };
    let (together, more) = run(vec![(100, 0b11), (101, 0)]);
    let (apart, fewer) = run(vec![(100, 0b01), (101, 0), (500, 0b10), (501, 0)]);
    assert_eq!((together, apart), (0x12, 0x12));
    // Entry 12 and return 10 against 6: sixteen cycles of the idle loop, three each.
    assert!((5..=6).contains(&(more - fewer)), "{more} {fewer}");
}

#[test]
fn a_more_urgent_line_that_arrives_during_stacking_goes_first() {
    let mut board = idling(0x0000_4080);
    board.schedule = vec![(100, 0b01), (106, 0b11), (108, 0)];
    let mut cpu = boot(&mut board);
    cpu.run(&mut board, 1_000);
    assert_eq!(traced(&cpu), 0x21);
}

#[test]
fn a_handler_is_preempted_by_a_higher_priority_alone() {
    let mut board = idling(0x00c0_4080);
    let mut slow = vec![0x0124, 0x3401];
    slow.extend([NOP; 24]);
    slow.push(RETURN);
    board.handler(16, &slow);
    // Lines 1 (higher) and 2 (lower) come while handler 0 runs its no-operations.
    board.schedule = vec![(100, 0b001), (101, 0), (120, 0b110), (121, 0)];
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, 118), Stop::Reached);
    assert_eq!(cpu.exception(), 16);
    cpu.run(&mut board, 133);
    assert_eq!(cpu.exception(), 17);
    cpu.run(&mut board, 1_000);
    assert_eq!((traced(&cpu), cpu.exception()), (0x123, 0));
}

#[test]
fn primask_holds_everything_back_until_it_is_lifted() {
    let program = [write(ISER, 1), vec![CPSID_I], write(ISPR, 1), vec![0x0025, CPSIE_I, BREAKPOINT]].concat();
    // `movs r5, r4` between the pending and the lifting.
    let mut board = Board::with_program(&program);
    board.handler(16, &trace(7));
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(0));
    assert_eq!((cpu.register(5), traced(&cpu)), (0, 7));
}

#[test]
fn a_masked_line_wakes_from_wfi_without_being_taken() {
    let program = [write(ISER, 1), vec![CPSID_I, WFI, BREAKPOINT]].concat();
    let mut board = Board::with_program(&program);
    board.handler(16, &trace(1));
    board.schedule = vec![(1_000_000, 1)];
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(0));
    assert_eq!(traced(&cpu), 0);
    // Sleep is one jump of the clock.
    assert!(cpu.now() >= 1_000_000 && cpu.now() < 1_000_010 && cpu.instructions() < 20);
}

#[test]
fn basepri_hides_what_it_holds_back_and_wfi_sleeps_through_it() {
    // msr BASEPRI, r1
    let mask = [constant(1, 0x40), vec![0xf381, 0x8811]].concat();
    let pend = [write(IPR, 0x8020), write(ISER, 3), mask, write(ISPR, 2)].concat();
    let mut board = Board::with_program(&[pend.clone(), read(ICSR), vec![BREAKPOINT]].concat());
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(0));
    assert_eq!(cpu.register(2) >> 12 & 0x1ff, 0);
    // Line 1 (0x80) is held back and does not wake; line 0 (0x20) does.
    let mut board = Board::with_program(&[pend, vec![WFI, BREAKPOINT]].concat());
    board.handler(16, &trace(1));
    board.schedule = vec![(5_000, 1), (5_001, 0)];
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(0));
    assert!(cpu.now() > 5_000);
    assert_eq!(traced(&cpu), 1);
}

#[test]
fn nmi_goes_through_every_mask() {
    // cpsid f as well.
    let mut board = Board::with_program(&[CPSID_I, 0xb671, FOREVER]);
    board.handler(2, &trace(9));
    let mut cpu = boot(&mut board);
    cpu.run(&mut board, 50);
    board.nmi = true;
    cpu.run(&mut board, 200);
    // The level is one edge: it is taken once.
    assert_eq!((traced(&cpu), cpu.exception()), (9, 0));
}

#[test]
fn the_timer_interrupts_once_a_period_to_the_cycle() {
    let program = [write(STK_LOAD, 99), write(STK_VAL, 0), write(STK_CTRL, 7), vec![FOREVER]].concat();
    let mut board = Board::with_program(&program);
    board.handler(15, &[0x3401, RETURN]);
    let mut cpu = boot(&mut board);
    cpu.run(&mut board, 100_000);
    let first = traced(&cpu);
    cpu.run(&mut board, 200_000);
    assert_eq!(traced(&cpu) - first, 1_000);
}

#[test]
fn the_timer_counts_down_and_reloads() {
    let program = [
        write(STK_LOAD, 999),
        write(STK_VAL, 5),
        write(STK_CTRL, 5),
        read(STK_VAL),
        vec![0x0016], // movs r6, r2
        read(STK_VAL),
        vec![BREAKPOINT],
    ]
    .concat();
    let mut board = Board::with_program(&program);
    let mut cpu = boot(&mut board);
    cpu.run(&mut board, NEVER);
    let (before, after) = (cpu.register(6), cpu.register(2));
    assert!(before < 999 && after < before && before - after < 10, "{before} {after}");
}

#[test]
fn a_line_that_no_handler_clears_still_lets_instructions_run_between() {
    let mut board = idling(0);
    board.schedule = vec![(100, 1)];
    let mut cpu = boot(&mut board);
    cpu.run(&mut board, 10_000);
    let trapped = cpu.instructions();
    cpu.run(&mut board, 20_000);
    assert!(cpu.instructions() > trapped);
}

#[test]
fn the_priority_registers_hold_four_bits() {
    let program = [write(IPR, 0xffff_ffff), read(IPR), constant(3, 0), vec![BREAKPOINT]].concat();
    let mut board = Board::with_program(&program);
    let mut cpu = boot(&mut board);
    cpu.run(&mut board, NEVER);
    assert_eq!(cpu.register(2), 0xf0f0_f0f0);
}

#[test]
fn handlers_are_timed_with_entry_and_return_and_without_what_preempts_them() {
    // Line 0 (less urgent) runs sixteen cycles of its own, in the middle of which line 1 comes.
    let mut board = idling(0x0000_0080);
    board.handler(16, &[[NOP; 13].as_slice(), &[RETURN]].concat());
    board.handler(17, &[RETURN]);
    board.schedule = vec![(100, 1), (101, 0), (120, 2), (121, 0)];
    let mut cpu = boot(&mut board);
    cpu.time_handlers();
    assert_eq!(cpu.run(&mut board, 1_000), Stop::Reached);
    let [outer, inner] = [16, 17].map(|number| cpu.handler_time(number));
    // Entry and return take 12 and 10 cycles, the branch that returns one: it refills nothing.
    assert_eq!((inner.runs, inner.total, inner.longest, inner.longest_span), (1, 23, 23, 23));
    assert_eq!((outer.runs, outer.total, outer.longest, outer.longest_span), (1, 36, 36, 36 + 23));
    assert_eq!(cpu.handler_time(18).runs, 0);
    assert_eq!(cpu.asleep(), 0);
}
