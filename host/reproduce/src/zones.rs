//! The zones of the paper's modes: as published, by the printed equation, and exact.

use vergence_vision::{
    PAPER_FIELD, PUBLISHED_MODES, PublishedMode, Zones, paper_eq3, paper_eq3_applies, symmetric_pair, zones_exact,
};

/// A mode's zones three times.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModeZones {
    /// As published, and the nominal pose.
    pub published: PublishedMode,
    /// By counting intervals; `None` for a pose that has no zones.
    pub exact: Option<Zones>,
    /// Equation 3 of the paper as printed; `None` outside its domain.
    pub paper_eq3: Option<Zones>,
}

/// All modes.
#[must_use]
pub fn mode_zones() -> Vec<ModeZones> {
    PUBLISHED_MODES.into_iter().map(of).collect()
}

fn of(published: PublishedMode) -> ModeZones {
    let PublishedMode { baseline, separation, radius, .. } = published;
    let applies = paper_eq3_applies(PAPER_FIELD, separation, baseline, radius);
    ModeZones {
        published,
        exact: zones_exact(symmetric_pair(baseline, separation, PAPER_FIELD), radius).ok().map(|map| map.zones),
        paper_eq3: applies.then(|| paper_eq3(PAPER_FIELD, separation, baseline, radius)),
    }
}
