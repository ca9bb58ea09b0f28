//! Core and chip together, with programs assembled by hand: resets, stops, snapshots, traces.
#![allow(clippy::unwrap_used, reason = "a test fails by panic")]

mod common;

use common::pin;
use vergence_cpu::{Access, Bus};
use vergence_mcu::{
    ChipConfig, Damage, Firmware, FirmwareError, Halt, Machine, Nothing, Picoseconds, PowerCut, ResetCause, RttBuffer,
    Stops, read_rtt,
};

const FLASH: u32 = 0x0800_0000;
const CODE: u32 = FLASH + 0x100;
const POOL: u32 = FLASH + 0x200;
/// BKPT 9 and a hang.
const NMI: u32 = FLASH + 0x1F0;

/// B to itself.
const HANG: u16 = 0xE7FE;

/// Half-words of a program and the words that it loads.
#[derive(Default)]
struct Program {
    code: Vec<u16>,
    pool: Vec<u32>,
}

impl Program {
    fn emit(mut self, code: &[u16]) -> Self {
        self.code.extend(code);
        self
    }

    /// LDR Rt, =value
    fn load(mut self, register: u16, value: u32) -> Self {
        let pc = CODE + 2 * self.code.len() as u32 + 4;
        let offset = POOL + 4 * self.pool.len() as u32 - (pc & !3);
        self.pool.push(value);
        self.code.push(0x4800 | register << 8 | (offset / 4) as u16);
        self
    }

    /// *address = value, through R0 and R1.
    fn store(self, address: u32, value: u32) -> Self {
        self.load(0, address).load(1, value).emit(&[0x6001])
    }

    fn firmware(&self) -> Firmware {
        let mut words = vec![CODE | 1; 64];
        words[0] = 0x2000_8000;
        words[2] = NMI | 1;
        let mut bytes: Vec<u8> = words.iter().flat_map(|word: &u32| word.to_le_bytes()).collect();
        bytes.extend(self.code.iter().flat_map(|half| half.to_le_bytes()));
        bytes.resize((NMI - FLASH) as usize, 0);
        bytes.extend([0x09, 0xBE, 0xFE, 0xE7]);
        bytes.resize((POOL - FLASH) as usize, 0);
        bytes.extend(self.pool.iter().flat_map(|word| word.to_le_bytes()));
        Firmware::from_image(FLASH, &bytes)
    }

    fn machine(&self) -> Machine<Nothing> {
        let mut machine = Machine::new(ChipConfig::default(), Nothing);
        machine.load(self.firmware()).unwrap();
        machine
    }
}

/// Toggles PA5 for ever.
fn blinking() -> Machine<Nothing> {
    Program::default()
        .store(0x4002_104C, 1)
        .store(0x4800_0000, 0xABFF_F7FF)
        // MOVS R2, #32; STR R2, [R0, #0x18]; STR R2, [R0, #0x28]; B to the first store
        .emit(&[0x2220, 0x6182, 0x6282, 0xE7FC])
        .machine()
}

#[test]
fn a_snapshot_goes_on_like_the_original() {
    let mut machine = blinking();
    machine.chip_mut().trace(&[pin("PA5")]);
    assert_eq!(machine.run_until(Picoseconds::microseconds(3)), Halt::Reached);
    let mut twin = machine.clone();
    machine.run_until(Picoseconds::microseconds(50));
    for step in 1..=47 {
        twin.run_until(Picoseconds::microseconds(3 + step));
    }
    assert_eq!(machine.chip().vcd(|pin| pin.to_string()), twin.chip().vcd(|pin| pin.to_string()));
    assert_eq!(machine.cpu().now(), twin.cpu().now());
    assert_eq!(machine.cpu().instructions(), twin.cpu().instructions());
}

