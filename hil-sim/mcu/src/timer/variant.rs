//! The differences between the timers (RM0440 §28.2, §29.2, §30.2, §31.2; interrupts §14.3, DMA requests §13.3.2).

use vergence_cpu::Lines;

use crate::unit::TimerId;

/// The features of a timer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Variant {
    /// Peripheral bus that clocks the timer: 0 for APB1.
    pub bus: usize,
    pub channels: usize,
    /// The highest count: 16 or 32 bits.
    pub highest: u32,
    /// The highest repetition count; zero without repetition counter.
    pub highest_repetition: u32,
    /// Whether outputs need BDTR.MOE.
    pub has_main_switch: bool,
    /// NVIC lines of break, update, trigger and channels.
    interrupts: [u32; 4],
    /// DMA requests of the channels, the update and the trigger.
    requests: [u8; 6],
}

/// Marks a DMA request that does not exist.
const NONE: u8 = 0;

impl Variant {
    pub fn of(id: TimerId) -> Self {
        let general = |line: u32, wide: bool, requests: [u8; 6]| Self {
            bus: 0,
            channels: 4,
            highest: if wide { u32::MAX } else { 0xFFFF },
            highest_repetition: 0,
            has_main_switch: false,
            interrupts: [line; 4],
            requests,
        };
        let advanced = |interrupts: [u32; 4], first: u8, trigger: u8| Self {
            bus: 1,
            highest_repetition: 0xFFFF,
            has_main_switch: true,
            interrupts,
            requests: [first, first + 1, first + 2, first + 3, first + 4, trigger],
            ..general(0, false, [NONE; 6])
        };
        let small = |channels: usize, line: u32, requests: [u8; 6]| Self {
            channels,
            highest_repetition: 0xFF,
            ..Self { interrupts: [line; 4], requests, ..advanced([0; 4], 1, NONE) }
        };
        let basic = |line: u32, update: u8| Self {
            channels: 0,
            ..general(line, false, [NONE, NONE, NONE, NONE, update, NONE])
        };
        match id.number() {
            1 => advanced([24, 25, 26, 27], 42, 47),
            8 => advanced([43, 44, 45, 46], 49, 54),
            20 => advanced([77, 78, 79, 80], 86, 93),
            2 => general(28, true, [56, 57, 58, 59, 60, NONE]),
            3 => general(29, false, [61, 62, 63, 64, 65, 66]),
            4 => general(30, false, [67, 68, 69, 70, 71, NONE]),
            5 => general(50, true, [72, 73, 74, 75, 76, 77]),
            6 => basic(54, 8),
            7 => basic(55, 9),
            15 => small(2, 24, [78, NONE, NONE, NONE, 79, 80]),
            16 => small(1, 25, [82, NONE, NONE, NONE, 83, NONE]),
            _ => small(1, 26, [84, NONE, NONE, NONE, 85, NONE]),
        }
    }

    /// NVIC lines for flags that are raised and enabled.
    pub fn lines(&self, flags: u32) -> Lines {
        const BREAK: u32 = 0x80;
        const UPDATE: u32 = 0x01;
        const TRIGGER: u32 = 0x60;
        const CHANNELS: u32 = 0x1E;
        [BREAK, UPDATE, TRIGGER, CHANNELS]
            .iter()
            .zip(self.interrupts)
            .filter(|(group, _)| flags & **group != 0)
            .fold(0, |lines, (_, line)| lines | 1 << line)
    }

    /// The request of this timer with this number: 0 the update, 1 to 4 the channels, 6 the trigger.
    pub fn request_bit(&self, number: u8) -> Option<u32> {
        let index = self.requests.iter().position(|&request| request == number && number != NONE)?;
        Some([1, 2, 3, 4, 0, 6][index])
    }
}

/// The timer that a DMA request belongs to.
pub(crate) fn timer_of_request(number: u8) -> Option<TimerId> {
    TimerId::all().find(|&id| Variant::of(id).request_bit(number).is_some())
}
