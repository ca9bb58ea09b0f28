//! The operations of the instruction set.

/// What an instruction does. Names follow the ARMv7-M Architecture Reference Manual, spelled out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Op {
    // --- data processing: d = n op operand
    /// Operand: the immediate.
    AluImmediate(Alu),
    /// Operand: m.
    AluRegister(Alu),
    /// Operand: m shifted by the constant in `immediate` (see [`Shift::pack`]).
    AluShifted(Alu),
    /// d = n shifted by the low byte of m.
    ShiftRegister(Shift),
    /// d = Align(PC, 4) + immediate.
    Address,
    /// d<31:16> = immediate.
    MoveTop,
    /// PC = m.
    MoveToPc,
    /// PC = PC + m.
    AddToPc,
    /// d = n with `a` bits from m at bit `immediate`; m = 15 clears.
    BitfieldInsert,
    /// d = `a` bits of n from bit `immediate`, zero-extended.
    UnsignedExtract,
    /// Extract and sign-extend.
    SignedExtract,
    /// d = n + extended(m rotated right by `immediate`); n = 15 adds nothing.
    Extend(Extend),
    /// d = reversed m.
    Reverse(Reverse),
    /// d = saturated shifted n to `a` bits (shift in `immediate`).
    SignedSaturate,
    UnsignedSaturate,
    /// Signed saturation of both halves, without shift.
    SignedSaturate16,
    UnsignedSaturate16,
    /// d = halves of n and of shifted m; VARIANT takes the top of n.
    PackHalves,
    /// Multiplications and the DSP extension.
    Multiply(Multiply),
    /// Two or four lanes at once; the kind of arithmetic is in `immediate` (see [`Lane`]).
    Parallel(Parallel),
    /// Bytes of n or m as the GE flags say.
    Select,
    // --- memory
    /// d = [n + immediate].
    LoadOffset(Width),
    /// d = [n + (m << immediate)].
    LoadRegister(Width),
    /// d = [n +- ...] with PRE_INDEX and WRITE_BACK.
    LoadIndexed(Width),
    /// d = [Align(PC, 4) + immediate].
    LoadLiteral(Width),
    StoreOffset(Width),
    StoreRegister(Width),
    StoreIndexed(Width),
    /// d and a from two words; n = 15 is a literal.
    LoadDual,
    StoreDual,
    /// Registers in the bits of `immediate`; VARIANT decrements before.
    LoadMultiple,
    StoreMultiple,
    LoadExclusive(Width),
    /// d = status, a = the register stored.
    StoreExclusive(Width),
    ClearExclusive,
    // --- branches
    Branch,
    /// On the condition in d.
    BranchIf,
    BranchLink,
    /// To m.
    BranchExchange,
    BranchLinkExchange,
    /// When n is zero; VARIANT: when it is not.
    CompareBranch,
    /// By the table of bytes at n indexed by m; VARIANT: of half-words.
    TableBranch,
    // --- system
    IfThen,
    Nop,
    WaitForEvent,
    WaitForInterrupt,
    SendEvent,
    SupervisorCall,
    Breakpoint,
    /// Sets (VARIANT) or clears PRIMASK (bit 1 of `immediate`) and FAULTMASK (bit 0).
    ChangeState,
    MoveFromSpecial,
    /// `a`: the mask of APSR fields.
    MoveToSpecial,
    Barrier,
    Undefined,
    NoCoprocessor,
    // --- floating point
    Float(Float),
    /// Doubles are two singles: `a` words from S register d at n + immediate.
    FloatLoad,
    FloatStore,
    /// `a` words, VARIANT decrements before.
    FloatLoadMultiple,
    FloatStoreMultiple,
}

/// Data-processing operations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Alu {
    And,
    BitClear,
    Or,
    OrNot,
    ExclusiveOr,
    Add,
    AddCarry,
    Subtract,
    SubtractCarry,
    ReverseSubtract,
    Move,
    MoveNot,
    Test,
    TestEqual,
    Compare,
    CompareNegative,
}

/// Kinds of shift.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shift {
    Left,
    Right,
    Arithmetic,
    Rotate,
    /// Rotate right by one through the carry.
    Extended,
}

impl Shift {
    /// Kind and amount in one word.
    pub const fn pack(self, amount: u32) -> u32 {
        ((self as u32) << 8) | amount
    }

    #[inline(always)]
    pub const fn unpack(word: u32) -> (Self, u32) {
        let kind = match word >> 8 {
            0 => Self::Left,
            1 => Self::Right,
            2 => Self::Arithmetic,
            3 => Self::Rotate,
            _ => Self::Extended,
        };
        (kind, word & 0xff)
    }