#[test]
fn a_trace_is_a_value_change_dump() {
    let mut machine = blinking();
    machine.chip_mut().trace(&[pin("PA5")]);
    machine.run_until(Picoseconds::microseconds(3));
    let dump = machine.chip().vcd(|_| "LED".to_owned());
    let begin = "$timescale 1 ps $end\n$scope module stm32g474 $end\n$var wire 1 ! LED $end\n$upscope $end\n\
                 $enddefinitions $end\n#0\n$dumpvars\n0!\n$end\n#";
    assert!(dump.starts_with(begin), "{dump}");
    let instants: Vec<u64> = dump.lines().filter_map(|line| line.strip_prefix('#')?.parse().ok()).collect();
    assert!(instants.len() > 5 && instants.windows(2).all(|pair| pair[0] < pair[1]));
    assert!(instants.iter().all(|at| at % 62_500 == 0), "whole cycles of 16 MHz");
    let levels: Vec<_> = dump.lines().skip(9).filter(|line| line.ends_with('!')).collect();
    assert!(levels.chunks_exact(2).all(|pair| pair == ["1!", "0!"]));
}

#[test]
fn trouble_stops_with_a_sentence() {
    let mut machine = Program::default().load(0, 0x4800_0000).emit(&[0x6801, HANG]).machine();
    let halt = machine.run_for(Picoseconds::milliseconds(1));
    assert_eq!(
        halt.to_string(),
        "GPIOA is used while its clock is off in RCC (MODER); at 0x08000104, 0.000000 s after power-on"
    );
}

#[test]
fn a_lenient_chip_goes_on_and_keeps_a_note() {
    let program = Program::default().load(0, 0x4800_0000).emit(&[0x6801, HANG]);
    let mut machine = Machine::new(ChipConfig { strict: false, ..ChipConfig::default() }, Nothing);
    machine.load(program.firmware()).unwrap();
    assert_eq!(machine.run_for(Picoseconds::milliseconds(1)), Halt::Reached);
    assert_eq!(machine.cpu().register(1), 0);
    assert_eq!(machine.chip().troubles().len(), 1);
}

#[test]
fn a_software_reset_starts_again_and_is_known() {
    // Unless SFTRSTF says that it happened: LDR R1, [R0]; LSRS R1, R1, #29; BCS over the next three to the hang.
    let mut machine = Program::default()
        .load(0, 0x4002_1094)
        .emit(&[0x6801, 0x0F49, 0xD202])
        .store(0xE000_ED0C, 0x05FA_0004)
        .emit(&[HANG])
        .machine();
    machine.run_for(Picoseconds::milliseconds(1));
    assert_eq!((machine.resets(), machine.last_reset()), (1, ResetCause::Software));
    machine.press_reset();
    assert_eq!((machine.resets(), machine.last_reset()), (2, ResetCause::Pin));
    machine.power_on();
    machine.run_for(Picoseconds::milliseconds(1));
    assert_eq!((machine.resets(), machine.last_reset()), (1, ResetCause::Software));
}

#[test]
fn a_hang_ends_with_the_watchdog() {
    let mut machine = Program::default().store(0x4000_3000, 0xCCCC).emit(&[HANG]).machine();
    // As it comes: 4096 counts of 32 kHz / 4.
    machine.run_until(Picoseconds::milliseconds(511));
    assert_eq!(machine.resets(), 0);
    machine.run_until(Picoseconds::milliseconds(513));
    assert_eq!((machine.resets(), machine.last_reset()), (1, ResetCause::Watchdog));
    machine.run_until(Picoseconds::milliseconds(1_100));
    assert_eq!(machine.resets(), 2);
}

/// DBGMCU_APB1FZR1, whose bit 12 freezes the independent watchdog under a debugger (RM0440 §47.6.4).
const APB1FZR1: u32 = 0xE004_2008;

