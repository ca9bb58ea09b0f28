//! Supplies that fail, and a debugger that halts the core: the chip's brown-out, encoders without power, requests of DMA
//! that an abort leaves behind.
#![allow(
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails loudly and shows its figures"
)]

mod elf_rig;

use elf_rig::{BOTH, Board, Conversation, ElfBoard, Standing, Wired};
use vergence_cpu::{Access, Bus};
use vergence_mcu::{Picoseconds, ResetCause as Bite};
use vergence_plant::{AxisPlant, EncoderFault, NativeBoard};
use vergence_protocol::{AxisMask, ControllerState, FaultCode, MovePhase, ResetCause, Status};

const HERBIVORE: [i32; 2] = [145_000, 2_094_395];
/// Where a move at full speed goes and returns, in micro-units.
const THERE: [i32; 2] = [145_000, 40_000];
const TIM1_EGR: u32 = 0x4001_2C14;
const DBGMCU_APB1FZR1: u32 = 0xE004_2008;

/// In the middle of a move at full speed.
fn under_way<B: Board>(targets: [i32; 2]) -> Conversation<B> {
    let mut talk = Conversation::<B>::homed(&Standing::default());
    assert_eq!(talk.move_to(targets, 1), Status::Accepted);
    talk.wait(400_000);
    assert_eq!(talk.pose().state, ControllerState::Moving);
    talk
}

fn write(talk: &mut Conversation<ElfBoard>, register: u32, value: u32) {
    let cycle = talk.board.machine.cpu().now();
    talk.board.machine.chip_mut().write(cycle, register, Access::Word, value).expect("it is there");
}

#[test]
fn a_brown_out_in_mid_move_cuts_the_drivers_and_is_told_as_power_on() {
    let mut talk = under_way::<ElfBoard>(HERBIVORE);
    // The factory's threshold is 1.64 V.
    talk.board.machine.set_supply(1_900);
    talk.wait(50_000);
    assert_eq!((talk.pose().state, talk.board.machine.resets()), (ControllerState::Moving, 0));
    talk.board.machine.set_supply(1_500);
    talk.wait(5_000);
    assert!(!talk.board.plant().drivers_on());
    talk.board.machine.set_supply(3_300);
    talk.reconnect(8);
    assert_eq!(talk.board.machine.last_reset(), Bite::BrownOut);
    assert_eq!(talk.info().reset, ResetCause::PowerOn);
    assert_eq!((talk.pose().state, talk.pose().referenced), (ControllerState::Idle, AxisMask(0)));
}

#[test]
fn a_debugger_may_halt_the_firmware_where_it_freezes_the_watchdog() {
    for (freeze, resets) in [(1 << 12, 0), (0, 1)] {
        let mut talk = Conversation::<ElfBoard>::open(&Standing::default());
        write(&mut talk, DBGMCU_APB1FZR1, freeze);
        talk.board.machine.halt_core(Picoseconds::milliseconds(2_000));
        assert_eq!(talk.board.machine.resets(), resets);
        talk.now.0 = talk.now.0.max(talk.board.machine.time().0 / 1_000_000 + 1_000);
        // The tick goes on.
        talk.wait(1_000_000);
        assert_eq!(talk.board.machine.resets(), resets);
        talk.reconnect(8);
        assert_eq!(talk.info().reset, if freeze == 0 { ResetCause::Watchdog } else { ResetCause::PowerOn });
        talk.arm_and_home();
    }
}

/// A step's request to DMA comes while its list is dropped: the chip serves it with the next list. It is neither a step nor
/// a period of that list.
#[test]
fn a_request_that_an_abort_leaves_behind_is_no_step() {
    let steps = |left_behind: bool| {
        let mut talk = Conversation::<ElfBoard>::homed(&Standing::default());
        if left_behind {
            // The compare event of channel 1, while no list runs and its DMA channel is off.
            write(&mut talk, TIM1_EGR, 1 << 1);
        }
        assert_eq!(talk.move_to(THERE, 1), Status::Accepted);
        talk.wait_for(ControllerState::Ready);
        assert_eq!((talk.pose().phase, talk.faults.as_slice()), (MovePhase::Settled, [].as_slice()));
        talk.steps()
    };
    assert_eq!(steps(true), steps(false));
}

/// Gaps in the supply of an encoder, in microseconds of full speed, from one that loses less than the tolerance of 20 um to
/// one that loses 4 mm.
const GAPS_US: [u64; 6] = [100, 400, 2_000, 5_000, 10_000, 50_000];
/// Those of the firmware, which takes longer.
const GAPS_OF_THE_CHIP_US: [u64; 3] = [100, 400, 5_000];

/// The encoder of axis 0 loses its supply in mid-move. Returns what became of the move, and the difference of encoder and
/// truth, in micrometres, before and after homing.
fn gap<B: Board>(us: u64) -> (Option<FaultCode>, AxisMask, [f64; 2]) {
    let mut talk = under_way::<B>(THERE);
    let off = |talk: &Conversation<B>| f64::from(talk.pose().counts[0].0) * 0.5 - talk.loads()[0];
    let encoder = |talk: &mut Conversation<B>, act: fn(&mut AxisPlant)| {
        talk.board.with_plant(|plant| act(plant.axis_mut(0).expect("it is there")));
    };
    encoder(&mut talk, |axis| axis.fail_encoder(Some(EncoderFault::Stuck)));
    talk.now.0 += us;
    talk.board.advance(talk.now);
    encoder(&mut talk, AxisPlant::mend_encoder);
    talk.wait(2_000_000);
    let (code, referenced, lost) = (talk.pose().fault.map(|fault| fault.code), talk.pose().referenced, off(&talk));
    if code.is_some() {
        assert_eq!(talk.clear(), Status::Accepted);
    }
    talk.arm_and_home();
    talk.wait(100_000);
    (code, referenced, [lost, off(&talk)])
}

/// Counts that were not counted are noticed on the way or at its end, once there are more of them than the tolerance: there
/// is no need of a wire that tells of the encoder's supply.
#[test]
fn a_gap_in_the_supply_of_an_encoder_leaves_no_wrong_position() {
    let natively = GAPS_US.map(|us| (us, gap::<NativeBoard>(us)));
    let on_the_chip = GAPS_OF_THE_CHIP_US.map(|us| (us, gap::<ElfBoard>(us)));
    for (us, (code, referenced, [lost, homed])) in natively.into_iter().chain(on_the_chip) {
        println!("{us} us: {code:?}, {lost:.0} um lost, {homed:.0} um off after homing");
        if code.is_none() {
            assert!(lost.abs() < 25.0 && referenced == BOTH, "{us}: {lost}");
        } else {
            assert!(!referenced.contains(0), "{us}: {lost} um off, and the axis claims to know where it is");
        }
        assert!(homed.abs() < 10.0, "{us}: {homed}");
    }
}
