//! The peripherals of the chip: names, addresses, clock enables (RM0440 §2.2.2 and §7.4) and interrupts (§14.3).

use std::fmt;

/// A peripheral.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Unit {
    Rcc,
    Pwr,
    Flash,
    Syscfg,
    Exti,
    Iwdg,
    Rng,
    Crc,
    Debug,
    Dmamux,
    Dma(u8),
    Gpio(u8),
    Timer(TimerId),
    Uart(UartId),
    Spi(SpiId),
}

const PLAIN: [Unit; 10] = [
    Unit::Rcc,
    Unit::Pwr,
    Unit::Flash,
    Unit::Syscfg,
    Unit::Exti,
    Unit::Iwdg,
    Unit::Rng,
    Unit::Crc,
    Unit::Debug,
    Unit::Dmamux,
];
const DMA: usize = PLAIN.len();
const GPIO: usize = DMA + 2;
const TIMER: usize = GPIO + 7;
const UART: usize = TIMER + TimerId::COUNT;
const SPI: usize = UART + UartId::COUNT;

/// Number of peripherals; each has an index below this.
pub(crate) const UNITS: usize = SPI + SpiId::COUNT;

impl Unit {
    pub(crate) fn index(self) -> usize {
        match self {
            Self::Dma(number) => DMA + usize::from(number),
            Self::Gpio(port) => GPIO + usize::from(port),
            Self::Timer(timer) => TIMER + timer.index(),
            Self::Uart(uart) => UART + uart.index(),
            Self::Spi(spi) => SPI + spi.index(),
            plain => PLAIN.iter().position(|&unit| unit == plain).unwrap_or(0),
        }
    }

    /// The peripheral at `index`, below [`UNITS`].
    pub(crate) fn at(index: usize) -> Self {
        match index {
            SPI.. => Self::Spi(SpiId((index - SPI) as u8)),
            UART.. => Self::Uart(UartId((index - UART) as u8)),
            TIMER.. => Self::Timer(TimerId((index - TIMER) as u8)),
            GPIO.. => Self::Gpio((index - GPIO) as u8),
            DMA.. => Self::Dma((index - DMA) as u8),
            plain => PLAIN[plain],
        }
    }

    /// The address of its registers (RM0440 §2.2.2).
    pub(crate) fn base(self) -> u32 {
        match self {
            Self::Rcc => 0x4002_1000,
            Self::Pwr => 0x4000_7000,
            Self::Flash => 0x4002_2000,
            Self::Syscfg => 0x4001_0000,
            Self::Exti => 0x4001_0400,
            Self::Iwdg => 0x4000_3000,
            Self::Rng => 0x5006_0800,
            Self::Crc => 0x4002_3000,
            Self::Debug => 0xE004_2000,
            Self::Dmamux => 0x4002_0800,
            Self::Dma(number) => 0x4002_0000 + 0x400 * u32::from(number),
            Self::Gpio(port) => 0x4800_0000 + 0x400 * u32::from(port),
            Self::Timer(timer) => timer.base(),
            Self::Uart(uart) => uart.base(),
            Self::Spi(spi) => spi.base(),
        }
    }

    /// The RCC register (by offset) and bit that switch its clock on. `None` where it always runs.
    pub(crate) fn clock_enable(self) -> Option<(u32, u32)> {
        match self {
            Self::Rcc | Self::Exti | Self::Iwdg | Self::Debug => None,
            Self::Pwr => Some((0x58, 28)),
            Self::Flash => Some((0x48, 8)),
            Self::Syscfg => Some((0x60, 0)),
            Self::Rng => Some((0x4C, 26)),
            Self::Crc => Some((0x48, 12)),
            Self::Dmamux => Some((0x48, 2)),
            Self::Dma(number) => Some((0x48, u32::from(number))),
            Self::Gpio(port) => Some((0x4C, u32::from(port))),
            Self::Timer(timer) => Some(timer.clock_enable()),
            Self::Uart(uart) => Some(uart.clock_enable()),
            Self::Spi(spi) => Some(spi.clock_enable()),
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rcc => formatter.write_str("RCC"),
            Self::Pwr => formatter.write_str("PWR"),
            Self::Flash => formatter.write_str("FLASH"),
            Self::Syscfg => formatter.write_str("SYSCFG"),
            Self::Exti => formatter.write_str("EXTI"),
            Self::Iwdg => formatter.write_str("IWDG"),
            Self::Rng => formatter.write_str("RNG"),
            Self::Crc => formatter.write_str("CRC"),
            Self::Debug => formatter.write_str("DBGMCU"),
            Self::Dmamux => formatter.write_str("DMAMUX"),
            Self::Dma(number) => write!(formatter, "DMA{}", number + 1),
            Self::Gpio(port) => write!(formatter, "GPIO{}", char::from(b'A' + port)),
            Self::Timer(timer) => write!(formatter, "TIM{}", timer.number()),
            Self::Uart(uart) => write!(formatter, "{uart}"),
            Self::Spi(spi) => write!(formatter, "{spi}"),
        }
    }
}

