//! A bench with a linear stage for the baseline and a pinion stage for each camera.
//!
//! Steps of the third axis need PB2, because TIM20 has no other pin on this package: the encoders of the other axes move. The
//! third encoder counts 16 bits, which the program extends; it has no index line and no place on the bus of absolute encoders.

use vergence_protocol::AxisKind;

/// The axes, in the order of the rig file.
pub const AXES: [AxisKind; 3] = [AxisKind::Linear, AxisKind::Rotary, AxisKind::Rotary];

/// What each axis is wired to, in the same order.
macro_rules! stages {
    ($p:ident) => {{
        let baseline = Stage {
            steps: StepPulses::new($p.TIM1, $p.PA8, $p.PA9, $p.DMA1_CH3),
            encoder: Encoder::new($p.TIM2, $p.PA15, $p.PA1),
            home_switch: Input::new($p.PC0, Pull::Up),
            hard_limit: Input::new($p.PC2, Pull::Up),
        };
        let left = Stage {
            steps: StepPulses::new($p.TIM8, $p.PC6, $p.PC8, $p.DMA1_CH4),
            encoder: Encoder::new($p.TIM5, $p.PA0, $p.PC12),
            home_switch: Input::new($p.PC1, Pull::Up),
            hard_limit: Input::new($p.PC3, Pull::Up),
        };
        let right = Stage {
            steps: StepPulses::new($p.TIM20, $p.PB2, $p.PC9, $p.DMA1_CH5),
            encoder: Encoder::of_16_bits($p.TIM3, $p.PB4, $p.PC7),
            home_switch: Input::new($p.PB1, Pull::Up),
            hard_limit: Input::new($p.PC5, Pull::Up),
        };
        [baseline, left, right]
    }};
}

pub(crate) use stages;