#[test]
fn a_debugger_halts_the_core_and_the_watchdog_only_where_it_is_frozen() {
    let started = || Program::default().store(0x4000_3000, 0xCCCC).emit(&[HANG]).machine();
    let mut machine = started();
    machine.run_until(Picoseconds::milliseconds(10));
    let pc = machine.place().pc;
    assert_eq!(machine.halt_core(Picoseconds::milliseconds(2_000)), Halt::Reached);
    assert_eq!((machine.resets(), machine.last_reset()), (1, ResetCause::Watchdog));

    let mut machine = started();
    machine.run_until(Picoseconds::milliseconds(10));
    let now = machine.cpu().now();
    machine.chip_mut().write(now, APB1FZR1, Access::Word, 1 << 12).unwrap();
    let instructions = machine.cpu().instructions();
    machine.halt_core(Picoseconds::milliseconds(2_000));
    assert_eq!((machine.resets(), machine.place().pc, machine.cpu().instructions()), (0, pc, instructions));
    // It goes on from where it stood: 512 ms of its own time.
    machine.run_until(Picoseconds::milliseconds(2_511));
    assert_eq!(machine.resets(), 0);
    machine.run_until(Picoseconds::milliseconds(2_513));
    assert_eq!(machine.resets(), 1);
    let now = machine.cpu().now();
    let kept = machine.chip_mut().read(now, APB1FZR1, Access::Word).unwrap();
    assert_eq!(kept, 1 << 12, "a system reset leaves the debug registers alone");
}

#[test]
fn a_supply_below_the_brown_out_threshold_holds_the_chip_in_reset() {
    let mut machine = blinking();
    machine.run_until(Picoseconds::microseconds(20));
    // Level 0, as delivered: 1.64 V falling, 1.66 V rising.
    machine.set_supply(1_700);
    machine.run_until(Picoseconds::microseconds(40));
    assert_eq!(machine.resets(), 0);
    machine.chip_mut().ram_mut()[..4].copy_from_slice(b"lost");
    machine.set_supply(1_600);
    let instructions = machine.cpu().instructions();
    machine.run_until(Picoseconds::microseconds(100));
    machine.set_supply(1_650);
    machine.run_until(Picoseconds::microseconds(120));
    assert_eq!((machine.cpu().instructions(), machine.chip().is_high(pin("PA5"))), (instructions, false));
    machine.set_supply(3_300);
    machine.run_until(Picoseconds::microseconds(140));
    assert!(machine.cpu().instructions() > instructions);
    assert_eq!((machine.resets(), machine.last_reset()), (1, ResetCause::BrownOut));
    assert_ne!(&machine.chip().ram()[..4], b"lost");
    let now = machine.cpu().now();
    // Nothing but the flags of power and pin (§7.4.28).
    assert_eq!(machine.chip_mut().read(now, 0x4002_1094, Access::Word).unwrap(), 0x0C00_0000);
}

#[test]
fn ram_survives_every_reset_but_power_on() {
    let mut machine = Program::default().emit(&[HANG]).machine();
    machine.chip_mut().ram_mut()[..4].copy_from_slice(b"keep");
    machine.press_reset();
    assert_eq!(&machine.chip().ram()[..4], b"keep");
    machine.power_on();
    assert_ne!(&machine.chip().ram()[..4], b"keep");
}

#[test]
fn breakpoints_stop_only_on_request() {
    // Every exception runs the same code, so without a debugger the second breakpoint locks up.
    let mut machine = Program::default().emit(&[0xBE07, HANG]).machine();
    machine.set_stops(Stops { breakpoints: true, ..Stops::default() });
    let halt = machine.run_for(Picoseconds::milliseconds(1));
    assert!(matches!(halt, Halt::Breakpoint { number: 7, .. }), "{halt}");
    machine.set_stops(Stops { lockups: true, ..Stops::default() });
    let halt = machine.run_for(Picoseconds::milliseconds(1));
    assert!(matches!(halt, Halt::Lockup { .. }), "{halt}");
    machine.set_stops(Stops::default());
    assert_eq!(machine.run_for(Picoseconds::milliseconds(1)), Halt::Reached);
    assert!(machine.last_lockup().is_some());
}

/// Erases page 100 of a bank and waits for the end; returns the instructions that took.
fn erasing(bank: u32) -> (Machine<Nothing>, u64) {
    let cr = 2 | 100 << 3 | bank << 11;
    let mut machine = Program::default()
        .store(0x4002_2008, 0x4567_0123)
        .store(0x4002_2008, 0xCDEF_89AB)
        .store(0x4002_2014, cr)
        .store(0x4002_2014, cr | 1 << 16)
        .load(0, 0x4002_2010)
        // LDR R1, [R0]; LSRS R1, R1, #17; BCS to the load; BKPT
        .emit(&[0x6801, 0x0C49, 0xD2FC, 0xBE00])
        .machine();
    machine.set_stops(Stops { breakpoints: true, ..Stops::default() });
    let halt = machine.run_for(Picoseconds::milliseconds(50));
    assert!(matches!(halt, Halt::Breakpoint { .. }), "{halt}");
    let instructions = machine.cpu().instructions();
    (machine, instructions)
}

