//! Faults, lockup, floating-point frames, sleep and events, reset.

mod common;

use common::code::{
    AIRCR, BREAKPOINT, CCR, CFSR, CPACR, DEMCR, DWT_CTRL, DWT_CYCCNT, FOREVER, FPCCR, HFSR, ICSR, ISER, ISPR, NOP,
    RETURN, SCR, SEV, SHCSR, SUPERVISOR_CALL, UNDEFINED, VTOR, WFE, WFI, constant, read, trace, write,
};
use common::{Board, RAM, RAM_SIZE, boot};
use vergence_cpu::{NEVER, Stop};

const HARD_FAULT: u32 = 3;

#[test]
fn a_fault_in_the_hard_fault_handler_locks_up_and_time_goes_on() {
    let mut board = Board::with_program(&[UNDEFINED]);
    board.handler(HARD_FAULT, &[UNDEFINED]);
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Lockup);
    let instructions = cpu.instructions();
    assert_eq!(cpu.run(&mut board, 5_000), Stop::Reached);
    assert_eq!((cpu.instructions(), cpu.now()), (instructions, 5_000));
    cpu.reset(&mut board);
    assert_eq!((cpu.pc(), cpu.now()), (0x400, 5_000));
}

#[test]
fn an_unreadable_vector_is_a_hard_fault_and_then_a_lockup() {
    let program = [write(VTOR, 0x7000_0000), vec![SUPERVISOR_CALL]].concat();
    let mut board = Board::with_program(&program);
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Lockup);
}

#[test]
fn a_reset_vector_nowhere_is_a_lockup() {
    let mut board = Board::default();
    board.code.clear();
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Lockup);
}

#[test]
fn a_stack_outside_memory_is_a_fault_of_stacking() {
    // mov sp, r1
    let program = [constant(1, 0x7000_0000), vec![0x468d, SUPERVISOR_CALL]].concat();
    let mut board = Board::with_program(&program);
    // The hard fault handler puts CFSR where the test looks: R2.
    board.handler(HARD_FAULT, &[read(CFSR), vec![BREAKPOINT]].concat());
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(0));
    assert_eq!(cpu.register(2), 1 << 12);
}

#[test]
fn failing_accesses_may_be_ignored_in_a_hard_fault_handler() {
    let mut board = Board::with_program(&[UNDEFINED]);
    board.handler(HARD_FAULT, &[write(CCR, 1 << 8), read(0x7000_0000), vec![BREAKPOINT]].concat());
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(0));
    assert_eq!(cpu.register(2), 0);
}

#[test]
fn a_breakpoint_without_a_debugger_is_a_hard_fault() {
    let mut board = Board::with_program(&[0xbe01]);
    board.handler(HARD_FAULT, &[read(HFSR), vec![BREAKPOINT]].concat());
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(1));
    cpu.escalate_breakpoint();
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(0));
    assert_eq!((cpu.register(2), cpu.exception()), (1 << 31, 3));
}

#[test]
fn a_bad_return_value_is_a_usage_fault() {
    // The SVC handler returns to 0xffffffe5, which is no EXC_RETURN.
    let program = [write(SHCSR, 7 << 16), vec![SUPERVISOR_CALL]].concat();
    let mut board = Board::with_program(&program);
    board.handler(11, &[constant(1, 0xffff_ffe5), vec![0x4708]].concat());
    board.handler(6, &[read(CFSR), vec![BREAKPOINT]].concat());
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(0));
    assert_eq!((cpu.register(2), cpu.exception()), (1 << 18, 6));
}

#[test]
fn a_stacked_handler_mode_contradicts_a_return_to_thread_mode() {
    // The SVC handler writes an exception number into the stacked xPSR: ldr r0, [sp, #28]; adds r0, #11;
    // str r0, [sp, #28]; bx lr.
    let program = [write(SHCSR, 7 << 16), vec![SUPERVISOR_CALL, FOREVER]].concat();
    let mut board = Board::with_program(&program);
    board.handler(11, &[0x9807, 0x300b, 0x9007, RETURN]);
    board.handler(6, &[read(CFSR), vec![BREAKPOINT]].concat());
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(0));
    assert_eq!(cpu.register(2), 1 << 18);
}

#[test]
fn the_fault_status_says_what_happened() {
    let mut board = Board::with_program(&read(0x7000_0000));
    board.handler(HARD_FAULT, &[UNDEFINED]);
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.fault_status().reasons().count(), 0);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Lockup);
    let status = cpu.fault_status();
    let reasons: Vec<_> = status.reasons().collect();
    let expected = ["data access that nothing answers", "undefined instruction", "fault escalated to HardFault"];
    assert_eq!((reasons, status.bus_address), (expected.to_vec(), Some(0x7000_0000)));
}

/// `vmov s0, r5` with R5 = 77, then an interrupt of line 0, then `vmov r6, s0`.
fn float_program(context_control: u32, handler: &[u16]) -> (Board, u32) {
    let program = [
        write(CPACR, 0xf << 20),
        write(FPCCR, context_control),
        write(ISER, 1),
        constant(5, 77),
        vec![0xee00, 0x5a10],
        write(ISPR, 1),
        vec![0xf3bf, 0x8f6f, 0xee10, 0x6a10, BREAKPOINT],
    ]
    .concat();
    let mut board = Board::with_program(&program);
    board.handler(16, handler);
    // The frame of 26 words, and where S0 is in it.
    (board, RAM + RAM_SIZE as u32 - 0x68 + 0x20)
}