/// A timer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TimerId(u8);

impl TimerId {
    pub(crate) const COUNT: usize = 12;
    const NUMBERS: [u8; Self::COUNT] = [1, 2, 3, 4, 5, 6, 7, 8, 15, 16, 17, 20];

    /// TIM`number`; `None` where the chip has no such timer.
    #[must_use]
    pub const fn new(number: u8) -> Option<Self> {
        let mut index = 0;
        while index < Self::COUNT {
            if Self::NUMBERS[index] == number {
                return Some(Self(index as u8));
            }
            index += 1;
        }
        None
    }

    /// The number in its name.
    #[must_use]
    pub const fn number(self) -> u8 {
        Self::NUMBERS[self.0 as usize]
    }

    pub(crate) const fn index(self) -> usize {
        self.0 as usize
    }

    pub(crate) fn all() -> impl Iterator<Item = Self> {
        (0..Self::COUNT as u8).map(Self)
    }

    fn base(self) -> u32 {
        match self.number() {
            1 => 0x4001_2C00,
            8 => 0x4001_3400,
            15 => 0x4001_4000,
            16 => 0x4001_4400,
            17 => 0x4001_4800,
            20 => 0x4001_5000,
            number => 0x4000_0000 + 0x400 * (u32::from(number) - 2),
        }
    }

    fn clock_enable(self) -> (u32, u32) {
        match self.number() {
            1 => (0x60, 11),
            8 => (0x60, 13),
            15 => (0x60, 16),
            16 => (0x60, 17),
            17 => (0x60, 18),
            20 => (0x60, 20),
            number => (0x58, u32::from(number) - 2),
        }
    }
}

/// A serial port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct UartId(u8);

impl UartId {
    pub(crate) const COUNT: usize = 6;
    /// USART1.
    pub const USART1: Self = Self(0);
    /// USART2.
    pub const USART2: Self = Self(1);
    /// USART3.
    pub const USART3: Self = Self(2);
    /// UART4.
    pub const UART4: Self = Self(3);
    /// UART5.
    pub const UART5: Self = Self(4);
    /// LPUART1: the virtual COM port of the NUCLEO board on PA2 and PA3.
    pub const LPUART1: Self = Self(5);

    pub(crate) const fn index(self) -> usize {
        self.0 as usize
    }

    /// All serial ports.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..Self::COUNT as u8).map(Self)
    }

    fn base(self) -> u32 {
        [0x4001_3800, 0x4000_4400, 0x4000_4800, 0x4000_4C00, 0x4000_5000, 0x4000_8000][self.index()]
    }

    fn clock_enable(self) -> (u32, u32) {
        [(0x60, 14), (0x58, 17), (0x58, 18), (0x58, 19), (0x58, 20), (0x5C, 0)][self.index()]
    }

    pub(crate) fn interrupt(self) -> u32 {
        [37, 38, 39, 52, 53, 91][self.index()]
    }

    /// Numbers of its DMA requests: receive and transmit (RM0440 §13.3.2).
    pub(crate) fn requests(self) -> [u8; 2] {
        [[24, 25], [26, 27], [28, 29], [30, 31], [32, 33], [34, 35]][self.index()]
    }
}

impl fmt::Display for UartId {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(["USART1", "USART2", "USART3", "UART4", "UART5", "LPUART1"][self.index()])
    }
}

/// A synchronous serial port.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SpiId(u8);

impl SpiId {
    pub(crate) const COUNT: usize = 3;
    /// SPI1.
    pub const SPI1: Self = Self(0);
    /// SPI2.
    pub const SPI2: Self = Self(1);
    /// SPI3.
    pub const SPI3: Self = Self(2);

    pub(crate) const fn index(self) -> usize {
        self.0 as usize
    }

    pub(crate) fn all() -> impl Iterator<Item = Self> {
        (0..Self::COUNT as u8).map(Self)
    }

    fn base(self) -> u32 {
        [0x4001_3000, 0x4000_3800, 0x4000_3C00][self.index()]
    }

    fn clock_enable(self) -> (u32, u32) {
        [(0x60, 12), (0x58, 14), (0x58, 15)][self.index()]
    }

    pub(crate) fn interrupt(self) -> u32 {
        [35, 36, 51][self.index()]
    }

    /// The peripheral bus that clocks it: APB1 (0) or APB2 (1).
    pub(crate) fn bus(self) -> usize {
        usize::from(self == Self::SPI1)
    }
}

impl fmt::Display for SpiId {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(["SPI1", "SPI2", "SPI3"][self.index()])
    }
}