#[test]
fn code_in_the_bank_being_erased_stands_still() {
    for (bank, stands) in [(0, true), (1, false)] {
        let (machine, instructions) = erasing(bank);
        let micros = machine.time().0 / 1_000_000;
        assert!((22_020..22_040).contains(&micros), "{micros} µs");
        assert_eq!(instructions < 100, stands, "{instructions} instructions");
        let page = 0x4_0000 * bank as usize + 100 * 2048;
        assert!(machine.chip().flash()[page..page + 2048].iter().all(|&byte| byte == 0xFF));
    }
}

/// Programs a double word of bank 2 from outside.
fn program(machine: &mut Machine<Nothing>, address: u32) {
    let now = machine.cpu().now();
    let chip = machine.chip_mut();
    for (register, value) in [
        (0x4002_2008, 0x4567_0123),
        (0x4002_2008, 0xCDEF_89AB),
        (0x4002_2014, 1),
        (address, 0x1234_5678),
        (address + 4, 0x9ABC_DEF0),
    ] {
        chip.write(now, register, Access::Word, value).unwrap();
    }
}

#[test]
fn a_power_cut_restarts_the_board_with_a_torn_word_that_raises_nmi_at_its_read() {
    let mut machine = Program::default().load(0, 0x0804_0000).emit(&[0x6801, 0xBE01, HANG]).machine();
    machine.set_stops(Stops { breakpoints: true, ..Stops::default() });
    assert!(matches!(machine.run_for(Picoseconds::milliseconds(1)), Halt::Breakpoint { number: 1, .. }));
    machine.chip_mut().set_power_cut(Some(PowerCut { operation: 1, damage: Damage::Torn { seed: 3 } }));
    program(&mut machine, 0x0804_0000);
    let halt = machine.run_for(Picoseconds::milliseconds(1));
    assert!(matches!(halt, Halt::PowerLost { .. }), "{halt}");
    assert_eq!(machine.last_reset(), ResetCause::PowerOn);
    let halt = machine.run_for(Picoseconds::milliseconds(1));
    assert!(
        matches!(halt, Halt::Breakpoint { number: 9, .. }),
        "the handler comes before the next instruction: {halt}"
    );
}

#[test]
fn logs_in_ram_are_read_in_the_manner_of_rtt() {
    let mut ram = vec![0u8; 128 * 1024];
    let word = |ram: &mut Vec<u8>, at: usize, value: u32| ram[at..at + 4].copy_from_slice(&value.to_le_bytes());
    assert_eq!(RttBuffer::find(&ram, 0), None);
    ram[0x400..0x40A].copy_from_slice(b"SEGGER RTT");
    word(&mut ram, 0x410, 1);
    for (field, value) in [(4, 0x2000_1000), (8, 8), (12, 5), (16, 0)] {
        word(&mut ram, 0x418 + field, value);
    }
    ram[0x1000..0x1008].copy_from_slice(b"hello567");
    let buffer = RttBuffer::find(&ram, 0).unwrap();
    assert_eq!(read_rtt(&mut ram, buffer), b"hello");
    assert_eq!(read_rtt(&mut ram, buffer), b"");
    word(&mut ram, 0x418 + 12, 2);
    assert_eq!(read_rtt(&mut ram, buffer), b"567he", "around the end");
    assert_eq!(RttBuffer::find(&ram, 1), None);
}

#[test]
fn what_is_no_firmware_is_refused() {
    assert!(matches!(Firmware::from_elf(b"no ELF"), Err(FirmwareError::NotElf(_))));
    let mut machine = Machine::new(ChipConfig::default(), Nothing);
    let beyond = Firmware::from_image(0x0808_0000, &[0]);
    assert_eq!(machine.load(beyond), Err(FirmwareError::OutsideFlash { address: 0x0808_0000, length: 1 }));
}
