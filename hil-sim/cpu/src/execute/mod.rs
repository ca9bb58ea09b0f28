//! What each instruction does (A7.7).

mod alu;
mod branch;
mod float;
mod memory;
mod multiply;
mod parallel;

use crate::bus::Bus;
use crate::cpu::{Activity, Cpu};
use crate::instruction::{Flags, Instruction, Op, Width};

/// Why an instruction did not end normally.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Trap {
    Undefined,
    NoCoprocessor,
    InvalidState,
    Unaligned,
    DivideByZero,
    /// A data access that failed, at this address.
    Bus(u32),
    InstructionBus,
    LazyFloat,
    ExecuteNever,
    SupervisorCall,
    Breakpoint(u8),
    /// EXC_RETURN loaded into the PC.
    Return(u32),
}

impl Cpu {
    #[inline(always)]
    pub(crate) fn execute<B: Bus>(&mut self, bus: &mut B, i: &Instruction) -> Result<(), Trap> {
        let pipelined = std::mem::take(&mut self.loaded);
        match i.op {
            Op::AluImmediate(alu) => self.alu_immediate(alu, i),
            Op::AluRegister(alu) => self.alu_register(alu, i),
            Op::AluShifted(alu) => self.alu_shifted(alu, i),
            Op::ShiftRegister(kind) => self.shift_register(kind, i),
            // The frequent widths have arms of their own, so that the compiler specialises them.
            Op::LoadOffset(Width::Word) => return self.load_offset(bus, i, Width::Word, pipelined),
            Op::LoadOffset(Width::Byte) => return self.load_offset(bus, i, Width::Byte, pipelined),
            Op::LoadOffset(width) => return self.load_offset(bus, i, width, pipelined),
            Op::LoadRegister(Width::Byte) => return self.load_register(bus, i, Width::Byte, pipelined),
            Op::LoadRegister(width) => return self.load_register(bus, i, width, pipelined),
            Op::StoreOffset(Width::Word) => return self.store_offset(bus, i, Width::Word),
            Op::StoreOffset(Width::Byte) => return self.store_offset(bus, i, Width::Byte),
            Op::StoreOffset(width) => return self.store_offset(bus, i, width),
            Op::StoreRegister(Width::Byte) => return self.store_register(bus, i, Width::Byte),
            Op::StoreRegister(width) => return self.store_register(bus, i, width),
            Op::BranchIf => {
                if self.condition(i.d) {
                    self.branch_relative(bus, i.immediate);
                }
            }
            Op::Branch => self.branch_relative(bus, i.immediate),
            Op::CompareBranch => {
                if (self.read(i.n) != 0) == i.flags.has(Flags::VARIANT) {
                    self.branch_relative(bus, i.immediate);
                }
            }
            Op::BranchLink => {
                self.r[14] = self.pc | 1;
                self.branch_relative(bus, i.immediate);
            }
            Op::Address => self.write(i.d, (self.r[15] & !3).wrapping_add(i.immediate)),
            Op::MoveTop => self.write(i.d, self.read(i.d) & 0xffff | i.immediate << 16),
            Op::BitfieldInsert => self.bitfield_insert(i),
            Op::UnsignedExtract => self.unsigned_extract(i),
            Op::SignedExtract => self.signed_extract(i),
            Op::Extend(kind) => self.extend(kind, i),
            Op::Reverse(kind) => self.reverse(kind, i),
            Op::Multiply(kind) => return self.multiply(kind, i),
            Op::LoadIndexed(width) => return self.load_indexed(bus, i, width, pipelined),
            Op::LoadLiteral(Width::Word) => return self.load_literal(bus, i, Width::Word, pipelined),
            Op::LoadLiteral(width) => return self.load_literal(bus, i, width, pipelined),
            Op::StoreIndexed(width) => return self.store_indexed(bus, i, width),
            Op::BranchExchange => return self.branch_exchange(bus, self.read(i.m)),
            Op::BranchLinkExchange => return self.branch_link_exchange(bus, i),
            Op::IfThen => self.it = i.immediate as u8,
            Op::LoadMultiple => return self.load_multiple(bus, i),
            Op::StoreMultiple => return self.store_multiple(bus, i),
            Op::LoadDual => return self.load_dual(bus, i),
            Op::StoreDual => return self.store_dual(bus, i),
            Op::Float(float) => return self.float(bus, float, i),
            Op::FloatLoad => return self.float_load(bus, i),
            Op::FloatStore => return self.float_store(bus, i),
            _ => return self.execute_rare(bus, i),
        }
        Ok(())
    }

    #[inline(never)]
    fn execute_rare<B: Bus>(&mut self, bus: &mut B, i: &Instruction) -> Result<(), Trap> {
        match i.op {
            Op::MoveToPc => self.branch_to(bus, self.read(i.m)),
            Op::AddToPc => self.branch_to(bus, self.r[15].wrapping_add(self.read(i.m))),
            Op::SignedSaturate => self.signed_saturate(i),
            Op::UnsignedSaturate => self.unsigned_saturate(i),
            Op::SignedSaturate16 => self.signed_saturate16(i),
            Op::UnsignedSaturate16 => self.unsigned_saturate16(i),
            Op::PackHalves => self.pack_halves(i),
            Op::Parallel(operation) => self.parallel(operation, i),
            Op::Select => self.select(i),
            Op::LoadExclusive(width) => return self.load_exclusive(bus, i, width),
            Op::StoreExclusive(width) => return self.store_exclusive(bus, i, width),
            Op::ClearExclusive => self.exclusive = false,
            Op::TableBranch => return self.table_branch(bus, i),
            Op::WaitForEvent => self.wait_for_event(),
            Op::WaitForInterrupt => self.sleep(Activity::AwaitingInterrupt),
            Op::SendEvent => self.event = true,
            Op::SupervisorCall => return Err(Trap::SupervisorCall),
            Op::Breakpoint => return Err(Trap::Breakpoint(i.immediate as u8)),
            Op::ChangeState => self.change_state(i),
            Op::MoveFromSpecial => {
                let value = self.read_special(i.immediate);
                self.write(i.d, value);
                self.now += 1;
            }
            Op::MoveToSpecial => {
                self.write_special(i.immediate, i.a, self.read(i.n));
                self.now += 1;
            }
            Op::Barrier => self.barrier(bus),
            Op::FloatLoadMultiple => return self.float_load_multiple(bus, i),
            Op::FloatStoreMultiple => return self.float_store_multiple(bus, i),
            Op::NoCoprocessor => return Err(Trap::NoCoprocessor),
            Op::Undefined => return Err(Trap::Undefined),
            _ => {}
        }
        Ok(())
    }

    #[inline(always)]
    pub(crate) fn read(&self, register: u8) -> u32 {
        self.r[usize::from(register & 15)]
    }

    /// Writes R0 to R14; the stack pointer keeps its low bits clear.
    #[inline(always)]
    pub(crate) fn write(&mut self, register: u8, value: u32) {
        self.r[usize::from(register & 15)] = if register == 13 { value & !3 } else { value };
    }

    /// Whether a condition holds (A7.3).
    #[inline(always)]
    pub(crate) fn condition(&self, condition: u8) -> bool {
        let holds = match condition >> 1 & 7 {
            0 => self.z,
            1 => self.c,
            2 => self.n,
            3 => self.v,
            4 => self.c && !self.z,
            5 => self.n == self.v,
            6 => self.n == self.v && !self.z,
            _ => return true,
        };
        holds != (condition & 1 != 0)
    }
}