    /// DecodeImmShift() of the architecture: an amount of zero means 32, or a rotation through the carry.
    pub const fn from_immediate(kind: u16, amount: u16) -> u32 {
        let amount = amount as u32;
        match (kind & 3, amount) {
            (0, _) => Self::Left.pack(amount),
            (1, 0) => Self::Right.pack(32),
            (1, _) => Self::Right.pack(amount),
            (2, 0) => Self::Arithmetic.pack(32),
            (2, _) => Self::Arithmetic.pack(amount),
            (_, 0) => Self::Extended.pack(1),
            _ => Self::Rotate.pack(amount),
        }
    }
}

/// Kinds of extension.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Extend {
    SignedByte,
    SignedHalf,
    UnsignedByte,
    UnsignedHalf,
    SignedBytes16,
    UnsignedBytes16,
}

/// Kinds of reversal; counting leading zeros is encoded beside them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Reverse {
    Bytes,
    BytesInHalves,
    SignedHalf,
    Bits,
    LeadingZeros,
}

/// Size and signedness of the value that a load or store moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Width {
    Word,
    Half,
    Byte,
    SignedHalf,
    SignedByte,
}

/// Multiplications: d (and a) from n, m and the accumulator a. Bit 0 of `immediate` takes the top half of m, bit 1 that
/// of n; VARIANT exchanges the halves of m or rounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Multiply {
    Low,
    Accumulate,
    Subtract,
    SignedDivide,
    UnsignedDivide,
    /// Long forms: a:d, high word in a.
    SignedLong,
    UnsignedLong,
    SignedLongAccumulate,
    UnsignedLongAccumulate,
    UnsignedLongAccumulateAccumulate,
    /// 16 x 16.
    Halves,
    HalvesAccumulate,
    HalvesLongAccumulate,
    /// 32 x 16.
    WordHalf,
    WordHalfAccumulate,
    /// Upper word of 32 x 32.
    MostSignificant,
    MostSignificantAccumulate,
    MostSignificantSubtract,
    /// Sum or difference of two 16 x 16.
    DualAdd,
    DualAddAccumulate,
    DualSubtract,
    DualSubtractAccumulate,
    DualAddLong,
    DualSubtractLong,
    /// Saturating additions of words: m +- n, m +- 2n.
    SaturatingAdd,
    SaturatingSubtract,
    SaturatingDoubleAdd,
    SaturatingDoubleSubtract,
    /// Sum of absolute differences of bytes.
    AbsoluteDifferences,
    AbsoluteDifferencesAccumulate,
}

/// Operation on each lane of a parallel instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Parallel {
    Add16,
    /// Exchange, add the top and subtract the bottom.
    AddSubtract,
    SubtractAdd,
    Subtract16,
    Add8,
    Subtract8,
}

/// The arithmetic of a lane.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lane {
    Signed,
    SignedSaturating,
    SignedHalving,
    Unsigned,
    UnsignedSaturating,
    UnsignedHalving,
}

impl Lane {
    #[inline(always)]
    pub const fn unpack(word: u32) -> Self {
        match word {
            0 => Self::Signed,
            1 => Self::SignedSaturating,
            2 => Self::SignedHalving,
            3 => Self::Unsigned,
            4 => Self::UnsignedSaturating,
            _ => Self::UnsignedHalving,
        }
    }
}

/// Floating-point operations on S registers d, n, m; core registers where stated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Float {
    Add,
    Subtract,
    Multiply,
    MultiplyNegate,
    Divide,
    MultiplyAccumulate,
    MultiplySubtract,
    NegateMultiplyAccumulate,
    NegateMultiplySubtract,
    FusedAccumulate,
    FusedSubtract,
    FusedNegateAccumulate,
    FusedNegateSubtract,
    Absolute,
    Negate,
    SquareRoot,
    Move,
    /// d = immediate.
    MoveImmediate,
    /// VARIANT signals on quiet NaNs too.
    Compare,
    CompareZero,
    /// VARIANT takes the top half.
    FromHalf,
    ToHalf,
    FromSigned,
    FromUnsigned,
    /// VARIANT rounds as FPSCR says instead of towards zero.
    ToSigned,
    ToUnsigned,
    /// In place in d; `immediate` fraction bits of `a`.
    FromSignedFixed,
    FromUnsignedFixed,
    ToSignedFixed,
    ToUnsignedFixed,
    /// S n = core d.
    FromCore,
    /// Core d = S n.
    ToCore,
    /// S m, S m+1 = core d, core n.
    FromCorePair,
    ToCorePair,
    /// Core d = FPSCR; d = 15: to the APSR flags.
    StatusToCore,
    StatusFromCore,
}