#[test]
fn lazy_stacking_stores_only_when_the_handler_computes() {
    const LAZY: u32 = 0xc000_0000;
    let (mut board, place) = float_program(LAZY, &[RETURN]);
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(0));
    assert_eq!((cpu.register(6), board.word(place)), (77, 0));
    // movs r3, #5; vmov s0, r3: the state goes to its place first.
    let (mut board, place) = float_program(LAZY, &[0x2305, 0xee00, 0x3a10, RETURN]);
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(0));
    assert_eq!((cpu.register(6), board.word(place)), (77, 77));
}

#[test]
fn eager_stacking_stores_at_once_and_takes_longer() {
    let time = |control, handler: &[u16]| {
        let (mut board, place) = float_program(control, handler);
        let mut cpu = boot(&mut board);
        assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(0));
        assert_eq!(cpu.register(6), 77);
        (cpu.now(), board.word(place))
    };
    let (eager, stored) = time(0x8000_0000, &[RETURN]);
    let (lazy, reserved) = time(0xc000_0000, &[RETURN]);
    assert_eq!((stored, reserved), (77, 0));
    assert!(eager > lazy);
}

#[test]
fn without_automatic_state_a_handler_spoils_the_registers() {
    let (mut board, _) = float_program(0, &[0x2305, 0xee00, 0x3a10, RETURN]);
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(0));
    assert_eq!(cpu.register(6), 5);
}

#[test]
fn wfe_consumes_an_event_and_then_sleeps() {
    let mut board = Board::with_program(&[SEV, WFE, 0x2501, WFE, BREAKPOINT]);
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, 10_000), Stop::Reached);
    assert!(cpu.is_asleep());
    assert_eq!((cpu.register(5), cpu.instructions()), (1, 4));
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Asleep);
}

#[test]
fn an_exception_sets_the_event_that_the_next_wfe_takes() {
    let mut board = Board::with_program(&[SUPERVISOR_CALL, WFE, BREAKPOINT]);
    board.handler(11, &[RETURN]);
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, 10_000), Stop::Breakpoint(0));
}

#[test]
fn a_disabled_line_wakes_wfe_only_with_sevonpend() {
    for (control, stop) in [(1 << 4, Stop::Breakpoint(0)), (0, Stop::Reached)] {
        let mut board = Board::with_program(&[write(SCR, control), vec![WFE, BREAKPOINT]].concat());
        board.schedule = vec![(1_000, 1)];
        let mut cpu = boot(&mut board);
        assert_eq!(cpu.run(&mut board, 10_000), stop);
    }
}

#[test]
fn sleep_on_exit_returns_to_sleep() {
    let program = [write(SCR, 2), write(ISER, 1), vec![WFI, BREAKPOINT]].concat();
    let mut board = Board::with_program(&program);
    board.handler(16, &trace(1));
    board.schedule = vec![(1_000, 1), (1_001, 0), (2_000, 1), (2_001, 0)];
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, 10_000), Stop::Reached);
    assert_eq!((cpu.register(4), cpu.is_asleep()), (0x11, true));
}

#[test]
fn the_program_asks_for_a_reset_and_starts_again() {
    let mut board = Board::with_program(&[write(AIRCR, 0x05fa_0004), vec![FOREVER]].concat());
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, 1_000), Stop::ResetRequested);
    let when = cpu.now();
    cpu.reset(&mut board);
    assert_eq!((cpu.pc(), cpu.now()), (0x400, when));
    assert_eq!(cpu.run(&mut board, 1_000), Stop::ResetRequested);
    // Without the key nothing happens.
    let mut board = Board::with_program(&[write(AIRCR, 4), vec![FOREVER]].concat());
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, 1_000), Stop::Reached);
}

#[test]
fn the_cycle_counter_counts_the_clock() {
    let program = [
        write(DEMCR, 1 << 24),
        write(DWT_CYCCNT, 0),
        write(DWT_CTRL, 1),
        vec![NOP; 100],
        read(DWT_CYCCNT),
        vec![BREAKPOINT],
    ]
    .concat();
    let mut board = Board::with_program(&program);
    let mut cpu = boot(&mut board);
    cpu.run(&mut board, NEVER);
    assert!((100..110).contains(&cpu.register(2)), "{}", cpu.register(2));
}

#[test]
fn pendsv_waits_for_the_handler_above_it() {
    // SVC above PendSV: the SVC handler pends it, it follows.
    let program = [write(0xe000_ed20, 0x00f0_0000), vec![SUPERVISOR_CALL, BREAKPOINT]].concat();
    let mut board = Board::with_program(&program);
    board.handler(11, &[write(ICSR, 1 << 28), trace(1)].concat());
    board.handler(14, &trace(2));
    let mut cpu = boot(&mut board);
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Breakpoint(0));
    assert_eq!(cpu.register(4), 0x12);
}

#[test]
fn the_chip_can_ask_to_stop() {
    let mut board = Board::with_program(&[FOREVER]);
    let mut cpu = boot(&mut board);
    board.stop = true;
    assert_eq!(cpu.run(&mut board, NEVER), Stop::Requested);
}

#[test]
fn a_snapshot_runs_on_as_the_original_does() {
    let mut board = Board::with_program(&[write(ISER, 1), vec![FOREVER]].concat());
    board.handler(16, &trace(1));
    board.schedule = vec![(500, 1), (501, 0)];
    let mut cpu = boot(&mut board);
    cpu.run(&mut board, 300);
    let (mut twin, mut other) = (cpu.clone(), board.clone());
    cpu.run(&mut board, 1_000);
    twin.run(&mut other, 1_000);
    assert_eq!((cpu.register(4), cpu.instructions(), cpu.now()), (twin.register(4), twin.instructions(), twin.now()));
    assert_eq!(cpu.register(4), 1);
}
