//! The seam between the core and the chip around it.

/// Core clock cycles since power-on.
pub type Cycle = u64;

/// No event is due.
pub const NEVER: Cycle = Cycle::MAX;

/// How many bytes an access moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// One.
    Byte,
    /// Two.
    Half,
    /// Four.
    Word,
}

/// An access that nothing answers, or that the chip refuses: a bus fault on the core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusFault;

/// Interrupt lines of the NVIC, line 0 in bit 0.
pub type Lines = u128;

/// What the core needs of a chip: its memories and peripherals, everything outside the internal part of the private
/// peripheral bus (`0xE000_0000..=0xE003_FFFF`, which is the core's own). The external part with the chip's debug
/// registers, DBGMCU among them, is the chip's.
///
/// The chip is event driven: [`next_event`](Self::next_event) says when something will happen by itself, and the core
/// calls [`advance`](Self::advance) no later than that.
pub trait Bus {
    /// Whether reading memory may raise the non-maskable interrupt, so that the core must look after each load.
    const READS_INTERRUPT: bool = false;

    /// Reads at `address`, aligned to the size of the access; the value is zero-extended.
    ///
    /// # Errors
    /// [`BusFault`] where nothing answers.
    fn read(&mut self, now: Cycle, address: u32, access: Access) -> Result<u32, BusFault>;

    /// Writes the low bytes of `value` at `address`, aligned to the size of the access.
    ///
    /// # Errors
    /// [`BusFault`] where nothing answers.
    fn write(&mut self, now: Cycle, address: u32, access: Access, value: u32) -> Result<(), BusFault>;

    /// Reads a half-word of code. Costs no time and has no side effect.
    ///
    /// # Errors
    /// [`BusFault`] where no memory answers.
    fn fetch(&self, address: u32) -> Result<u16, BusFault>;

    /// Changes whenever code may have changed other than by the core's own writes to RAM: after flash was erased or
    /// programmed, or memory was remapped. The core then forgets what it has decoded.
    fn code_version(&self) -> u64;

    /// Extra cycles a taken branch or a fetch costs because of flash wait states, at present.
    fn wait_states(&self, now: Cycle) -> u32;

    /// Brings every peripheral to `now`.
    fn advance(&mut self, now: Cycle);

    /// When a peripheral will next do something by itself.
    fn next_event(&self) -> Cycle;

    /// Interrupt lines that are asserted now (level).
    fn lines(&self) -> Lines;

    /// Whether the non-maskable interrupt is asserted now (level).
    fn nmi(&self) -> bool;

    /// Whether the chip wants [`Cpu::run`](crate::Cpu::run) to stop at the next instruction boundary, with
    /// [`Stop::Requested`](crate::Stop::Requested). Asked after every access to a peripheral and every event.
    fn stop_requested(&self) -> bool {
        false
    }
}
