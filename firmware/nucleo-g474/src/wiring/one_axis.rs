//! A bench with a linear stage for the baseline alone.

use vergence_protocol::AxisKind;

/// The axes, in the order of the rig file.
pub const AXES: [AxisKind; 1] = [AxisKind::Linear];

/// What each axis is wired to, in the same order.
macro_rules! stages {
    ($p:ident) => {{
        let baseline = Stage {
            steps: StepPulses::new($p.TIM1, $p.PA8, $p.PA9, $p.DMA1_CH3),
            encoder: Encoder::new($p.TIM2, $p.PA0, $p.PA1),
            home_switch: Input::new($p.PC0, Pull::Up),
            hard_limit: Input::new($p.PC2, Pull::Up),
        };
        [baseline]
    }};
}

pub(crate) use stages;
