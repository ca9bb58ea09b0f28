//! What can be wrong with a servo or its connection.

/// Faults of one servo, from now on until they are changed. Counts go down as they are used up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ServoFaults {
    /// It neither hears nor answers.
    pub is_silent: bool,
    /// So many answers still to come have a wrong bit.
    pub flipped_answers: u32,
    /// So many answers still to come carry the next number in place of its own.
    pub wrong_ids: u32,
    /// So many answers still to come are not sent.
    pub lost_answers: u32,
    /// So many instructions still to come are not heard.
    pub lost_instructions: u32,
    /// Its encoder does not work: the position stands still.
    pub encoder_broken: bool,
}

impl ServoFaults {
    /// Takes one off a count; whether there was one.
    pub(super) fn use_up(count: &mut u32) -> bool {
        let any = *count > 0;
        *count = count.saturating_sub(1);
        any
    }
}
