//! The bus of absolute encoders (AS5048A) on SPI1: frames of 16 bits, mode 1, at 5.3 MHz. Both encoders share the bus, and each has
//! a line that selects it. A frame takes 4 us, and the tick waits for it.

use embassy_stm32::gpio::{AfType, Flex, Level, Output, OutputType, Pull, Speed};
use embassy_stm32::pac::SPI1;
use embassy_stm32::pac::spi::vals::{Br, Cpha, Cpol, Ds, Frxth, Mstr};
use embassy_stm32::spi::{MisoPin, MosiPin, SckPin};
use embassy_stm32::{Peri, peripherals, rcc};
use vergence_control::{As5048a, EncoderKind};
use vergence_protocol::EncoderState;

/// Number of encoders on the bus.
const ENCODERS: usize = 2;
/// Core cycles of 400 ns: between selection and clock, and between two frames, the encoder needs 350 ns.
const PAUSE: u32 = 68;
/// Reads of the status in which a frame must end: it takes some sixty.
const PATIENCE: u32 = 1_000;

/// The bus, and what is known of the encoders in use.
pub struct AbsoluteEncoders {
    _lines: [Flex<'static>; 3],
    select: [Output<'static>; ENCODERS],
    known: [Option<As5048a>; ENCODERS],
}

impl AbsoluteEncoders {
    /// Sets up the bus; no encoder is in use yet. The line of the answers is pulled up, so that it does not float where no
    /// encoder is.
    pub fn new<T: embassy_stm32::spi::Instance>(
        _port: Peri<'static, peripherals::SPI1>,
        clock: Peri<'static, impl SckPin<T>>,
        answer: Peri<'static, impl MisoPin<T>>,
        question: Peri<'static, impl MosiPin<T>>,
        select: [Peri<'static, embassy_stm32::gpio::AnyPin>; ENCODERS],
    ) -> Self {
        let functions = [clock.af_num(), answer.af_num(), question.af_num()];
        let mut lines = [Flex::new(clock), Flex::new(answer), Flex::new(question)];
        let output = || AfType::output(OutputType::PushPull, Speed::Medium);
        for ((line, function), kind) in
            lines.iter_mut().zip(functions).zip([output(), AfType::input(Pull::Up), output()])
        {
            line.set_as_af_unchecked(function, kind);
        }
        rcc::enable_and_reset::<peripherals::SPI1>();
        SPI1.cr2().write(|w| {
            w.set_ds(Ds::BITS16);
            w.set_frxth(Frxth::HALF);
        });
        // APB2 runs at 170 MHz; the encoder takes up to 10 MHz.
        SPI1.cr1().write(|w| {
            w.set_cpol(Cpol::IDLE_LOW);
            w.set_cpha(Cpha::SECOND_EDGE);
            w.set_mstr(Mstr::MASTER);
            w.set_br(Br::DIV32);
            w.set_ssm(true);
            w.set_ssi(true);
            w.set_spe(true);
        });
        let select = select.map(|pin| Output::new(pin, Level::High, Speed::Medium));
        Self { _lines: lines, select, known: [None; ENCODERS] }
    }

    /// Reads the encoder of an axis from now on, or no more.
    pub fn use_encoder(&mut self, axis: usize, kind: EncoderKind) {
        if let Some(known) = self.known.get_mut(axis) {
            *known = match kind {
                EncoderKind::Quadrature | EncoderKind::Servo => None,
                EncoderKind::As5048a => known.or(Some(As5048a::default())),
            };
        }
    }

    /// Asks all encoders in use.
    pub fn ask(&mut self) {
        for (known, select) in self.known.iter_mut().zip(&mut self.select) {
            if let Some(known) = known {
                known.ask(|word| exchange(select, word));
            }
        }
    }

    /// The count of an encoder in use.
    pub fn count(&self, axis: usize) -> Option<i32> {
        self.known.get(axis)?.map(|known| known.count())
    }

    /// State of the encoder of an axis.
    pub fn state(&self, axis: usize) -> EncoderState {
        self.known.get(axis).copied().flatten().map_or(EncoderState::Plain, |known| known.state())
    }
}

/// Sends a word in a frame of its own and returns the word received; `None` if the port does not work. Not inlined: two frames are
/// asked for in one place.
#[inline(never)]
fn exchange(select: &mut Output<'static>, word: u16) -> Option<u16> {
    select.set_low();
    cortex_m::asm::delay(PAUSE);
    SPI1.dr16().write_value(word);
    let came = (0..PATIENCE).any(|_| SPI1.sr().read().rxne());
    let answer = SPI1.dr16().read();
    select.set_high();
    cortex_m::asm::delay(PAUSE);
    came.then_some(answer)
}
