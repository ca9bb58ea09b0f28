//! The times of [`crate::vision`] for people and for programs.

use serde_json::{Value, json};

use crate::lenses::LensTimes;
use crate::levels::LevelTimes;
use crate::vision::{OpenCvTimes, VisionBench, VisionTimes};

impl VisionTimes {
    /// Nanoseconds for people, with the ratio to those of the `peer`.
    #[must_use]
    pub fn in_words(&self, peer: Option<&OpenCvTimes>) -> String {
        let ratio = |ours: f64, theirs: f64| format!(" ({:.3})", ours / theirs);
        let project = peer.map_or(String::new(), |peer| ratio(self.project_ns, peer.project_ns));
        let derivatives = peer.map_or(String::new(), |peer| ratio(self.derivatives_ns, peer.derivatives_ns));
        let unproject = peer.map_or(String::new(), |peer| ratio(self.unproject_ns, peer.unproject_ns));
        format!(
            "project {:.1}{project}, with derivatives {:.1}{derivatives}, unproject {:.1}{unproject}, triangulate {:.1}, with shared \
             errors {:.1}",
            self.project_ns, self.derivatives_ns, self.unproject_ns, self.triangulate_ns, self.full_ns
        )
    }

    /// The times, for programs.
    fn json(&self) -> Value {
        json!({
            "project_ns": self.project_ns,
            "project_with_derivatives_ns": self.derivatives_ns,
            "unproject_ns": self.unproject_ns,
            "triangulate_ns": self.triangulate_ns,
            "triangulate_full_ns": self.full_ns,
        })
    }
}

impl VisionBench {
    /// All figures for programs.
    #[must_use]
    pub fn json(&self) -> Value {
        let opencv = |peer: &OpenCvTimes| json!({ "project_ns": peer.project_ns, "project_with_derivatives_ns": peer.derivatives_ns, "unproject_ns": peer.unproject_ns, "version": peer.version });
        let growth = |(points, times): &(u32, VisionTimes)| {
            let mut row = times.json();
            row["points"] = json!(points);
            row
        };
        json!({
            "project_ns": self.best.project_ns,
            "project_with_derivatives_ns": self.best.derivatives_ns,
            "unproject_ns": self.best.unproject_ns,
            "max_ray_error_rad": self.max_ray_error,
            "triangulate_mpts_per_s": 1e3 / self.best.triangulate_ns,
            "triangulate_full_mpts_per_s": 1e3 / self.best.full_ns,
            "instructions": self.instructions,
            "anew": self.anew.json(),
            "baseline": {
                "project_ns": self.baseline.project_ns,
                "project_with_derivatives_ns": self.baseline.derivatives_ns,
                "unproject_ns": self.baseline.unproject_ns,
                "triangulate_mpts_per_s": 1e3 / self.baseline.triangulate_ns,
                "triangulate_full_mpts_per_s": 1e3 / self.baseline.full_ns,
            },
            "opencv": self.opencv.as_ref().map_or(Value::Null, opencv),
            "lenses": self.lenses.iter().map(LensTimes::json).collect::<Vec<_>>(),
            "levels": self.levels.iter().map(LevelTimes::json).collect::<Vec<_>>(),
            "growth": self.growth.iter().map(growth).collect::<Vec<_>>(),
        })
    }
}
