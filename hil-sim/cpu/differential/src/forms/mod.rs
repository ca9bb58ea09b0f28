//! The instruction forms, by theme. R0 to R4 and S0 to S3 are operands, R5 points to memory; R6 to R12 and LR are kept.

mod arithmetic;
mod branch;
mod float;
mod memory;
mod multiply;
mod parallel;

use crate::call::Form;

/// Forms that work on core registers, flags and memory.
pub const INTEGER: &[&[Form]] =
    &[arithmetic::NARROW, arithmetic::WIDE, multiply::FORMS, parallel::FORMS, memory::FORMS, branch::FORMS];
/// Forms of the FPU, run in every mode.
pub const FLOAT: &[Form] = float::FORMS;
