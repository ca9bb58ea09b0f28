//! The interface between the core and the chip around it.

/// Core clock cycles since power-on.
pub type Cycle = u64;

/// The cycle of an event that never comes.
pub const NEVER: Cycle = Cycle::MAX;

/// Number of bytes that an access moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// One byte.
    Byte,
    /// Two bytes.
    Half,
    /// Four bytes.
    Word,
}

/// An access that no memory or peripheral answers, or that the chip refuses: a bus fault on the core.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusFault;

/// Interrupt lines of the NVIC, line 0 in bit 0.
pub type Lines = u128;

/// What the core needs from a chip: its memories and peripherals. The internal part of the private peripheral bus
/// (`0xE000_0000..=0xE003_FFFF`) belongs to the core; its external part with the chip's debug registers, DBGMCU among
/// them, belongs to the chip.
///
/// The chip is event driven: [`next_event`](Self::next_event) gives the cycle of its next own event, and the core
/// calls [`advance`](Self::advance) no later than that.
pub trait Bus {
    /// Whether reading memory may raise the non-maskable interrupt: the core then checks after each load.
    const READS_INTERRUPT: bool = false;

    /// Reads at `address`, aligned to the size of the access; the value is zero-extended.
    ///
    /// # Errors
    /// [`BusFault`] where no memory or peripheral answers.
    fn read(&mut self, now: Cycle, address: u32, access: Access) -> Result<u32, BusFault>;

    /// Writes the low bytes of `value` at `address`, aligned to the size of the access.
    ///
    /// # Errors
    /// [`BusFault`] where no memory or peripheral answers.
    fn write(&mut self, now: Cycle, address: u32, access: Access, value: u32) -> Result<(), BusFault>;

    /// Reads a half-word of code. Costs no time and has no side effect.
    ///
    /// # Errors
    /// [`BusFault`] where no memory answers.
    fn fetch(&self, address: u32) -> Result<u16, BusFault>;

    /// Changes whenever code may have changed other than by the core's own writes to RAM: after flash was erased or
    /// programmed, or memory was remapped. The core then drops its decoded instructions.
    fn code_version(&self) -> u64;

    /// Extra cycles that a taken branch or a fetch costs at present because of flash wait states.
    fn wait_states(&self, now: Cycle) -> u32;

    /// Advances every peripheral to `now`.
    fn advance(&mut self, now: Cycle);

    /// The cycle at which a peripheral next changes by itself.
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
