//! The bench: a linear stage for the baseline, and a pinion stage for the separation.

use vergence_protocol::AxisKind;

/// The axes, in the order of the rig file.
pub const AXES: [AxisKind; 2] = [AxisKind::Linear, AxisKind::Rotary];

/// What each axis is wired to, in the same order.
macro_rules! stages {
    ($p:ident) => {{
        let baseline = Stage {
            steps: StepPulses::new($p.TIM1, $p.PA8, $p.PA9, $p.DMA1_CH3),
            encoder: Encoder::new($p.TIM2, $p.PA0, $p.PA1),
            home_switch: Input::new($p.PC0, Pull::Up),
            hard_limit: Input::new($p.PC2, Pull::Up),
        };
        let separation = Stage {
            steps: StepPulses::new($p.TIM8, $p.PC6, $p.PC8, $p.DMA1_CH4),
            encoder: Encoder::new($p.TIM5, $p.PB2, $p.PC12),
            home_switch: Input::new($p.PC1, Pull::Up),
            hard_limit: Input::new($p.PC3, Pull::Up),
        };
        [baseline, separation]
    }};
}

pub(crate) use stages;
