//! OpenCV on the same pairs.

use vergence_vision::{Pixel, median};

use super::rendered::LiveFrames;
use crate::error::BenchError;
use crate::python::ask_python;

/// Script that times OpenCV; it needs only OpenCV.
const SCRIPT: &str = include_str!("opencv_live.py");
/// Pairs that OpenCV matches.
const PAIRS: usize = 4;

/// One way of OpenCV.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PeerMatching {
    /// Median of the milliseconds for a pair.
    pub milliseconds: f64,
    /// Right matches of all pairs, and all.
    pub matches: [usize; 2],
    /// Pairs.
    pub pairs: usize,
}

/// Both ways of OpenCV.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PeerMatches {
    /// The version of OpenCV.
    pub version: String,
    /// `ORB` with 2000 features and `BFMatcher` with a cross check.
    pub orb: PeerMatching,
    /// `calcOpticalFlowPyrLK` from left to right and back.
    pub flow: PeerMatching,
}

#[derive(serde::Deserialize)]
struct Answer {
    version: String,
    orb: Measured,
    flow: Measured,
}

#[derive(serde::Deserialize)]
struct Measured {
    milliseconds: Vec<f64>,
    matches: Vec<Vec<[f64; 4]>>,
}

impl PeerMatches {
    /// Lets OpenCV in the interpreter `python` match some pairs of `frames`.
    ///
    /// # Errors
    /// Where no temporary file can be written, or Python or OpenCV is missing.
    pub fn of(frames: &LiveFrames, python: &str) -> Result<Self, BenchError> {
        let folder = tempfile::tempdir().map_err(BenchError::temporary)?;
        let mut paths = Vec::new();
        for (number, frame) in frames.different().iter().take(PAIRS).enumerate() {
            for (name, image) in ["left", "right"].into_iter().zip(frame.images()) {
                let path = folder.path().join(format!("{number}-{name}.png"));
                image.save(&path).map_err(BenchError::temporary)?;
                paths.push(path.display().to_string());
            }
        }
        let Answer { version, orb, flow } = ask_python(python, SCRIPT, paths).map_err(BenchError::Peer)?;
        let judged = |of: Measured| {
            let pairs = of.matches.iter().zip(frames.different());
            let right = pairs.map(|(matches, frame)| {
                let pixels = matches.iter().map(|&[u, v, s, t]| [Pixel { u, v }, Pixel { u: s, v: t }]);
                pixels.filter(|pair| frames.is_right(frame, *pair)).count()
            });
            PeerMatching {
                milliseconds: median(of.milliseconds).unwrap_or_default(),
                matches: [right.sum(), of.matches.iter().map(Vec::len).sum()],
                pairs: of.matches.len(),
            }
        };
        Ok(Self { version, orb: judged(orb), flow: judged(flow) })
    }
}
