//! Checks kept models: digests, tensors, and one run on each runtime.

use vergence_matching::learned::Model;

use crate::Clock;
use crate::error::ModelsError;
use crate::pattern::{Pattern, SMALL_KEYPOINTS};
use crate::runtime::{Runtime, threads};
use crate::speed::Speed;
use crate::store::{ModelStore, load};

/// Keypoints this near are the same, in pixels.
const SAME_PLACE: f32 = 0.5;

/// Result of a model on one runtime.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// The runtime's name.
    pub runtime: &'static str,
    /// Keypoints of a drawn pattern that match themselves, or why the model cannot be used.
    pub matches: Result<usize, ModelsError>,
    /// Seconds for the pattern; `None` where the model was not timed because a runtime cannot use it.
    pub seconds: Option<f64>,
}

impl Verdict {
    /// Matches and time, or why the model cannot be used.
    #[must_use]
    pub fn in_words(&self) -> String {
        match (&self.matches, self.seconds) {
            (Ok(matches), Some(seconds)) => format!("ok: {matches} matches of a pattern with itself, {seconds:.2} s"),
            (Ok(matches), None) => format!("ok: {matches} matches of a pattern with itself"),
            (Err(error), _) => error.to_string(),
        }
    }
}

/// Runs the model `name` on every runtime, one verdict each. Where all of them can use it, it is timed, and the times are
/// kept beside the model: [`crate::choose`] reads them.
///
/// # Errors
/// Fails if the times cannot be written.
pub fn verify(store: &ModelStore, name: &str, runtimes: &[Runtime], clock: Clock) -> Result<Vec<Verdict>, ModelsError> {
    let folder = store.path(name);
    let outcomes: Vec<_> = runtimes
        .iter()
        .map(|runtime| (runtime, load(&folder, runtime).and_then(|model| match_with_itself(&model))))
        .collect();
    let sound = outcomes.iter().all(|(_, outcome)| outcome.is_ok());
    let speed = if sound { Speed::measure(&folder, runtimes, threads(), clock)? } else { Speed::default() };
    let verdict =
        |(runtime, matches): (&Runtime, _)| Verdict { runtime: runtime.name(), matches, seconds: speed.of(runtime) };
    Ok(outcomes.into_iter().map(verdict).collect())
}

/// Counts the keypoints of the pattern that match themselves.
fn match_with_itself(model: &Model) -> Result<usize, ModelsError> {
    let found = Pattern::small().with_itself(model, SMALL_KEYPOINTS).map_err(ModelsError::Run)?;
    let same = |&&(i, j, _): &&(usize, usize, f32)| {
        let [[x, y], [to_x, to_y]] = [found.keypoints[0][i], found.keypoints[1][j]];
        (to_x - x).hypot(to_y - y) < SAME_PLACE
    };
    let alike = found.matches.iter().filter(same).count();
    let keypoints = found.keypoints[0].len();
    if alike * 2 < keypoints || alike == 0 { Err(ModelsError::Mismatch { alike, keypoints }) } else { Ok(alike) }
}
