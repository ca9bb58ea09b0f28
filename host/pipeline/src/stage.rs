//! The stages of the work on one pair, for callers who measure how long each takes.

/// A stage of the work on one pair of images, in the order in which they run.
///
/// Functions of this crate report the end of each stage to a callback. A caller with a clock reads it there:
///
/// ```
/// use vergence_pipeline::Stage;
///
/// let mut ended = Vec::new();
/// let mut on_end = |stage: Stage| ended.push(stage.as_str());
/// on_end(Stage::Match);
/// on_end(Stage::Triangulate);
/// assert_eq!(ended, ["match", "triangulate"]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[non_exhaustive]
pub enum Stage {
    /// Finding homologous points.
    Match,
    /// Making points of them.
    Triangulate,
    /// Dense: resampling both images onto views with common rows.
    Turn,
    /// Dense: comparing every pixel over all disparities.
    Sweep,
    /// Dense: registering the best disparity to a part of a pixel.
    Register,
    /// Dense: ranges and their uncertainty.
    Range,
}

impl Stage {
    /// The name in reports.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Match => "match",
            Self::Triangulate => "triangulate",
            Self::Turn => "turn",
            Self::Sweep => "sweep",
            Self::Register => "register",
            Self::Range => "range",
        }
    }
}
