//! Checks of input and results that are well formed and still cannot be meant: swapped images, a photograph used twice, cameras in the
//! wrong unit. One function is one check with its sentence. Pure.

pub mod images;
pub mod pose;
pub mod views;

/// Input or a result that cannot be meant, as a sentence that says what, where and what to ask oneself.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Implausible {
    /// What was read.
    #[error("{0}")]
    Input(String),
    /// What came out.
    #[error("{0}")]
    Result(String),
}
